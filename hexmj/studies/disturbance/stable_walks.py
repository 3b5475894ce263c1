"""Walks at one velocity that are disturbed: the same starts at the same times in every case."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import REPEATED, advanced, begin, check_repeats
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.losses import planned_losses
from hexmj.controllers.protocol import Controller, SteerableController
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics.drive import Push
from hexmj.physics.settling import settle
from hexmj.studies.disturbance.cases import Case
from hexmj.studies.disturbance.disturbances import StableStarts, disturbance_of, find_stable_starts
from hexmj.studies.disturbance.plan import Disturbed, DisturbedPlan, check_steerable
from hexmj.studies.disturbance.strategies import Postures, collect_postures
from hexmj.timing import Acceleration, Stride, steps_within

if TYPE_CHECKING:
    import xarray as xr

TIMES = {
    "time": "time of the disturbance",
    "back": "time from which the walk is at its velocity again",
    "planned_loss": "first loss of static stability of the plan, or inf",
    "fall": "first contact of the trunk with the ground, or inf",
}
"""What is kept of every start, all in time units."""


@dataclass(frozen=True)
class StableWalks:
    """Walks at one velocity whose plan is stable until they are disturbed."""

    controller: Controller
    """Plans the walks: a `SteerableController`, or `SensoryFeedback` around one, in physics."""
    velocity: float
    """V_r, 0 < V < 1."""
    n_starts: int
    """Number of starts that reach their disturbance."""
    seed: int
    """Of starts, times, legs and postures."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    grid: int
    """Steps of which every time of a disturbance is a multiple."""

    def __post_init__(self) -> None:
        check_steerable(self.planner)

    @property
    def planner(self) -> SteerableController:
        """What plans on paper, where no legs are read."""
        inner = self.controller.controller if isinstance(self.controller, SensoryFeedback) else self.controller
        return inner  # pyright: ignore[reportReturnType]

    @cached_property
    def found(self) -> StableStarts:
        """The starts; found once for all cases.

        Raises:
            TooFewStable: not so many starts are stable until they are disturbed.
            InputError: the controller plans another walk when it begins again.
        """
        found = find_stable_starts(self.planner, self.velocity, self.n_starts, self.seed, self.stride, self.grid)
        check_repeats(self.planner, found.starts, self.velocity, REPEATED, self.stride)
        return found

    @cached_property
    def postures(self) -> Postures:
        """Of the strategy 'reorganise'; collected once for all cases."""
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
        """The `TIMES` of every start in one case, and the number of starts `drawn` to find these.

        Args:
            case: what they meet, and their strategy.
            observation_time: how long they walk once all are at V again [time units].
            recovery: of the strategy 'slow_down'.
            conditions: of the physical walk; without them there is none, and no fall.
            threads: one per core unless given; the times do not depend on it.
            which: indices of some starts, (n,), which walk as long as if all did; all unless given.

        Raises:
            TooFewStable, InputError: see `found`.
            InputError, SimulationError: see `drive.drive`.
        """
        import xarray as xr

        which = np.arange(self.n_starts) if which is None else which
        disturbance = disturbance_of(self.found, case.kind, self.planner, self.velocity, self.stride)
        postures = self.postures if case.strategy == "reorganise" else None
        disturbed = Disturbed(self.planner, disturbance, postures, slows=recovery is not None)
        check_repeats(disturbed, self.found.starts, self.velocity, REPEATED, self.stride, recovery)
        ahead = self._plan(disturbed, self.found.starts, recovery, threads)
        advanced(ahead, int(disturbance.step.max()) + 1)
        back = ahead.resumed * self.stride.dt + (recovery.duration(self.velocity) if recovery else 0.0)
        end = float(back.max() + observation_time)
        starts, disturbed = self.found.starts[which], replace(disturbed, disturbance=disturbance.of(which))
        time = disturbed.disturbance.step * self.stride.dt
        first = planned_losses(
            self._plan(disturbed, starts, recovery, threads), steps_within(end, self.stride), threads
        )
        lost = np.where(first > 0, first * self.stride.dt, np.inf)
        times = {"time": time, "back": back[which], "planned_loss": lost}
        if conditions:
            push = Push(np.full(len(time), case.impulse * conditions.body.mass * conditions.vp), time)
            settled = settle(starts, conditions, self.stride, threads)
            walks = SensoryFeedback(disturbed) if isinstance(self.controller, SensoryFeedback) else disturbed
            plan = begin(walks, starts, self.velocity, self.stride, recovery, threads=1)
            times["fall"] = outcomes_of_plan(settled, plan, end, lost, push=push, threads=threads).fall
        columns = {
            name: ("start", values, {"units": "time unit", "long_name": TIMES[name]}) for name, values in times.items()
        }
        return xr.Dataset(columns).assign(drawn=self.found.drawn)

    def _plan(
        self, disturbed: Disturbed, starts: np.ndarray, recovery: Acceleration | None, threads: int | None
    ) -> DisturbedPlan:
        plan = begin(disturbed, starts, self.velocity, self.stride, recovery, threads)
        return plan  # pyright: ignore[reportReturnType]
