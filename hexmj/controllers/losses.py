"""First losses of static stability (Eq. 7) of any controller: its own fast way, or its plan looked at."""

import numpy as np

from hexmj.controllers.asking import advanced, begin
from hexmj.controllers.protocol import Controller, FastLosses, Plan
from hexmj.errors import InputError
from hexmj.stability import walk_margin
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk

CHUNK, BLOCK = 200, 2000
"""Steps and starts of a plan held in memory at a time."""


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
        lost = np.asarray(controller.first_losses(starts, velocity, steps, stride, acceleration, threads))
        if lost.shape != steps.shape or not ((lost >= 0) & (lost <= steps)).all():
            raise InputError(
                f"first_losses of {controller.name}: {lost!r:.80}; expected a step from 0 on for each start"
            )
        return lost
    lost = np.empty(len(starts), dtype=int)
    for first in range(0, len(starts), BLOCK):
        block = slice(first, first + BLOCK)
        plan = begin(controller, starts[block], velocity[block], stride, acceleration, threads)
        lost[block] = planned_losses(plan, steps[block], threads)
    return lost


def planned_losses(plan: Plan, steps: np.ndarray, threads: int | None = None) -> np.ndarray:
    """The same of a plan at time 0; one number of steps stands for all starts."""
    steps = np.broadcast_to(steps, len(plan.starts))
    lost = np.zeros(len(steps), dtype=int)
    while plan.done < (end := steps[lost == 0].max(initial=0)):
        first = plan.done + 1
        unstable = unstable_steps(advanced(plan, int(min(CHUNK, end - plan.done))), threads)
        unstable &= (first + np.arange(len(unstable)))[:, np.newaxis] <= steps
        new = (lost == 0) & unstable.any(axis=0)
        lost[new] = first + np.argmax(unstable, axis=0)[new]
    return lost


def unstable_steps(walk: PlannedWalk, threads: int | None = None) -> np.ndarray:
    """Which steps end statically unstable, (step, start)."""
    return walk_margin(walk, threads) <= 0.0
