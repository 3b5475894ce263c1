"""Entrants of a league or an ablation, and their cells: kinematic losses, steady-state gaits, falls and trials."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin, check_repeats
from hexmj.controllers.protocol import Controller, FeedbackPlan, SteerableController
from hexmj.controllers.registry import VARIED, known_names, load_controller
from hexmj.controllers.wrappers import LegLost
from hexmj.errors import InputError, OutOfReach, SimulationError, StillThrown
from hexmj.gaits import steady_state_gait
from hexmj.legs import LEGS
from hexmj.measures.kinematic import first_loss
from hexmj.measures.study import UNITS
from hexmj.measures.tables import happened, over_start
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_mean
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import Case, StableWalks, TooFewStable
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

IDEAL = "-ideal"
"""End of the name of an entrant that begins at an ideal start."""

NETWORK = ("uncoordinated", "hws", "ldvs", "own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
"""Weight sets of the 1998 network that take part."""

EVERYONE = (*NETWORK, *BASELINES, *(f"{name}{IDEAL}" for name in ("wilson", "graham")))
"""The whole league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham-ideal")
"""Entrants of a quick look."""


@dataclass(frozen=True)
class Entrant:
    """A controller, and how it begins."""

    controller: Controller
    ideal: bool = False
    """Whether it begins at its `ideal_start(velocity, stride)`, (1, leg) tips [mm], the same for all walks."""

    def __post_init__(self) -> None:
        if self.ideal and not hasattr(self.controller, "ideal_start"):
            raise InputError(f"controller = {self.controller.name} has no ideal_start")

    def starts(self, n_starts: int, seed: int, velocity: float, stride: Stride) -> np.ndarray:
        """Return random starts, (start, leg) [mm], or the ideal one alone."""
        if not self.ideal:
            return draw_starts(n_starts, seed, stride)
        controller: Any = self.controller
        start = np.array(controller.ideal_start(velocity, stride), dtype=float)
        if start.shape != (1, len(LEGS)):
            raise InputError(f"ideal_start of {self.controller.name} has the shape {start.shape}; expected (1, 6)")
        return start

    def reading(self, velocity: float, stride: Stride) -> Controller | None:
        """Return the controller with sensory feedback, if it has it or its plans can be steered."""
        if isinstance(begin(self.controller, draw_starts(1, 0, stride), velocity, stride), FeedbackPlan):
            return self.controller
        return SensoryFeedback(self.controller) if self.steerable else None

    @property
    def steerable(self) -> bool:
        """Whether the controller can be halted, and a leg of it stopped."""
        return isinstance(self.controller, SteerableController)


def entrants(names: Sequence[str], load: Callable[[str], Controller] = load_controller) -> Mapping[str, Entrant]:
    """Return entrants by `short_names`, from names of controllers, with the end `IDEAL` for an ideal start.

    Raises:
        InputError: there is no such controller, or it has no ideal start.
    """
    plain = {name: name.removesuffix(IDEAL) for name in names}
    found = {name: load(name) for name in plain.values()}
    short = short_names(found)
    return {short[own] + IDEAL * (own != name): Entrant(found[own], ideal=own != name) for name, own in plain.items()}


def short_names(found: Mapping[str, Controller]) -> dict[str, str]:
    """Return distinct names for tables: known names as they are, others as the loaded controllers call themselves."""
    known, short = {*known_names()}, {}
    for name, controller in found.items():
        varied = VARIED.fullmatch(name)
        short[name] = name if (varied["name"] if varied else name) in known else controller.name
    often = Counter(short.values())
    return {name: name if often[shown] > 1 else shown for name, shown in short.items()}


REFUSALS = OutOfReach, SimulationError, StillThrown
"""Errors of a walk that has no outcome."""

EFFORT = {"work": "mm", "torque": "1", "way": "mm"}
"""Columns beside the outcomes, and their units."""

DISTURBED = {"time": "time unit", "fall": "time unit"}
"""Columns of disturbed walks, and their units."""


