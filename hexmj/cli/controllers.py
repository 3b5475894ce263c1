"""`hexmj league`, `hexmj ablate`, `hexmj search` and `hexmj check-controller`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import Answer, Command, StudyCommand, filmed
from hexmj.cli.measures import PHYSICAL
from hexmj.cli.options import Figures, Output, Planning, Threads, build, network_rules, no_effect, option_fields
from hexmj.cli.output import interval, report_checks, table, tables_that_fit
from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

FILMED = 6
"""Most entrants in the film."""

QUICK: dict[str, Any] = {"velocity": (0.1, 0.5, 0.9), "starts": 200, "physical_starts": 8, "trial_starts": 4}
"""Options of a quick league."""


@dataclass(frozen=True)
class LeagueOptions:
    """Options of a league."""

    controllers: tuple[str, ...] | None = None
    """Entrants; wilson-ideal begins at the ideal start of wilson. By default all."""
    quick: bool = False
    """A quick look: four entrants, V = 0.1, 0.5, 0.9, 200 starts, of which 8 walk in physics and 4 in each trial.
    Sizes that you give count instead."""
    no_video: bool = False
    """Leave the film out."""


class League(StudyCommand):
    """Run a league: controllers from the literature and your own on the same starts, kinematically, in physics and in
    trials, with tables, figures and a film. A run that was stopped resumes if it is repeated."""

    study = "studies.league:League"
    own = (LeagueOptions,)
    planning = ()
    hidden = ("periods", "accelerating")
    data = "league.nc"
    figures = {"league": "league", "league_walks": "walks"}  # noqa: RUF012
    examples = ("--quick", "--controller ldvs mine.py:Mine --velocity 0.5 --no-video")

    def build(self, given: SimpleNamespace) -> Any:
        from hexmj.studies.league import League
        from hexmj.studies.league_cells import EVERYONE, FOUR, IDEAL, entrants

        names = (FOUR if given.quick else EVERYONE) if given.controller is None else given.controller
        distinct("--controller", names)
        given.entrants = entrants(names)
        given.controller = list(dict.fromkeys(name.removesuffix(IDEAL) for name in names))
        if given.quick:
            usual = {option.name: option.default for option in option_fields(League, "")}
            vars(given).update((name, value) for name, value in QUICK.items() if vars(given)[name] == usual[name])
        return build(League, given, controllers=given.entrants)

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.standings import tables

        for one in tables(result):
            yield one.title
            yield from tables_that_fit(one.head, one.rows)

    def others(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write the tables, and film the best entrants in physics side by side from the first random start."""
        from hexmj.files import write_text
        from hexmj.replay.film import Film
        from hexmj.replay.recording import Start
        from hexmj.studies.league_cells import is_ideal
        from hexmj.studies.standings import by_rank, league_markdown

        files = [write_text(given.out / "league.md", league_markdown(result))]
        ranked = by_rank(result).entrant.values.tolist()
        best = [name for name in ranked if not is_ideal(name, given.entrants[name])][:FILMED]
        if given.no_video or not best:
            return files
        how: Any = {"velocity": given.trial_velocity, "start": 0, "acceleration": None}
        walks = {name: build(Start, given, controller=given.entrants[name], **how) for name in best}
        shown = [walk.recorded(True, name, given.threads) for name, walk in walks.items()]
        return files + filmed(given.out / "league.mp4", shown, Film(width=480, height=360))


@dataclass(frozen=True)
class AblateOptions:
    """Options of an ablation."""

    controllers: tuple[str, ...] = ("ldvs", "walknet")
    """Weight sets of the 1998 network by name, walknet or walknet-reacog."""


class Ablate(StudyCommand):
    """Measure what each mechanism of the network or rule of Walknet contributes: the same starts without it, in
    kinematic walks, in the steady-state gait and in physics. A run that was stopped resumes if it is repeated."""

    study = "studies.ablation:Ablation"
    own = (AblateOptions,)
    planning = ()
    hidden = ("periods",)
    data = "ablation.nc"
    figures = {"ablation": "ablation"}  # noqa: RUF012
    examples = ("--controller ldvs --velocity 0.5", "--controller walknet --starts 200 --physical-starts 20")

    def build(self, given: SimpleNamespace) -> Any:
        from hexmj.studies.ablation import Ablation, wholes

        distinct("--controller", given.controller)
        return build(Ablation, given, controllers=wholes(given.controller))

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.ablation import MEASURES

        for measure, title in MEASURES.items():
            data = result.sel(measure=measure)
            starts = data.frequency_starts.max().item()
            yield f"{measure}: {title}; frequency of {starts} starts, and how far it is above the whole's (* for sure)"
            velocities = result.velocity.values
            rows = [
                (name, *(_ablated(data.sel(controller=name, velocity=v)) for v in velocities))
                for name in result.controller.values
            ]
            yield from tables_that_fit(("controller", *(f"V = {v:g}" for v in velocities)), rows)


