"""First losses of static stability (Eq. 7) of any controller: its own fast way, or its plan looked at."""

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.protocol import Controller, FastLosses, Plan
from hexmj.stability import walk_margin
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk

CHUNK, BLOCK = 200, 2000
"""Steps and starts of a plan held in memory at a time."""


def begin(
    controller: Controller,
    starts: ArrayLike,
    velocity: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> Plan:
    """A plan of checked starts and velocities; one velocity stands for all starts.

    Raises:
        InputError: a controller, start or velocity that makes no sense.
    """
    x = checked_starts(starts, stride)
    v = checked_velocities(velocity, len(x), acceleration)
    return controller.begin(x, v, stride, acceleration, threads)


def first_losses(
    controller: Controller,
    starts: np.ndarray,
    velocity: np.ndarray,
    steps: np.ndarray,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """The first of each start's `steps`, (start,), that is statically unstable, counted from 1; 0 where none is."""
    if isinstance(controller, FastLosses):
        return controller.first_losses(starts, velocity, steps, stride, acceleration, threads)
    lost = np.empty(len(starts), dtype=int)
    for first in range(0, len(starts), BLOCK):
        block = slice(first, first + BLOCK)
        plan = controller.begin(starts[block], velocity[block], stride, acceleration, threads)
        lost[block] = planned_losses(plan, steps[block], threads)
    return lost


def planned_losses(plan: Plan, steps: np.ndarray, threads: int | None = None) -> np.ndarray:
    """The same of a plan at time 0; one number of steps stands for all starts."""
    steps = np.broadcast_to(steps, len(plan.starts))
    lost = np.zeros(len(steps), dtype=int)
    while plan.done < (end := steps[lost == 0].max(initial=0)):
        first = plan.done + 1
        unstable = unstable_steps(plan.advance(int(min(CHUNK, end - plan.done))), threads)
        unstable &= (first + np.arange(len(unstable)))[:, np.newaxis] <= steps
        new = (lost == 0) & unstable.any(axis=0)
        lost[new] = first + np.argmax(unstable, axis=0)[new]
    return lost


def unstable_steps(walk: PlannedWalk, threads: int | None = None) -> np.ndarray:
    """Which steps end statically unstable, (step, start)."""
    return walk_margin(walk, threads) <= 0.0
