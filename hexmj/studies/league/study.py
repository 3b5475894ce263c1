"""The league: every entrant on paper, in physics, and in every trial; a cell for each."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.checks import check_types, typed, whole
from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import check_velocities
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.io import attributes
from hexmj.measures.captions import not_printed
from hexmj.measures.velocities import observed
from hexmj.physics.pushes import can_push
from hexmj.plain import plain
from hexmj.starts import check_draw
from hexmj.studies.disturbance.disturbances import GRID
from hexmj.studies.league import on_paper
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.league.standings import standings
from hexmj.studies.league.trials import DISTURBED, GROUNDS, LEGS_LOST, LOAD, TRIALS, crossed, walking
from hexmj.sweep import Cell
from hexmj.timing import Acceleration, Stride, observation_duration

if TYPE_CHECKING:
    import xarray as xr

RANGE = (0.1, 0.5)
"""Velocities of J_N (Eq. 10)."""

FINAL = 0.9
"""Velocity to which walks accelerate (Eq. 11)."""

PAPER = 0.05
"""What a time unit costs on paper, where one in physics costs 1."""

FRESH = 17
"""A seed on which no set of ours was searched."""

PERIODS = 40
"""Cycles until a limit regime is looked at."""

REGIMES = 50
"""Starts whose limit regime is looked at, at most."""


def check_counts(study: Any, *names: str) -> None:
    """Refuse numbers of starts that make no sense, and more in physics, by the names of their fields, than on paper."""
    for name in ("n_starts", *names):
        check_draw(getattr(study, name), study.seed, name)
        if getattr(study, name) > study.n_starts:
            raise InputError(f"{name} = {getattr(study, name)}; expected at most n_starts = {study.n_starts}")


@dataclass(frozen=True)
class League:
    """The same starts for every entrant: all of them on paper, the first of them in physics and in trials."""

    entrants: Mapping[str, Entrant]
    """By the names under which they stand in the result."""
    velocities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """V_r, each 0 < V < 1."""
    n_starts: int = 1000
    """Number of starts on paper."""
    n_physical: int = 200
    """Of these, number of starts that walk in physics at every velocity."""
    n_tried: int = 50
    """Of these, number of starts in each trial."""
    tried_at: float = 0.3
    """V_r of the trials."""
    accelerating: bool = True
    """Whether walks on paper accelerate to V_r = 0.9, too, which takes as long as everything else on paper."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    periods: int = PERIODS
    """Cycles that every leg has time for until its limit regime is looked at."""
    seed: int = FRESH
    """Of the starts."""
    conditions: Conditions = field(default_factory=Conditions)
    """Of physical walks."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""

    def __post_init__(self) -> None:
        check_types(self)
        check_counts(self, "n_physical", "n_tried")
        whole("periods", self.periods, CYCLES + 2)
        if not self.entrants:
            raise InputError("no controller was given; expected at least one")
        for name, entrant in self.entrants.items():
            typed(f"entrants[{name!r}]", entrant, Entrant)
        given, usual = self.conditions.values(), Conditions().values()
        for name in ("load", "ground", "ground_height", "ground_at", "ground_length"):
            if given[name] != usual[name]:
                raise InputError(f"{name} = {given[name]!r}; expected {usual[name]!r}, since trials have their own")
        if not (0 < self.tried_at < 1 and (self.observed[0] > 0).all()):
            raise InputError(
                f"velocities = {self.velocities}, of the trials = {self.tried_at}; expected each above 0 and below 1"
            )

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride)

    def named_cells(self) -> dict[tuple[str, str], Cell]:
        """Every cell by its entrant and what it is asked."""
        return {(name, what): cell for name, entrant in self.entrants.items() for what, cell in self._asked(entrant)}

    def cells(self) -> list[Cell]:
        """See `sweep.Study`."""
        from hexmj.physics.settling import check_adhesion

        for entrant in self.entrants.values():
            random = () if entrant.ideal else (self.tried_at, RANGE[1], *([FINAL] if self.accelerating else []))
            check_velocities(entrant.controller, (*self.observed[0].tolist(), *random), self.stride)
        tried = any(not entrant.ideal for entrant in self.entrants.values())
        for load in (self.conditions.load, *([LOAD] if tried else [])):
            check_adhesion(replace(self.conditions, load=load), self.stride, self.seed)
        return [*self.named_cells().values()]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """All that the table, the figures and the ranks are made of; see `standings.standings`."""
        told = ("velocities", "n_starts", "n_physical", "n_tried", "tried_at", "observation_time", "periods", "seed")
        told += ("accelerating",)
        settings: dict[str, Any] = {"study": "league"} | {name: plain(getattr(self, name)) for name in told}
        settings |= {"conditions": self.conditions.settings(), "stride": asdict(self.stride)}
        settings["controllers"] = {name: plain(entrant) for name, entrant in self.entrants.items()}
        settings["not_printed"] = not_printed(settings)
        found = dict(zip(self.named_cells(), data, strict=True))
        return standings(self.entrants, self.observed[0], found).assign_attrs(attributes(settings))

    def _asked(self, entrant: Entrant) -> Iterator[tuple[str, Cell]]:
        """Every cell of an entrant by what it is asked: random starts alone for regimes and in trials, too."""
        from hexmj.studies.league import in_physics

        def cell(name: str, function: Callable[..., Any], time: float, own: Mapping[str, Any]) -> Cell:
            """Its cost goes by the time walked, of all starts unless its own settings say how many."""
            told = {"entrant": entrant, "n_starts": self.n_starts, "seed": self.seed, "stride": self.stride, **own}
            return Cell(f"{entrant.controller.name}-{name}", function, told, float(time * told["n_starts"]))

        observation_time = {"observation_time": self.observation_time}
        walked = observation_time | {
            "controller": entrant.controller,
            "conditions": self.conditions,
            "n_starts": self.n_physical,
        }
        at = [(float(v), float(time)) for v, time in zip(*self.observed, strict=True)]
        for v, time in at:
            yield (
                f"paper {v}",
                cell(f"paper-V-{v:g}", on_paper.losses, time * PAPER, observation_time | {"velocity": v}),
            )
        for v, time in at:
            yield f"physics {v}", cell(f"physics-V-{v:g}", in_physics.walks, time, walked | {"velocity": v})
        if entrant.ideal:
            return
        for v, time in at:
            own = {"velocity": v, "n_starts": min(self.n_starts, REGIMES), "periods": self.periods}
            yield f"regime {v}", cell(f"regime-V-{v:g}", on_paper.regimes, 20 * time * PAPER, own)
        own = observation_time | dict(zip(("low", "high"), RANGE, strict=True))
        yield "range", cell("range", on_paper.losses_over_range, 600 * PAPER, own)
        if self.accelerating:
            own = observation_time | {"velocity": FINAL, "acceleration": Acceleration()}
            yield "accelerated", cell("accelerated", on_paper.losses, 10_000 * PAPER, own)
        tried = observation_time | {"velocity": self.tried_at}
        for trial, leg in LEGS_LOST.items():
            yield f"paper, {trial}", cell(f"paper-{trial}", on_paper.losses, 200 * PAPER, tried | {"leg_lost": leg})
        for trial, function, cost, own in self._tried(entrant):
            yield trial, cell(trial, function, cost, tried | own | {"n_starts": self.n_tried})

    def _tried(self, entrant: Entrant) -> Iterator[tuple[str, Callable[..., Any], float, dict[str, Any]]]:
        """Every trial that the entrant can take: what tries it, what that costs, and its own settings."""
        from hexmj.studies.league import in_physics

        observation_time = float(observation_duration(self.observation_time, self.tried_at, self.stride))
        for trial in TRIALS:
            case = DISTURBED.get(trial)
            if case and case.kind == "push" and not can_push(self.conditions, self.stride, observation_time):
                continue
            if case and entrant.steerable:
                how = {"case": case, "conditions": self.conditions, "grid": GRID}
                yield trial, in_physics.disturbed, 300, how
            elif case or (trial in GROUNDS and self.tried_at * observation_time < crossed(self.conditions)):
                continue
            elif one := walking(trial, entrant, self.conditions, self.tried_at, self.stride):
                yield trial, in_physics.walks, 180, {"controller": one.controller, "conditions": one.conditions}
