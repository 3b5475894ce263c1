"""Walks that are disturbed (paper, Section 6): the disturbances, the starts that meet them, and their times.

An obstacle is "the termination of motion. Then the motion is initiated from new leg positions".
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import REPEATED, advanced, begin, check_repeats, planned_losses
from hexmj.controllers.protocol import Controller, SteerableController, check_steerable
from hexmj.errors import InputError
from hexmj.measures.kinematic import first_loss
from hexmj.measures.tables import over_start
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_plans import Disturbance, Disturbed, Kind, Postures, collect_postures
from hexmj.timing import Acceleration, Stride, steps_within

if TYPE_CHECKING:
    import xarray as xr


Answer = Literal["reorganise", "slow_down", "grasp"]
"""Strategies: legs go to the nearest posture of undisturbed walking; the velocity is lowered; feet hold the ground."""

Strategy = Literal["none"] | Answer

NO_DISTURBANCE = "undisturbed"
"""Name of the case in which nothing happens."""


@dataclass(frozen=True)
class Case:
    """A disturbance and the strategy against it."""

    kind: Kind
    strategy: Strategy
    impulse: float = 0.0
    """Impulse of a push to the left, in multiples of the insect's mass times V_p; 0 is no disturbance."""

    @property
    def disturbance(self) -> str:
        """Name of the disturbance: undisturbed, halt, leg, push 20."""
        if self.kind != "push":
            return self.kind
        return f"push {float(self.impulse)}".removesuffix(".0") if self.impulse else NO_DISTURBANCE


SETTLED = 3
"""Periods of a single leg for which a start walks; the disturbance comes in the next period."""

MOST_DRAWN = 200_000
"""Most starts that are drawn to find walks that are stable until they are disturbed."""

GRID = 20
"""Steps of which every time of a disturbance is a multiple: 25 ms at the default V_p, the duration of a push."""

MOST_PERIODS = 3
"""Most periods of a single leg in which a protracting leg is searched for."""


class TooFewStable(InputError):
    """Too few starts keep static stability until they are disturbed."""


@dataclass(frozen=True, eq=False)
class StableStarts:
    """Starts whose plan is stable until they are disturbed."""

    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    step: np.ndarray
    """(start,) steps before the disturbance."""
    draw: np.ndarray
    """(start,) in [0, 1[, selects one of the protracting legs."""
    drawn: int
    """Number of starts drawn to find them."""


def find_stable_starts(
    controller: Controller, velocity: float, n_starts: int, seed: int, stride: Stride, grid: int
) -> StableStarts:
    """Return the seed's first starts whose plan is stable until the disturbance.

    Times of the disturbance are multiples of `grid` steps, and uniform within one period of a single leg, after
    `SETTLED` of them.

    Raises:
        TooFewStable: fewer than `n_starts` of `MOST_DRAWN` starts are stable for so long.
    """
    period, drawn = stride.periods(velocity) / stride.dt, 0
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
        f"n_starts = {n_starts}; at V = {velocity:g} fewer of {MOST_DRAWN} starts are stable until they are disturbed"
    )


def disturbance_of(
    stable: StableStarts, kind: Kind, controller: Controller, velocity: float, stride: Stride
) -> Disturbance:
    """Return the disturbance of these starts; a leg is stopped as soon as one protracts.

    Raises:
        InputError: a start has no protracting leg.
    """
    leg = np.zeros_like(stable.step)
    if kind != "leg":
        return Disturbance(kind, stable.step, leg)
    plan, first = begin(controller, stable.starts, velocity, stride), int(stable.step.min())
    advanced(plan, first - 1)
    end = int(stable.step.max() + stride.periods(velocity, MOST_PERIODS) / stride.dt)
    up = ~advanced(plan, end - plan.done).stance  # (step, start, leg)
    up &= (first + np.arange(len(up)))[:, None, None] >= stable.step[:, None]
    row = np.argmax(up.any(axis=2), axis=0)
    legs = up[row, np.arange(len(leg))]
    if not legs.any(axis=1).all():
        raise InputError(f"disturbance = 'leg': no leg of {controller.name} protracts within {MOST_PERIODS} periods")
    nth = np.floor(stable.draw * legs.sum(axis=1)).astype(int)
    chosen = np.argmax(legs & (np.cumsum(legs, axis=1) == nth[:, None] + 1), axis=1)
    return Disturbance(kind, first + row, chosen)


