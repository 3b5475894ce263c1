"""The league: every entrant on paper, in physics, and in every trial; a cell for each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.checks import check_types, typed, whole
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.measures.captions import not_printed
from hexmj.measures.velocities import observed
from hexmj.starts import check_draw
from hexmj.storage.attributes import attributes
from hexmj.studies.league import paper
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.league.trials import CROSSED, DISTURBED, GROUNDS, LEGS_LOST, TRIALS, walking
from hexmj.sweeps import Cell
from hexmj.sweeps.plain import plain
from hexmj.timing import Acceleration, Stride, observation_time

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


def check_part(study: Any, *names: str) -> None:
    """Refuse more starts in physics than there are on paper, of which they are a part.

    Args:
        study: has `n_starts`.
        names: of its other numbers of starts.

    Raises:
        InputError: one is above it.
    """
    for name in names:
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
    window: str | float = "walk"
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
        for count in (self.n_starts, self.n_physical, self.n_tried):
            check_draw(count, self.seed)
        check_part(self, "n_physical", "n_tried")
        whole("periods", self.periods, CYCLES + 2)
        if not self.entrants:
            raise InputError("no controller was given; expected at least one")
        for name, entrant in self.entrants.items():
            typed(f"entrants[{name!r}]", entrant, Entrant)
        if not (0 < self.tried_at < 1 and (self.observed[0] > 0).all()):
            raise InputError(
                f"velocities = {self.velocities}, of the trials = {self.tried_at}; expected each above 0 and below 1"
            )

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.window, self.stride)

    def named_cells(self) -> dict[tuple[str, str], Cell]:
        """Every cell by its entrant and what it is asked."""
        asked = {
            name: self._on_paper(entrant) | self._in_physics(entrant) | ({} if entrant.ideal else self._random(entrant))
            for name, entrant in self.entrants.items()
        }
        return {(name, what): cell for name, cells in asked.items() for what, cell in cells.items()}

    def cells(self) -> list[Cell]:
        """See `sweeps.Study`."""
        return [*self.named_cells().values()]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """All that the table, the figures and the ranks are made of; see `standings.standings`."""
        from hexmj.studies.league.standings import standings

        told = (
            "velocities",
            "n_starts",
            "n_physical",
            "n_tried",
            "tried_at",
            "window",
            "periods",
            "seed",
            "accelerating",
        )
        settings: dict[str, Any] = {"study": "league"} | {name: plain(getattr(self, name)) for name in told}
        settings |= {"conditions": self.conditions.settings(), "stride": asdict(self.stride)}
        settings["controllers"] = {name: plain(entrant) for name, entrant in self.entrants.items()}
        settings["not_printed"] = not_printed(settings)
        return standings(self, dict(zip(self.named_cells(), data, strict=True))).assign_attrs(attributes(settings))

    def _on_paper(self, entrant: Entrant) -> dict[str, Cell]:
        """Losses at every velocity."""
        return {
            f"paper {v}": self._cell(
                f"paper-V-{v:g}", paper.losses, time * PAPER, entrant, {"velocity": v, "window": self.window}
            )
            for v, time in self._velocities
        }

    def _in_physics(self, entrant: Entrant) -> dict[str, Cell]:
        """Walks at every velocity."""
        from hexmj.studies.league import physics

        how = {"controller": entrant.controller, "window": self.window, "conditions": self.conditions}
        how["n_starts"] = self.n_physical
        return {
            f"physics {v}": self._cell(f"physics-V-{v:g}", physics.walks, time, entrant, how | {"velocity": v})
            for v, time in self._velocities
        }

    def _random(self, entrant: Entrant) -> dict[str, Cell]:
        """What random starts alone are asked."""
        window = {"window": self.window}
        few = {"n_starts": min(self.n_starts, REGIMES), "periods": self.periods}
        found = {
            f"regime {v}": self._cell(
                f"regime-V-{v:g}", paper.regimes, 20 * time * PAPER, entrant, few | {"velocity": v}
            )
            for v, time in self._velocities
        }
        over = window | dict(zip(("low", "high"), RANGE, strict=True))
        found["range"] = self._cell("range", paper.losses_over_range, 600 * PAPER, entrant, over)
        if self.accelerating:
            eq11 = window | {"velocity": FINAL, "acceleration": Acceleration()}
            found["accelerated"] = self._cell("accelerated", paper.losses, 10_000 * PAPER, entrant, eq11)
        return found | self._lamed(entrant) | self._tried(entrant)

    def _lamed(self, entrant: Entrant) -> dict[str, Cell]:
        """Losses on paper without one leg."""
        at = {"velocity": self.tried_at, "window": self.window}
        return {
            f"paper, {trial}": self._cell(f"paper-{trial}", paper.losses, 200 * PAPER, entrant, at | {"leg_lost": leg})
            for trial, leg in LEGS_LOST.items()
        }

    def _tried(self, entrant: Entrant) -> dict[str, Cell]:
        """Every trial that the entrant can take."""
        from hexmj.studies.disturbance.disturbances import GRID
        from hexmj.studies.league import physics

        found: dict[str, Cell] = {}
        at = {"velocity": self.tried_at, "window": self.window, "n_starts": self.n_tried}
        way = self.tried_at * float(observation_time(self.window, self.tried_at, self.stride))
        for trial in TRIALS:
            if trial in DISTURBED and entrant.steerable:
                how = at | {"case": DISTURBED[trial], "conditions": self.conditions, "grid": GRID}
                found[trial] = self._cell(trial, physics.disturbed, 300, entrant, how)
            elif trial in DISTURBED or (trial in GROUNDS and way < CROSSED):
                continue
            elif one := walking(trial, entrant, self.conditions, self.stride):
                how = at | {"controller": one.controller, "conditions": one.conditions}
                found[trial] = self._cell(trial, physics.walks, 180, entrant, how)
        return found

    def _cell(
        self, name: str, function: Callable[..., Any], time: float, entrant: Entrant, own: Mapping[str, Any]
    ) -> Cell:
        """A cell whose cost goes by the time walked, of all starts unless its own settings say how many."""
        told = {"entrant": entrant, "n_starts": self.n_starts, "seed": self.seed, "stride": self.stride, **own}
        return Cell(f"{entrant.controller.name}-{name}", function, told, float(time * told["n_starts"]))

    @property
    def _velocities(self) -> list[tuple[float, float]]:
        """Every velocity with its observation time [time units]."""
        return [(float(v), float(time)) for v, time in zip(*self.observed, strict=True)]