@dataclass(frozen=True)
class EntrantWalks:
    """Walks of an entrant; each method is the function of a cell, and returns columns over start."""

    entrant: Entrant
    velocity: float
    """V_r, or its final value."""
    observation_time: str | float
    """'walk', 'start' or a number [time units]; when accelerating, counted from V_r on."""
    n_starts: int
    seed: int
    stride: Stride

    @property
    def starts(self) -> np.ndarray:
        """Tips at time 0, (start, leg) [mm]."""
        return self.entrant.starts(self.n_starts, self.seed, self.velocity, self.stride)

    @property
    def duration(self) -> float:
        """Observation time [time units]."""
        return float(observation_duration(self.observation_time, self.velocity, self.stride))

    def losses(
        self, acceleration: Acceleration | None = None, leg_lost: int | None = None, threads: int | None = None
    ) -> "xr.Dataset":
        """Return whether each start loses static stability in its planned walk, `lost`, perhaps without a leg."""
        controller = self.entrant.controller if leg_lost is None else LegLost(self.entrant.controller, leg_lost)
        duration = self.duration + (acceleration.duration(self.velocity) if acceleration else 0.0)
        how = {"stride": self.stride, "acceleration": acceleration, "threads": threads}
        return _lost(first_loss(self.starts, controller, self.velocity, duration, **how))

    def losses_over_range(self, low: float, high: float, threads: int | None = None) -> "xr.Dataset":
        """Return `lost` with a velocity for each start, uniform from `low` to `high` (Eq. 10)."""
        velocity = np.random.default_rng([self.seed, 1]).uniform(low, high, self.n_starts)
        duration = observation_duration(self.observation_time, velocity, self.stride)
        starts = draw_starts(self.n_starts, self.seed, self.stride)
        how = {"stride": self.stride, "threads": threads}
        return _lost(first_loss(starts, self.entrant.controller, velocity, duration, **how))

    def gaits(self, periods: int, threads: int | None = None) -> "xr.Dataset":
        """Return the steady-state gait of each start after so many `periods`, see `gaits.steady_state_gait`.

        Returns:
            `reached`, the time from which on the gait lasts [time units], or inf; whether it is `stable`; and, NaN
            without a gait, the `duty_factor` and the phases `ipsilateral` and `contralateral`, as circular means.
        """
        how = {"seed": self.seed, "stride": self.stride, "periods": periods, "threads": threads}
        gait = steady_state_gait(self.entrant.controller, self.velocity, n_starts=self.n_starts, **how)
        columns = {
            "reached": gait.reached,
            "stable": gait.stable.astype(np.int8),
            "duty_factor": gait.duty_factor.mean(axis=1),
            "ipsilateral": circular_mean(gait.phase[:, IPSILATERAL], axis=1),
            "contralateral": circular_mean(gait.phase[:, CONTRALATERAL], axis=1),
        }
        return over_start(columns, {"reached": "time unit"})

    def outcomes(self, controller: Controller, conditions: Conditions, threads: int | None = None) -> "xr.Dataset":
        """Return the outcome of every physical walk with the entrant's controller, or a changed one.

        Returns:
            All `Outcomes`; the `work` of the joints over the insect's weight [mm] and the greatest `torque` over its
            limit, see `EffortSoFar`; the `way` walked ahead [mm]. NaN for walks that fail, see `unless_refused`.

        Raises:
            SimulationError: none of the random starts comes to rest.
        """
        from hexmj.physics.outcomes import EffortSoFar, Outcomes, OutcomesSoFar
        from hexmj.physics.rollout import drive
        from hexmj.physics.settle import settle

        starts, velocity, stride, duration = self.starts, self.velocity, self.stride, self.duration
        steps = int(steps_within(duration, stride))
        columns = {field.name: UNITS.get(field.name, "1") for field in fields(Outcomes)} | EFFORT

        def walked(which: np.ndarray) -> "xr.Dataset":
            some = starts[which]
            check_repeats(controller, some, velocity, steps, stride)
            settled = settle(some, conditions, stride, threads)
            lost = first_loss(some, controller, velocity, duration, stride=stride, threads=threads)
            so_far, effort = OutcomesSoFar(settled, lost), EffortSoFar(settled)
            for chunk in drive(settled, begin(controller, some, velocity, stride), duration, threads=threads):
                so_far.add(chunk)
                effort.add(chunk)
            outcomes = so_far.outcomes()
            costs = {"work": effort.work / settled.compiled.weight, "torque": effort.torque}
            commanded = np.minimum(outcomes.fall, steps * stride.dt) * velocity
            return over_start(vars(outcomes) | costs | {"way": commanded * outcomes.speed}, columns)

        found = unless_refused(walked, len(starts), columns)
        if found.fall.isnull().all():
            _check_settles(draw_starts(self.n_starts, self.seed, stride), conditions, stride, threads)
        return found

    def disturbed(self, case: Case, conditions: Conditions, threads: int | None = None) -> "xr.Dataset":
        """Return whether disturbed starts `fell`: 1 or 0.

        NaN if too few starts are stable until the disturbance, the insect fell before it, or the walk fails.
        """
        stable = StableWalks(self.entrant.controller, self.velocity, self.n_starts, self.seed, self.stride)
        how = case, self.duration, None, conditions, threads
        try:
            times = unless_refused(lambda which: stable.times(*how, which)[[*DISTURBED]], self.n_starts, DISTURBED)
        except TooFewStable:
            return over_start({"fell": np.full(self.n_starts, np.nan)})
        return over_start({"fell": happened(times.fall).where(~(times.fall <= times.time)).values})


def _lost(time: np.ndarray) -> "xr.Dataset":
    return over_start({"lost": np.isfinite(time).astype(np.int8)})


def unless_refused(
    walked: Callable[[np.ndarray], "xr.Dataset"], n_starts: int, columns: Mapping[str, str]
) -> "xr.Dataset":
    """Return the outcomes of all starts, with NaN for walks that fail.

    A walk fails if it diverges, its tips are out of reach, or a push still acts at the end of the observation time.

    Args:
        walked: walks some of the starts, (n,); the outcome of a start must not depend on the others.
        n_starts: number of all starts.
        columns: names of the outcomes, and their units.
    """
    import xarray as xr

    everyone, alone = np.arange(n_starts), list[xr.Dataset]()
    with suppress(*REFUSALS):
        return walked(everyone)
    for start in everyone[:, np.newaxis]:
        try:
            alone.append(walked(start))
        except REFUSALS:
            alone.append(over_start({name: np.array([np.nan]) for name in columns}, columns))
    return xr.concat(alone, "start")


def _check_settles(starts: np.ndarray, conditions: Conditions, stride: Stride, threads: int | None) -> None:
    """Raise the first error if no start comes to rest."""
    from hexmj.physics.settle import settle

    failed = []
    for start in starts:
        try:
            settle(start[np.newaxis], conditions, stride, threads)
            return
        except SimulationError as error:
            failed.append(error)
    raise failed[0]
