"""Disturbances of walks in the paper's sense (Section 6): who is disturbed, when, and what becomes of the legs.

An obstacle is "the termination of motion. Then the motion is initiated from new leg positions".
"""

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from hexmj.controllers.checked_plans import advanced, begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.measures.kinematic import first_loss
from hexmj.starts import draw_starts
from hexmj.studies.disturbance.cases import Kind
from hexmj.timing import Stride

NEVER = 2**62
"""Step of what has not come about."""

SETTLED = 3
"""Periods of a single leg for which a start walks before it may be disturbed; the disturbance comes in the next one."""

MOST_DRAWN = 200_000
"""Starts among which walks are looked for that are stable until they are disturbed."""

GRID = 20
"""Steps of which every time of a disturbance is a multiple: 25 ms at the usual V_p, as long as a push lasts."""

CHUNK = 50
"""Steps planned at a time while a leg that protracts is looked for."""

MOST_PERIODS = 100
"""Periods of a single leg for which one that protracts is looked for."""


class TooFewStable(InputError):
    """Not so many starts keep static stability until they are disturbed."""


@dataclass(frozen=True, eq=False)
class Disturbance:
    """One disturbance of every start."""

    kind: Kind
    step: np.ndarray
    """(start,) steps of the plan before it."""
    leg: np.ndarray
    """(start,) index of the leg that kind 'leg' stops, or, where that stands, of the first after it that does not."""

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise InputError(f"disturbance = {self.kind!r}; valid names: {', '.join(get_args(Kind))}")
        if self.step.dtype.kind != "i" or not (self.step >= 0).all():
            raise InputError(f"step = {self.step}; expected whole numbers of steps, each at least 0")
        if self.leg.shape != self.step.shape or not ((self.leg >= 0) & (self.leg < 6)).all():
            raise InputError(f"leg = {self.leg}; expected indices from 0 to 5, as many as steps, {len(self.step)}")

    def of(self, which: np.ndarray) -> "Disturbance":
        """That of some starts, (n,) indices."""
        return replace(self, step=self.step[which], leg=self.leg[which])

    def awaited(self, standing: np.ndarray) -> np.ndarray:
        """Which starts, (start,), cannot be disturbed now, with these states, (start, leg): no leg protracts."""
        return (self.kind == "leg") & np.all(standing, axis=1)

    def legs(self, tips: np.ndarray, standing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tips [mm] and states, both (start, leg), with which every start goes on if it is disturbed now."""
        if self.kind == "halt":
            return tips, np.ones_like(standing)
        if self.kind == "leg":
            inorder = (self.leg[:, None] + np.arange(6)) % 6
            first = np.argmin(np.take_along_axis(standing, inorder, axis=1), axis=1)
            return tips, standing | (np.arange(6) == (self.leg + first)[:, None] % 6)
        return tips, standing


@dataclass(frozen=True, eq=False)
class StableStarts:
    """Starts that walk without a loss of static stability until they are disturbed."""

    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    step: np.ndarray
    """(start,) steps before the disturbance."""
    draw: np.ndarray
    """(start,) in [0, 1[, which of the protracting legs is stopped."""
    drawn: int
    """Starts among which they were found."""


def find_stable_starts(
    controller: Controller, velocity: float, n_starts: int, seed: int, stride: Stride, grid: int
) -> StableStarts:
    """The first starts whose plan has not lost stability when a disturbance comes; the rest are passed over.

    Args, beside those of `WalkSettings`:
        n_starts: number of starts to find.
        seed: of starts, times and legs.
        grid: steps of which every time is a multiple.  Times are uniform within one period of a single leg, after
            `SETTLED` of them.

    Raises:
        TooFewStable: fewer than `n_starts` of `MOST_DRAWN` starts are stable for so long.
    """
    period = stride.periods(velocity) / stride.dt
    drawn = 0
    while drawn < MOST_DRAWN >= n_starts:
        drawn = min(max(2 * drawn, n_starts), MOST_DRAWN)
        starts = draw_starts(drawn, seed, stride)
        when, draw = np.random.default_rng([seed, 2]).uniform(size=(drawn, 2)).T
        step = grid * np.ceil((SETTLED + when) * period / grid).astype(int)
        found = np.flatnonzero(np.isinf(first_loss(starts, controller, velocity, step * stride.dt, stride=stride)))
        if len(found) >= n_starts:
            found = found[:n_starts]
            return StableStarts(starts[found], step[found], draw[found], int(found[-1]) + 1)
    raise TooFewStable(
        f"starts = {n_starts}; at V = {velocity:g} not so many of {MOST_DRAWN} keep static stability until they are"
        " disturbed; expected fewer starts or a lower velocity"
    )


def disturbance_of(
    stable: StableStarts, kind: Kind, controller: Controller, velocity: float, stride: Stride
) -> Disturbance:
    """What these starts meet; a leg is stopped at the first moment at which one protracts.

    Raises:
        InputError: of some start no leg protracts.
    """
    leg = np.zeros_like(stable.step)
    if kind != "leg":
        return Disturbance(kind, stable.step, leg)
    plan, step = begin(controller, stable.starts, velocity, stride), np.full_like(leg, NEVER)
    advanced(plan, int(stable.step.min()) - 1)
    end = stable.step.max() + MOST_PERIODS * stride.periods(velocity) / stride.dt
    while (step == NEVER).any():
        if plan.done > end:
            raise InputError(
                f"disturbance = 'leg' of {controller.name}: of {(step == NEVER).sum()} of {len(step)} starts no leg"
                f" protracts within {MOST_PERIODS} periods of a single leg; expected a controller whose legs do"
            )
        first = plan.done + 1
        up = ~advanced(plan, CHUNK).stance
        due = (first + np.arange(CHUNK))[:, None] >= stable.step
        row = np.argmax(up.any(axis=2) & due, axis=0)
        legs = up[row, np.arange(len(step))]
        found = (step == NEVER) & legs.any(axis=1) & due[row, np.arange(len(step))]
        nth = np.floor(stable.draw * legs.sum(axis=1)).astype(int)
        chosen = np.argmax(legs & (np.cumsum(legs, axis=1) == nth[:, None] + 1), axis=1)
        step, leg = np.where(found, first + row, step), np.where(found, chosen, leg)
    return Disturbance(kind, step, leg)