def _ablated(data: "xr.Dataset") -> str:
    """Return the frequency in one cell, and the difference to the whole."""
    starts, physical = data.frequency_starts.item(), data.measure.item() == "physical"
    frequency = "-" if not starts else f"{data.frequency.item():.3f}"
    frequency += f" of {starts}" if physical and 0 < starts < data.attrs["physical_starts"] else ""
    more = data.more.item()
    if data.controller.item() == data.whole.item() or more != more:
        return frequency
    sure = "*" if data.more_low.item() > 0 or data.more_high.item() < 0 else ""
    return f"{frequency} ({more:+.3f}{sure})"


@dataclass(frozen=True)
class SearchOptions:
    """Options of a search."""

    velocities: tuple[float, ...] = (0.3,)
    """Problem 1: a velocity V_r as a fraction of V_p, 0 <= V < 1; problem 2: the least and the greatest of a range."""
    out: Path = Path("results/search")
    """Folder for the controller found (TOML), the history (NetCDF), a figure, a manifest and cached evaluations."""
    form: str = "ldvs"
    """Parameters of the 1998 network that are searched: nine (hws), ten with a neutral position that depends on the
    velocity (ldvs), 29 with mirror symmetry (mirrored), or all 58 weights (general); or a controller of your own, whose
    float fields are searched."""
    physical: bool = False
    """Minimise falls of the insect in MuJoCo instead of losses of the planned stability."""
    begin: str | None = None
    """Controller from which the population begins, with its order of updates and model variant. By default the paper's
    '0'-individual (evolution), the middle of the domain (cmaes), or the usual values of a controller of your own."""
    fresh: bool = False
    """Discard the cached evaluations of this search."""


class Search(Command):
    """Search for parameters that minimise the FLSS: a population with few starts, then the downhill simplex with many,
    and a verdict on fresh starts. A search that was stopped resumes if it is repeated."""

    sources = (SearchOptions, "search.stages:Effort", "search.problems:Problem", Output, Planning, Threads, Figures)
    hidden = ("low", "high")
    examples = ("--form hws --velocity 0.5 --budget 200", "--form mine.py:Mine --velocity 0.3 0.6 --algorithm cmaes")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.search.results import run_search, title

        problem, effort = self.settings(given)
        how: Any = {"threads": given.threads, "fresh": given.fresh, "figure": f"convergence.{given.format}"}
        result = run_search(problem, effort, given.out, progress=True, **how)
        rows = zip(problem.form.names, *result.vectors.values(), strict=True)
        numbers = [(name, *(f"{value:.4g}" for value in values)) for name, *values in rows]
        verdict, times = result.verdict, result.verdict.observation_time.values.tolist()
        judged = [
            (name, *(interval(verdict.sel(controller=name, observation_time=time), "flss") for time in times))
            for name in verdict.controller.values.tolist()
        ]
        effort = result.effort
        lines = [
            title(problem, effort),
            table(("parameter", *result.vectors), numbers),
            f"FLSS on {effort.verdict_starts} fresh starts (seed {effort.verdict_seed}), with 95 % intervals",
            table(("controller", *(f"observation time {time.removesuffix('.0')}" for time in times)), judged),
            *result.found.report(problem),
        ]
        return Answer(result.summary(), lines, result.files, result.settings)

    def settings(self, given: SimpleNamespace) -> Any:
        """Return the problem and the effort that the options describe."""
        from hexmj.search.forms import named_form
        from hexmj.search.problems import Problem
        from hexmj.search.stages import Effort

        if not 1 <= len(given.velocity) <= 2:
            raise InputError(f"--velocity = {given.velocity}; expected one velocity, or the two ends of a range")
        if not given.physical:
            no_effect(given, PHYSICAL, "without --physical")
        effort = build(Effort, given)
        own: dict[str, Any] = {"form": named_form(given.form, effort.beginning, **network_rules(given))}
        own |= {"low": given.velocity[0], "high": given.velocity[-1]}
        return build(Problem, given, **own, **({} if given.physical else {"conditions": None})), effort


@dataclass(frozen=True)
class CheckOptions:
    """Options of the interface checks."""

    name: str
    """The controller."""
    velocities: Sequence[float] = (0.0, 0.02, 0.5, 0.95)
    """Two or more velocities V_r at which it can plan, each 0 <= V < 1; it must also accelerate to them."""
    dt: float = Stride.dt
    """Time step of the plans, of which 600 are checked [time units]."""


class CheckController(Command):
    """Check whether a controller keeps the interface of hexmj. Each failed check names the error, and the exit code is
    then 1."""

    sources = (CheckOptions, Output)
    positional = "name"
    examples = ("ldvs", "mine.py:Mine --velocity 0.2 0.5 --json")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.controllers.conformance import findings
        from hexmj.controllers.registry import load_controller

        found = findings(load_controller(given.name), Stride(dt=given.dt), given.velocity)
        report_checks(found, given.json, controller=given.name)
