"""Disturbed walks (paper, Section 6): disturbances, the starts that are disturbed, and the times of losses and falls.

The paper describes an obstacle as "the termination of motion. Then the motion is initiated from new leg positions".
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import advanced, begin, planned_losses
from hexmj.controllers.protocol import Controller, SteerableController, check_steerable
from hexmj.errors import InputError
from hexmj.measures.kinematic import first_loss
from hexmj.measures.tables import over_start
from hexmj.progress import Progress
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_plans import Disturbance, Disturbed, Kind, Postures, collect_postures
from hexmj.timing import Acceleration, Stride, steps_within

if TYPE_CHECKING:
    import xarray as xr


Answer = Literal["reorganise", "slow_down", "grasp"]
"""Strategies: legs go to the nearest posture of undisturbed walking; the velocity is lowered; feet adhere."""

Strategy = Literal["none"] | Answer

NO_DISTURBANCE = "undisturbed"
"""Name of the case without a disturbance."""


@dataclass(frozen=True)
class Case:
    """A disturbance, and the strategy with which the insect responds."""

    kind: Kind
    strategy: Strategy
    impulse: float = 0.0
    """Impulse of a push to the left, in multiples of the insect's mass times V_p; with 0 a push is no disturbance."""

    @property
    def disturbance(self) -> str:
        """Name of the disturbance: 'undisturbed', 'halt', 'leg', or 'push' and the impulse, for example 'push 20'."""
        if self.kind != "push":
            return self.kind
        return f"push {float(self.impulse)}".removesuffix(".0") if self.impulse else NO_DISTURBANCE


SETTLED = 3
"""Number of periods of a single leg before the period in which the disturbance occurs."""

MOST_DRAWN = 200_000
"""Maximum number of starts drawn to find starts whose plan is stable until the disturbance."""

GRID = 20
"""Disturbances occur at multiples of this number of steps: 25 ms at the default V_p, as long as a push."""

MOST_PERIODS = 3
"""Maximum number of periods of a single leg for which a disturbance of kind 'leg' waits for a protracting leg."""


class TooFewStable(InputError):
    """Raised if too few random starts keep static stability until the disturbance."""


@dataclass(frozen=True, eq=False)
class StableStarts:
    """Random starts whose plan keeps static stability until the disturbance."""

    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    step: np.ndarray
    """(start,) number of steps before the disturbance."""
    draw: np.ndarray
    """(start,) random number in [0, 1) that chooses which of the protracting legs is stopped."""
    drawn: int
    """Number of random starts drawn until enough stable starts were found."""


def find_stable_starts(
    controller: Controller, velocity: float, n_starts: int, seed: int, stride: Stride, grid: int
) -> StableStarts:
    """Return the first `n_starts` random starts of a seed whose plan is stable until the disturbance.

    The disturbance occurs at a random multiple of `grid` steps, uniform within the period of a single leg that follows
    the first `SETTLED` periods.

    Raises:
        TooFewStable: fewer than `n_starts` of `MOST_DRAWN` starts are stable until the disturbance.
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
        f"fewer than n_starts = {n_starts} of {MOST_DRAWN} starts are stable until the disturbance at V = {velocity:g}"
    )


def disturbance_of(
    stable: StableStarts, kind: Kind, controller: Controller, velocity: float, stride: Stride
) -> Disturbance:
    """Return the disturbance of these starts; kind 'leg' is delayed until a leg protracts.

    Raises:
        InputError: no leg of a start protracts within `MOST_PERIODS` periods.
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
"""Variable with a time of every start [time units] -> its long name."""


@dataclass(frozen=True)
class StableWalks:
    """Disturbed walks at one velocity, whose plans keep static stability until the disturbance."""

    controller: Controller
    """Controller that plans the walks: a `SteerableController`, or `SensoryFeedback` around one."""
    velocity: float
    """V_r as a fraction of V_p, 0 < V < 1."""
    n_starts: int
    """Number of starts, all of them stable until the disturbance."""
    seed: int
    """Seed of the starts, of the times of disturbances, of the stopped legs and of the postures."""
    stride: Stride
    """Step range, lines of the tips and time step."""

    def __post_init__(self) -> None:
        check_steerable(self.planner)

    @property
    def planner(self) -> SteerableController:
        """The controller without sensory feedback, which plans the kinematic walks."""
        inner = self.controller.controller if isinstance(self.controller, SensoryFeedback) else self.controller
        return inner  # pyright: ignore[reportReturnType]

    @cached_property
    def found(self) -> StableStarts:
        """The stable starts, found once for all cases."""
        return find_stable_starts(self.planner, self.velocity, self.n_starts, self.seed, self.stride, GRID)

    @cached_property
    def postures(self) -> Postures:
        """The postures of the strategy 'reorganise', collected once for all cases."""
        return collect_postures(self.planner, self.velocity, self.seed, self.stride)

    def times(
        self,
        case: Case,
        observation_time: float,
        recovery: Acceleration | None,
        conditions: Conditions | None,
        threads: int | None = None,
        which: np.ndarray | None = None,
        progress: Progress | None = None,
    ) -> "xr.Dataset":
        """Return the `TIMES` of every start in one case, and the number `drawn` of random starts.

        Args:
            case: the disturbance and the strategy.
            observation_time: duration of all walks after the last start is back at V [time units].
            recovery: acceleration of the strategy 'slow_down', None for other strategies.
            conditions: conditions of physical walks; None computes kinematic walks.
            threads: number of threads, by default one per core.
            which: indices of the starts that walk, (n,), by default all; the walks last as long as those of all starts.
            progress: called with the fraction done since the last call.

        Raises:
            TooFewStable: too few starts are stable until the disturbance.
            InputError, SimulationError: a controller is unsuitable, or a walk fails.
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
            how: Any = {"push": push, "threads": threads, "progress": progress}
            times["fall"] = outcomes_of_plan(settled, plan, end, lost, **how).fall
        table = over_start(times, dict.fromkeys(TIMES, "time unit"))
        for name, values in table.items():
            values.attrs["long_name"] = TIMES[str(name)]
        return table.assign(drawn=self.found.drawn)
