"""`hexmj league`."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import OmitArgPrefixes, arg

from hexmj.cli.loaded import loaded
from hexmj.cli.options import AS_THEY_ARE, CONTROLLER, STEADY, Accelerating, Controlled, Walks, hiding
from hexmj.cli.recorded import recorded
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import tables_that_fit
from hexmj.conditions import Conditions
from hexmj.errors import InputError, RenderingError, SimulationError
from hexmj.files import write_text
from hexmj.measures.tables import FRESH
from hexmj.replay.film.film import Film
from hexmj.studies import league as study
from hexmj.studies.entrants import EVERYONE, FOUR, IDEAL, entrants
from hexmj.studies.league_figure import league_figure, walks_figure
from hexmj.studies.standings import by_rank, league_markdown, tables
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

TABLE, FILM = "league.md", "league.mp4"
"""Files for all tables, and for the best side by side."""

OF_TRIALS = ("ground", "ground_height", "ground_at", "ground_length", "load")
"""Conditions that the trials bring along, or of which none has any."""

FIGURES = {"league.png": league_figure, "league_walks.png": walks_figure}

BEST = 6
"""Who are filmed, at most."""

QUICK: dict[str, Any] = {"velocities": (0.1, 0.5, 0.9), "n_starts": 200, "physical_starts": 8, "trial_starts": 4}
"""Sizes of a quick look."""


@dataclass(frozen=True)
class League(StudyCommand):
    """Options of `hexmj league`, which `commands.COMMANDS` describes."""

    controllers: Annotated[
        tuple[str, ...] | None,
        arg(help=f"Who takes part, each {CONTROLLER}; wilson-ideal begins at its ideal start.  All unless given."),
    ] = None
    velocities: Sequence[float] | None = None
    """Velocities V_r as fractions of V_p, 0 < V < 1; 0.1, 0.2 ... 0.9 unless given, 0.1, 0.5, 0.9 if quick."""
    starts: int | None = None
    """Number of random starts on paper, the same for all; 1000 unless given, 200 if quick."""
    physical_starts: int | None = None
    """Of these, number of starts that walk in physics at every velocity; 200 unless given, 8 if quick, at most all."""
    trial_starts: int | None = None
    """Of these, number of starts in each trial; 50 unless given, 4 if quick, at most all."""
    trial_velocity: float = study.League.trial_velocity
    """V_r of the trials."""
    quick: bool = False
    """A quick look: four controllers, three velocities and few starts, unless others are given."""
    no_video: bool = False
    """Leave the film out."""
    out: Path = Path("results/league")
    """Folder for tables, figure, film, NetCDF, manifest and finished walks."""
    walks: OmitArgPrefixes[Walks] = Walks(seed=FRESH)
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    controlled: OmitArgPrefixes[Controlled] = AS_THEY_ARE
    conditions: OmitArgPrefixes[Conditions] = hiding(Conditions(), OF_TRIALS)
    outputs = Outputs("walking the league", "league.nc", FIGURES, others=(TABLE, FILM))

    @property
    def participants(self) -> tuple[str, ...]:
        """Who takes part, by name."""
        return (FOUR if self.quick else EVERYONE) if self.controllers is None else self.controllers

    @property
    def names(self) -> Sequence[str]:
        return list(dict.fromkeys(name.removesuffix(IDEAL) for name in self.participants))

    def study(self) -> study.League:
        distinct("controllers", self.participants)
        asked = {
            "velocities": self.velocities,
            "n_starts": self.starts,
            "physical_starts": self.physical_starts,
            "trial_starts": self.trial_starts,
        }
        sizes = (QUICK if self.quick else {}) | {name: size for name, size in asked.items() if size is not None}
        return study.League(
            entrants(self.participants, loaded),
            **sizes,
            trial_velocity=self.trial_velocity,
            observation_time=self.walks.time,
            **self.steady,
        )

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """All tables, and the conditions."""
        for one in tables(result):
            yield one.title
            yield from tables_that_fit(one.head, one.rows)
        yield self.conditions_line()

    def write_others(self, result: "xr.Dataset") -> list[Path]:
        """The tables as Markdown, and the film unless it is left out or cannot be made."""
        table = write_text(self.out / TABLE, league_markdown(result))
        if self.no_video:
            return [table]
        try:
            return [table, self._filmed(result)]
        except RenderingError as error:
            print(f"hexmj: no video: {error!s}", file=sys.stderr)
            return [table]

    def _filmed(self, result: "xr.Dataset") -> Path:
        """The best in physics side by side, from the first of the random starts, but for walks that are refused.

        Raises:
            RenderingError: there is no video, and why.
            InputError: it cannot be written.
        """
        from hexmj.replay.film.video import missing, render

        if sentence := missing():
            raise RenderingError(sentence)
        takes_part, v = entrants(self.participants, loaded), result.attrs["trial_velocity"]
        best = [name for name in by_rank(result).entrant.values if not takes_part[name].ideal][:BEST]
        shown = []
        for name in best:
            try:
                shown.append(recorded(self, takes_part[name].controller, v, 0, title=name))
            except (InputError, SimulationError) as error:
                print(f"hexmj: {f'{name} is not in the video: {error}'}", file=sys.stderr)
        if not shown:
            raise RenderingError("no controller of this league walks the first random start")
        render(shown, self.out / FILM, Film(width=480, height=360), progress=True)
        return self.out / FILM
