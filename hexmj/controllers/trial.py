"""Walks that a controller is asked for when it is held to the laws of its protocol."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from hexmj.controllers.checked_plans import advanced, begin, begin_at_speed, difference
from hexmj.controllers.protocol import Controller, Plan, SteerableController
from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PLANNED, PlannedWalk, copied, joined

N_STARTS, STEPS = 16, 600
"""Starts of a trial and steps of its walk: 60 time units, a swing and a stance at V = 0.5."""

DIVIDED = (1, 7, 250, 342)
"""The same steps in parts."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Some walks that a controller is asked for."""

    controller: Controller
    """Plans them."""
    starts: np.ndarray
    """Tips at time 0, (start, leg) [mm]."""
    velocity: np.ndarray
    """V_r, or its final value, (start,)."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None
    """Eq. 11, if the walks accelerate."""
    at_speed: bool = False
    """Whether they begin at their final velocity, and accelerate only where they are slowed down or restart."""

    def begin(self, threads: int | None = 1) -> Plan:
        """A new plan."""
        asked = self.starts, self.velocity, self.stride, self.acceleration, threads
        if self.at_speed:
            return begin_at_speed(cast(SteerableController, self.controller), *asked)
        return begin(self.controller, *asked)

    @cached_property
    def walk(self) -> PlannedWalk:
        """All steps at once."""
        return advanced(self.begin(), STEPS)

    @cached_property
    def in_parts(self) -> PlannedWalk:
        """The same, `DIVIDED`."""
        plan = self.begin()
        return joined([advanced(plan, steps) for steps in DIVIDED])

    def of(self, which: Any) -> "Trial":
        """The same of some starts."""
        return replace(self, starts=self.starts[which], velocity=self.velocity[which])


def every_other(trial: Trial) -> np.ndarray:
    """Every other start, (start,)."""
    return np.arange(len(trial.starts)) % 2 == 0


def mixed(walk: PlannedWalk, which: np.ndarray, other: PlannedWalk) -> PlannedWalk:
    """A walk in which some starts, (start,), walk as in another of these alone."""
    walk = copied(walk)
    for name in (*PLANNED, "velocity"):
        getattr(walk, name)[:, which] = getattr(other, name)
    return walk


def same(one: PlannedWalk, other: PlannedWalk, what: str, before: int = 0) -> None:
    """Refuse two walks of the same starts that differ; a sentence says `what` they are, and counts steps `before` both.

    Raises:
        InputError: they differ.
    """
    if differ := difference(one, other, before):
        raise InputError(f"{what} differ: {differ}; expected the same bits")
