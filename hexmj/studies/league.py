"""The league: every entrant in kinematic walks, in physics, and in every trial, with a cell for each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from hexmj.conditions import Conditions
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin, check_velocities
from hexmj.controllers.protocol import Controller, FeedbackPlan, SteerableController
from hexmj.controllers.wrappers import LegLost, PoorSenses
from hexmj.errors import InputError
from hexmj.measures.study import GROUND
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import Case
from hexmj.studies.league_cells import ControllerStudy, EntrantWalks, is_ideal
from hexmj.studies.standings import LEGS_LOST, TRIALS, standings
from hexmj.sweep import Cell
from hexmj.timing import Acceleration, observation_duration
from hexmj.validate import whole

if TYPE_CHECKING:
    import xarray as xr

RANGE = (0.1, 0.5)
"""Velocities of J_N (Eq. 10)."""

FINAL = 0.9
"""Velocity to which walks accelerate (Eq. 11)."""

KINEMATIC = 0.05
"""Cost of a time unit of a kinematic walk, relative to a physical one."""

REGIMES = 50
"""Most starts whose steady-state gait is measured."""

DELAY, NOISE = 0.02, 0.1
"""Delay of the sensed legs [s], and standard deviation of the error of sensed tips, as a part of AEP_0 - PEP_0."""

DISTURBED = {"halt": Case("halt", "none"), "leg": Case("leg", "none"), "push": Case("push", "none", impulse=40.0)}
"""Disturbances of walks whose plan is stable until then, each at a time of its own."""

GROUNDS = ("step", "rough")
"""Obstacles, as near as the body allows: even slow walks reach them with all legs."""

HEIGHT, LOAD = 0.3, 1.0
"""Height of the obstacles, in standing heights of the body, and load of the trial, in weights of the body."""

HELD = 1.2
"""Height at which a lost leg is held, in standing heights of the body or of the walk, whichever is higher."""


@dataclass(frozen=True)
class League(ControllerStudy):
    """The same starts for every entrant: all of them in kinematic walks, the first of them in physics and in trials.

    An entrant whose name ends with '-ideal' begins at its ideal start, see `league_cells.is_ideal`.
    """

    velocities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    physical_starts: int = 200
    trial_starts: int = 50
    """Number of the starts in each trial; at most all."""
    trial_velocity: float = 0.3
    """Velocity V_r of the trials."""
    accelerating: bool = True
    """Whether kinematic walks accelerate to V_r = 0.9 too, which takes half of the time of all kinematic walks."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two protractions) or a number [time units]."""

    hidden: ClassVar[tuple[str, ...]] = ("load", *GROUND)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("trial_starts", self.trial_starts, 1)
        if not 0 < self.trial_velocity < 1:
            raise InputError(f"trial_velocity = {self.trial_velocity}; expected above 0 and below 1")

    def named_cells(self) -> dict[tuple[str, str], Cell]:
        """Return every cell by its entrant and its question."""
        return {(name, asked): cell for name in self.controllers for asked, cell in self._asked(name)}

    def cells(self) -> list[Cell]:
        """Return every cell."""
        from hexmj.physics.settle import check_adhesion

        random = [name for name, controller in self.controllers.items() if not is_ideal(name, controller)]
        for name, controller in self.controllers.items():
            more = (self.trial_velocity, RANGE[1], *([FINAL] if self.accelerating else [])) if name in random else ()
            check_velocities(controller, (*self.observed[0].tolist(), *more), self.stride)
        for load in (self.conditions.load, *([LOAD] if random else [])):
            check_adhesion(replace(self.conditions, load=load), self.stride, self.seed)
        return [*self.named_cells().values()]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return what tables, figures and ranks are made of, see `standings.standings`."""
        own = {name: getattr(self, name) for name in ("velocities", "trial_velocity", "accelerating", "periods")}
        own |= {name: min(getattr(self, name), self.n_starts) for name in ("physical_starts", "trial_starts")}
        found = dict(zip(self.named_cells(), data, strict=True))
        return self.labelled(standings(self.controllers, self.observed[0], found), "league", **own)

    def _asked(self, name: str) -> Iterator[tuple[str, Cell]]:
        """Yield the cells of an entrant by question; gaits and trials need random starts."""
        from hexmj.physics.pushes import can_push

        controller, every = self.controllers[name], self.n_starts
        ideal, tried = is_ideal(name, controller), self._time(self.trial_velocity)
        seeded = every, self.seed, Conditions(), self.stride
        walks = EntrantWalks(controller, self.trial_velocity, tried, *seeded, ideal=ideal)
        physics = {"conditions": self.conditions, "n_starts": min(self.physical_starts, every)}
        trials = {"conditions": self.conditions, "n_starts": min(self.trial_starts, every)}

        def cell(question: str, cost: float, method: str, changed: Mapping[str, Any], **own: Any) -> tuple[str, Cell]:
            own_walks = replace(walks, **changed)
            work = float(cost * own_walks.n_starts)
            return question, Cell(f"{name} {question}", getattr(own_walks, method), own, work)

        for v, time in zip(*(axis.tolist() for axis in self.observed), strict=True):
            at = {"velocity": v, "duration": time}
            yield cell(f"kinematic {v}", time * KINEMATIC, "losses", at)
            yield cell(f"physics {v}", time, "outcomes", at | physics)
            if not ideal:
                few = at | {"n_starts": min(every, REGIMES)}
                yield cell(f"gait {v}", 20 * time * KINEMATIC, "gaits", few, periods=self.periods)
        if ideal:
            return
        low, high = RANGE
        own = {"low": low, "high": high, "observation_time": self.observation_time}
        yield cell("range", 600 * KINEMATIC, "losses_over_range", {"velocity": low}, **own)
        if self.accelerating:
            eq11 = Acceleration()
            time = self._time(FINAL) + eq11.duration(FINAL)
            speeding = {"velocity": FINAL, "duration": time, "acceleration": eq11}
            yield cell("accelerated", 10_000 * KINEMATIC, "losses", speeding)
        for trial, leg in LEGS_LOST.items():
            yield cell(f"kinematic, {trial}", 200 * KINEMATIC, "losses", {"controller": LegLost(controller, leg)})
        pushes = can_push(self.conditions, self.stride, tried)
        reaches = self.trial_velocity * tried >= crossed(self.conditions)
        for trial in TRIALS:
            if case := DISTURBED.get(trial):
                if isinstance(controller, SteerableController) and (pushes or trial != "push"):
                    yield cell(trial, 300, "disturbed", trials, case=case)
            elif (reaches or trial not in GROUNDS) and (changed := self.walking(trial, controller)):
                yield cell(trial, 180, "outcomes", trials | changed)

    def _time(self, velocity: float) -> float:
        """Return the observation time at a velocity [time units]."""
        return float(observation_duration(self.observation_time, velocity, self.stride))

    def walking(self, trial: str, controller: Controller) -> dict[str, Any] | None:
        """Return the controller and the conditions of a trial that is no disturbance.

        None if the entrant has no sensory feedback, or its steps are longer than the delay.
        """
        conditions, body = self.conditions, self.conditions.body
        if trial in GROUNDS:
            near, high = body.lengths.nearest_obstacle, HEIGHT * body.standing_height
            conditions = replace(conditions, ground=trial, ground_height=high, ground_at=near)
        elif trial == "load":
            conditions = replace(conditions, load=LOAD)
        elif trial in LEGS_LOST:
            held = HELD * max(conditions.standing_height, body.standing_height)
            controller = LegLost(controller, LEGS_LOST[trial], held)
        else:
            late, start = DELAY * conditions.vp, draw_starts(1, 0, self.stride)
            reads = isinstance(begin(controller, start, self.trial_velocity, self.stride), FeedbackPlan)
            if not (reads or isinstance(controller, SteerableController)) or (
                trial == "late" and not round(late / self.stride.dt)
            ):
                return None
            controller = controller if reads else SensoryFeedback(controller)
            senses = {"noise": {"noise": NOISE}, "late": {"delay": late}}
            controller = PoorSenses(controller, **senses[trial]) if trial in senses else controller
        return {"controller": controller, "conditions": conditions}


def crossed(conditions: Conditions) -> float:
    """Return the way after which all legs have reached the obstacle of a trial [mm]."""
    return conditions.body.lengths.nearest_obstacle * 5.0 / 3.0