TIMES = {
    "time": "time of the disturbance",
    "back": "time from which the walk is at its velocity again",
    "planned_loss": "first loss of static stability of the plan, or inf",
    "fall": "first contact of the trunk with the ground, or inf",
}
"""Times of every start -> long name; all in time units."""


@dataclass(frozen=True)
class StableWalks:
    """Walks at one velocity whose plan is stable until they are disturbed."""

    controller: Controller
    """A `SteerableController`, or `SensoryFeedback` around one."""
    velocity: float
    """V_r, 0 < V < 1."""
    n_starts: int
    """Number of starts that are stable until their disturbance."""
    seed: int
    """Seed of starts, times, legs and postures."""
    stride: Stride
    """Step range, lines of the tips and time step."""

    def __post_init__(self) -> None:
        check_steerable(self.planner)

    @property
    def planner(self) -> SteerableController:
        """The controller of the kinematic walk, which has no feedback."""
        inner = self.controller.controller if isinstance(self.controller, SensoryFeedback) else self.controller
        return inner  # pyright: ignore[reportReturnType]

    @cached_property
    def found(self) -> StableStarts:
        """The starts; found once for all cases."""
        found = find_stable_starts(self.planner, self.velocity, self.n_starts, self.seed, self.stride, GRID)
        check_repeats(self.planner, found.starts, self.velocity, REPEATED, self.stride)
        return found

    @cached_property
    def postures(self) -> Postures:
        """Postures of the strategy 'reorganise'; collected once for all cases."""
        return collect_postures(self.planner, self.velocity, self.seed, self.stride)

    def times(
        self,
        case: Case,
        observation_time: float,
        recovery: Acceleration | None,
        conditions: Conditions | None,
        threads: int | None = None,
        which: np.ndarray | None = None,
    ) -> "xr.Dataset":
        """Return the `TIMES` of every start in one case, and the number of starts `drawn` to find them.

        Args:
            case: the disturbance and the strategy.
            observation_time: time for which all walk after they are at V again [time units].
            recovery: of the strategy 'slow_down'.
            conditions: of the physical walk; without them the walk is kinematic.
            threads: by default one per core.
            which: indices of some starts, (n,), which walk as long as if all did; by default all.

        Raises:
            TooFewStable: too few starts are stable until they are disturbed.
            InputError, SimulationError: a walk fails.
        """
        from hexmj.measures.physical import outcomes_of_plan
        from hexmj.physics.pushes import Push
        from hexmj.physics.settle import settle

        which = np.arange(self.n_starts) if which is None else which
        disturbance = disturbance_of(self.found, case.kind, self.planner, self.velocity, self.stride)
        postures = self.postures if case.strategy == "reorganise" else None
        disturbed = Disturbed(self.planner, disturbance, postures, slows=recovery is not None)
        ahead: Any = begin(disturbed, self.found.starts, self.velocity, self.stride, recovery, threads)
        advanced(ahead, int(disturbance.step.max()) + 1)
        back = ahead.resumed * self.stride.dt + (recovery.duration(self.velocity) if recovery else 0.0)
        end = float(back.max() + observation_time)
        disturbance = replace(disturbance, step=disturbance.step[which], leg=disturbance.leg[which])
        starts, disturbed = self.found.starts[which], replace(disturbed, disturbance=disturbance)
        time = disturbance.step * self.stride.dt
        plan = begin(disturbed, starts, self.velocity, self.stride, recovery, threads)
        first = planned_losses(plan, steps_within(end, self.stride), threads)
        lost = np.where(first > 0, first * self.stride.dt, np.inf)
        times = {"time": time, "back": back[which], "planned_loss": lost}
        if conditions:
            push = Push(np.full(len(time), case.impulse * conditions.body.mass * conditions.vp), time)
            settled = settle(starts, conditions, self.stride, threads)
            walks = SensoryFeedback(disturbed) if isinstance(self.controller, SensoryFeedback) else disturbed
            plan = begin(walks, starts, self.velocity, self.stride, recovery, threads=1)
            times["fall"] = outcomes_of_plan(settled, plan, end, lost, push=push, threads=threads).fall
        table = over_start(times, dict.fromkeys(TIMES, "time unit"))
        for name, values in table.items():
            values.attrs["long_name"] = TIMES[str(name)]
        return table.assign(drawn=self.found.drawn)
