"""The league: all entrants (controllers) in kinematic walks, physical walks and trials, with a cell for each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from hexmj.conditions import Conditions
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin, check_velocities
from hexmj.controllers.protocol import Controller, FeedbackPlan, SteerableController
from hexmj.controllers.wrappers import Begins, LegLost, PoorSenses, by_protocol
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.measures.study import GROUND, Study
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import Case
from hexmj.studies.league_cells import EntrantWalks
from hexmj.studies.standings import LEGS_LOST, READING, TRIALS, standings
from hexmj.sweep import Cell
from hexmj.timing import observation_duration
from hexmj.validate import whole

if TYPE_CHECKING:
    import xarray as xr

KINEMATIC_COST = 0.015
"""Computing time of a time unit of a kinematic walk, as a fraction of that of a physical walk."""

OVERHEAD = 4
"""Number of starts whose physical steps take about as long as the overhead of a step."""

MOST_GAIT_STARTS = 50
"""Maximum number of starts whose steady-state gait is measured."""

DELAY, NOISE = 0.02, 0.1
"""Delay of the sensed legs [s], and standard deviation of the sensed tips' errors as a fraction of AEP_0 - PEP_0."""

DISTURBED = {"halt": Case("halt", "none"), "leg": Case("leg", "none"), "push": Case("push", "none", impulse=40.0)}
"""Trial with a disturbance -> its case; the plans of these walks are stable until the disturbance."""

GROUNDS = ("step", "rough")
"""Trials on uneven ground, which begins as near as the body allows, so that all legs of slow walks reach it too."""

HEIGHT, LOAD = 0.3, 1.0
"""Height of step and bumps, in standing heights of the body; added weight in the trial 'load', in body weights."""

HELD = 1.2
"""Height at which a lost leg is held, in multiples of the standing height of the body or of the walk (the higher)."""


@dataclass(frozen=True)
class League(Study):
    """All starts of every entrant in kinematic walks, and the first of these starts in physical walks and in trials."""

    controllers: Mapping[str, Controller]
    """Controllers by their names in the result."""
    velocities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    physical_starts: int = 200
    """Number of starts in physical walks at every velocity, the first ones of all starts."""
    trial_starts: int = 50
    """Number of starts in each trial, the first ones of all starts."""
    trial_velocity: float = 0.3
    """Velocity V_r of the trials."""
    periods: int = 40
    """Number of cycles that every leg walks until its steady-state gait is measured."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""

    protocol: Begins = "random"
    """Where kinematic and physical walks begin: at 'random' starts, or in the 'steady' state that the plan reaches from
    them in ten periods of a leg. The starts of gaits and trials do not change."""

    n_starts: int = field(default=1000, kw_only=True)
    """Number of random starts in kinematic walks, the same for every controller and velocity."""
    seed: int = field(default=17, kw_only=True)
    """Seed of the random starts; by default one on which no preset was optimised."""

    hidden: ClassVar[tuple[str, ...]] = ("load", *GROUND)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("physical_starts", self.physical_starts, 1)
        whole("trial_starts", self.trial_starts, 1)
        whole("periods", self.periods, CYCLES + 2)
        if not (self.observed[0] > 0).all():
            raise InputError(f"velocities = {self.velocities}; expected 0 < V < 1")
        if not 0 < self.trial_velocity < 1:
            raise InputError(f"trial_velocity = {self.trial_velocity}; expected 0 < V < 1")

    def named_cells(self) -> dict[tuple[str, str], Cell]:
        """Return every cell by its entrant and its question, for example ('ldvs', 'kinematic 0.3')."""
        return {(name, question): cell for name in self.controllers for question, cell in self._questions(name)}

    def cells(self) -> list[Cell]:
        """Return the cells of all entrants; raise InputError if an entrant refuses a velocity."""
        from hexmj.physics.settle import check_adhesion

        for controller in self.controllers.values():
            check_velocities(controller, (*self.observed[0].tolist(), self.trial_velocity), self.stride)
        for load in (self.conditions.load, LOAD):
            check_adhesion(replace(self.conditions, load=load), self.stride, self.seed)
        return [*self.named_cells().values()]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset from which tables, figures and ranks are made, see `standings.standings`."""
        own = {name: getattr(self, name) for name in ("velocities", "trial_velocity", "periods")}
        own |= {name: min(getattr(self, name), self.n_starts) for name in ("physical_starts", "trial_starts")}
        found = dict(zip(self.named_cells(), data, strict=True))
        return self.labelled(standings(self.controllers, self.observed[0], found), "league", **own)

    def _questions(self, name: str) -> Iterator[tuple[str, Cell]]:
        """Yield questions and cells of an entrant."""
        from hexmj.physics.pushes import can_push

        controller, every = self.controllers[name], self.n_starts
        tried = self._time(self.trial_velocity)
        seeded = every, self.seed, Conditions(), self.stride
        walks = EntrantWalks(controller, self.trial_velocity, tried, *seeded)
        physics = {"conditions": self.conditions, "n_starts": min(self.physical_starts, every)}
        trials = {"conditions": self.conditions, "n_starts": min(self.trial_starts, every)}

        def cell(question: str, cost: float, method: str, changed: Mapping[str, Any], **own: Any) -> tuple[str, Cell]:
            own_walks = replace(walks, **changed)
            work = float(cost * (own_walks.n_starts + OVERHEAD))  # estimated computing time, relative to other cells
            return question, Cell(f"{name} {question}", getattr(own_walks, method), own, work)

        for v, time in zip(*(axis.tolist() for axis in self.observed), strict=True):
            at: dict[str, Any] = {"velocity": v, "duration": time}
            begun = at | {"controller": by_protocol(controller, self.protocol)}
            yield cell(f"kinematic {v}", time * KINEMATIC_COST, "losses", begun)
            yield cell(f"physics {v}", time, "outcomes", begun | physics)
            few = at | {"n_starts": min(every, MOST_GAIT_STARTS)}
            yield cell(f"gait {v}", 25 * time * KINEMATIC_COST, "gaits", few, periods=self.periods)
        for trial, leg in LEGS_LOST.items():
            yield cell(f"kinematic, {trial}", 200 * KINEMATIC_COST, "losses", {"controller": LegLost(controller, leg)})
        pushes = can_push(self.conditions, self.stride, tried)
        reaches = self.trial_velocity * tried >= distance_to_cross(self.conditions)
        for trial in TRIALS:
            if case := DISTURBED.get(trial):
                if isinstance(controller, SteerableController) and (pushes or trial != "push"):
                    yield cell(trial, 300, "disturbed", trials, case=case)
            elif (reaches or trial not in GROUNDS) and (changed := self.trial_settings(trial, controller)):
                cost = 720 if trial in READING else 180
                yield cell(trial, cost, "outcomes", trials | changed)

    def _time(self, velocity: float) -> float:
        """Return the observation time at a velocity V_r [time units]."""
        return float(observation_duration(self.observation_time, velocity, self.stride))

    def trial_settings(self, trial: str, controller: Controller) -> dict[str, Any] | None:
        """Return the controller and the conditions of a trial without a disturbance.

        Return None if the entrant cannot use the sensory feedback of the trial, or the delay rounds to no time step.
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


def distance_to_cross(conditions: Conditions) -> float:
    """Return the distance after which all legs have reached a trial's obstacle [mm]: 5/3 of the distance to it."""
    return conditions.body.lengths.nearest_obstacle * 5.0 / 3.0
