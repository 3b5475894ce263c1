"""The league: every entrant in kinematic walks, in physics, and in every trial, with a cell for each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.controllers.wrappers import LegLost, PoorSenses
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.measures.study import GROUND, Study
from hexmj.measures.tables import FRESH, PERIODS
from hexmj.studies.disturbed_walks import Case
from hexmj.studies.league_cells import Entrant, EntrantWalks
from hexmj.studies.standings import LEGS_LOST, TRIALS, standings
from hexmj.sweep import Cell
from hexmj.timing import Acceleration, observation_duration
from hexmj.validate import distinct, whole

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
class League(Study):
    """The same starts for every entrant: all of them in kinematic walks, the first of them in physics and in trials."""

    controllers: Mapping[str, Entrant]
    """Entrants by their names in the result."""
    velocities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    physical_starts: int = 200
    """Number of the starts that walk in physics at every velocity; at most all."""
    trial_starts: int = 50
    """Number of the starts in each trial; at most all."""
    trial_velocity: float = 0.3
    """Velocity V_r of the trials."""
    accelerating: bool = True
    """Whether kinematic walks accelerate to V_r = 0.9 too, which takes half of the time of all kinematic walks."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two protractions) or a number [time units]."""
    periods: int = PERIODS
    """Cycles of every leg until its steady-state gait is measured."""
    n_starts: int = field(default=1000, kw_only=True)
    """Number of random starts of kinematic walks, the same for all."""
    seed: int = field(default=FRESH, kw_only=True)
    """Seed of the random starts."""

    hidden: ClassVar[tuple[str, ...]] = ("load", *GROUND)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("physical_starts", self.physical_starts, 1)
        whole("trial_starts", self.trial_starts, 1)
        whole("periods", self.periods, CYCLES + 2)
        distinct("controllers", [*self.controllers])
        if not (0 < self.trial_velocity < 1 and (self.observed[0] > 0).all()):
            v = [*self.velocities, self.trial_velocity]
            raise InputError(f"velocities = {v}; expected each above 0 and below 1")

    def plans(self) -> Mapping[str, Controller]:
        return {name: entrant.controller for name, entrant in self.controllers.items()}

    def named_cells(self) -> dict[tuple[str, str], Cell]:
        """Return every cell by its entrant and its question."""
        return {(name, what): cell for name, entrant in self.controllers.items() for what, cell in self._asked(entrant)}

    def cells(self) -> list[Cell]:
        """Return every cell."""
        from hexmj.controllers.planning import check_velocities
        from hexmj.physics.settle import check_adhesion

        for entrant in self.controllers.values():
            random = () if entrant.ideal else (self.trial_velocity, RANGE[1], *([FINAL] if self.accelerating else []))
            check_velocities(entrant.controller, (*self.observed[0].tolist(), *random), self.stride)
        tried = any(not entrant.ideal for entrant in self.controllers.values())
        for load in (self.conditions.load, *([LOAD] if tried else [])):
            check_adhesion(replace(self.conditions, load=load), self.stride, self.seed)
        return [*self.named_cells().values()]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return what tables, figures and ranks are made of, see `standings.standings`."""
        own = {name: getattr(self, name) for name in ("velocities", "trial_velocity", "accelerating", "periods")}
        own |= {name: min(getattr(self, name), self.n_starts) for name in ("physical_starts", "trial_starts")}
        found = dict(zip(self.named_cells(), data, strict=True))
        return self.labelled(standings(self.controllers, self.observed[0], found), "league", **own)

    def _asked(self, entrant: Entrant) -> Iterator[tuple[str, Cell]]:
        """Yield the cells of an entrant by question; gaits and trials need random starts."""
        every, few = self.n_starts, min(self.physical_starts, self.n_starts)

        def cell(name: str, function: str, velocity: float, n_starts: int, cost: float, **own: Any) -> Cell:
            walks = EntrantWalks(entrant, velocity, self.observation_time, n_starts, self.seed, self.stride)
            return Cell(f"{entrant.controller.name}-{name}", getattr(walks, function), own, float(cost * n_starts))

        own = {"controller": entrant.controller, "conditions": self.conditions}
        for v, time in zip(*(axis.tolist() for axis in self.observed), strict=True):
            yield f"kinematic {v}", cell(f"kinematic-V-{v:g}", "losses", v, every, time * KINEMATIC)
            yield f"physics {v}", cell(f"physics-V-{v:g}", "outcomes", v, few, time, **own)
            if not entrant.ideal:
                cost, gaits = 20 * time * KINEMATIC, min(every, REGIMES)
                yield f"gait {v}", cell(f"gait-V-{v:g}", "gaits", v, gaits, cost, periods=self.periods)
        if entrant.ideal:
            return
        low, high = RANGE
        yield "range", cell("range", "losses_over_range", low, every, 600 * KINEMATIC, low=low, high=high)
        if self.accelerating:
            cost, own = 10_000 * KINEMATIC, {"acceleration": Acceleration()}
            yield "accelerated", cell("accelerated", "losses", FINAL, every, cost, **own)
        v, few = self.trial_velocity, min(self.trial_starts, self.n_starts)
        for trial, leg in LEGS_LOST.items():
            walks = cell(f"kinematic-{trial}", "losses", v, every, 200 * KINEMATIC, leg_lost=leg)
            yield f"kinematic, {trial}", walks
        for trial, function, cost, own in self._tried(entrant):
            yield trial, cell(trial, function, v, few, cost, **own)

    def _tried(self, entrant: Entrant) -> Iterator[tuple[str, str, float, dict[str, Any]]]:
        """Yield every trial that the entrant can take: its method of `EntrantWalks`, cost and settings."""
        from hexmj.physics.pushes import can_push

        time = float(observation_duration(self.observation_time, self.trial_velocity, self.stride))
        pushes = can_push(self.conditions, self.stride, time)
        reaches = self.trial_velocity * time >= crossed(self.conditions)
        for trial in TRIALS:
            if case := DISTURBED.get(trial):
                if entrant.steerable and (pushes or trial != "push"):
                    yield trial, "disturbed", 300, {"case": case, "conditions": self.conditions}
            elif (reaches or trial not in GROUNDS) and (walking := self.walking(trial, entrant)):
                yield trial, "outcomes", 180, walking

    def walking(self, trial: str, entrant: Entrant) -> dict[str, Any] | None:
        """Return the controller and the conditions of a trial that is no disturbance.

        None if the entrant has no sensory feedback, or its steps are longer than the delay.
        """
        controller, conditions, body = entrant.controller, self.conditions, self.conditions.body
        if trial in GROUNDS:
            near, high = body.lengths.nearest_obstacle, HEIGHT * body.standing_height
            conditions = replace(conditions, ground=trial, ground_height=high, ground_at=near)
        elif trial == "load":
            conditions = replace(conditions, load=LOAD)
        elif trial in LEGS_LOST:
            held = HELD * max(conditions.standing_height, body.standing_height)
            controller = LegLost(controller, LEGS_LOST[trial], held)
        else:
            late, reading = DELAY * conditions.vp, entrant.reading(self.trial_velocity, self.stride)
            if reading is None or (trial == "late" and not round(late / self.stride.dt)):
                return None
            senses = {"noise": PoorSenses(reading, noise=NOISE), "late": PoorSenses(reading, delay=late)}
            controller = senses.get(trial, reading)
        return {"controller": controller, "conditions": conditions}


def crossed(conditions: Conditions) -> float:
    """Return the way after which all legs have reached the obstacle of a trial [mm]."""
    return conditions.body.lengths.nearest_obstacle * 5.0 / 3.0
