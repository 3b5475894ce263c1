"""`hexmj league`, `hexmj search` and `hexmj check-controller`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import Answer, Command, StudyCommand, filmed
from hexmj.cli.measures import check_measure
from hexmj.cli.options import Figures, Output, Planning, Threads, build, network_rules, option_fields
from hexmj.cli.output import interval, report_checks, table
from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

FILMED = 6
"""Maximum number of controllers in the film."""

QUICK: dict[str, Any] = {"velocity": (0.1, 0.5, 0.9), "starts": 200, "physical_starts": 8, "trial_starts": 4}
"""Option -> its default in a quick league."""


@dataclass(frozen=True)
class LeagueOptions:
    """Options of `hexmj league` that its study does not have."""

    controllers: tuple[str, ...] | None = None
    """Controllers that take part, by default all of the league."""
    quick: bool = False
    """Run a small league: four controllers, V = 0.1, 0.5 and 0.9, 200 starts, of which 8 walk in physics and 4 in each
    trial. Values that you give for these options take precedence."""
    no_video: bool = False
    """Write no film."""


class League(StudyCommand):
    """Compare controllers from the literature and your own on the same starts: in kinematic walks, in physics and in
    trials. Write tables, figures and a film. Repeat the command to resume a stopped run."""

    study = "studies.league:League"
    own = (LeagueOptions,)
    planning = ()
    hidden = ("periods",)
    data = "league.nc"
    figures = {"league": "league", "league_walks": "walks", "prediction": "prediction"}  # noqa: RUF012
    examples = ("--quick", "--controller ldvs mine.py:Mine --velocity 0.5 --no-video")

    def build(self, given: SimpleNamespace) -> Any:
        from hexmj.studies.league import League
        from hexmj.studies.league_cells import EVERYONE, FOUR, entrants

        names = (FOUR if given.quick else EVERYONE) if given.controller is None else given.controller
        distinct("--controller", names)
        given.entrants = entrants(names)
        given.controller = names
        if given.quick:
            defaults = {option.name: option.default for option in option_fields(League, "")}
            vars(given).update((name, value) for name, value in QUICK.items() if vars(given)[name] == defaults[name])
        return build(League, given, controllers=given.entrants)

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.standings import tables

        for ranking in tables(result):
            yield ranking.title
            yield table(ranking.head, ranking.rows)

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write the tables as Markdown, and a film of the best controllers, which walk in physics from start 0."""
        from hexmj.files import write_text
        from hexmj.replay.film import Film
        from hexmj.replay.recording import Start
        from hexmj.studies.standings import by_rank, league_markdown

        files = [write_text(given.out / "league.md", league_markdown(result))]
        if given.no_video:
            return files
        best = by_rank(result).entrant.values.tolist()
        start: Any = {"velocity": given.trial_velocity, "start": 0, "acceleration": None}
        walks = {name: build(Start, given, controller=given.entrants[name], **start) for name in best[:FILMED]}
        shown = [walk.recorded(True, name, given.threads) for name, walk in walks.items()]
        return files + filmed(given.out / "league.mp4", shown, Film(width=480, height=360))


@dataclass(frozen=True)
class SearchOptions:
    """Options of `hexmj search` that `Effort` and `Problem` do not have."""

    velocities: tuple[float, ...] = (0.3,)
    """Velocity V_r of the walks (problem 1), or the least and the greatest V_r of a range (problem 2); fractions of
    V_p, 0 <= V < 1."""
    out: Path = Path("results/search")
    """Folder for the controller found (TOML), the history (NetCDF), a figure, a manifest and cached evaluations."""
    form: str = "ldvs"
    """Parameters that are searched. Of the 1998 network: nine (hws), ten with a neutral position that depends on the
    velocity (ldvs), 29 with mirror symmetry (mirrored), or all 58 weights (general). With the name of a controller of
    your own (mine.py:Mine): its float fields."""
    begin: str | None = None
    """Controller that gives the first population's parameters, the order of updates and the model variant. By default
    the paper's '0'-individual (evolution), the middle of the domain (cmaes), or the defaults of your own controller."""
    fresh: bool = False
    """Discard the cached evaluations of this search, and evaluate everything again."""


class Search(Command):
    """Search for parameters that minimise the FLSS: first with a population and few starts, then with the downhill
    simplex and many starts. Fresh starts then test the result. Repeat the command to resume a stopped search."""

    sources = (SearchOptions, "search.stages:Effort", "search.problems:Problem", Output, Planning, Threads, Figures)
    hidden = ("low", "high")
    examples = ("--form hws --velocity 0.5 --budget 200", "--form mine.py:Mine --velocity 0.3 0.6 --algorithm cmaes")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.search.results import run_search, title

        problem, effort = self.settings(given)
        execution: Any = {"threads": given.threads, "fresh": given.fresh, "figure": f"convergence.{given.format}"}
        result = run_search(problem, effort, given.out, progress=True, **execution)
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
            f"{problem.frequency} on {effort.verdict_starts} fresh starts (seed {effort.verdict_seed}), 95 % intervals",
            table(("controller", *(f"observation time {time.removesuffix('.0')}" for time in times)), judged),
            *result.found.report(problem),
        ]
        return Answer(result.summary(), lines, result.files, result.settings)

    def settings(self, given: SimpleNamespace) -> Any:
        """Build the search problem and its effort (algorithm, budgets and starts) from the options."""
        from hexmj.search.forms import named_form
        from hexmj.search.problems import Problem
        from hexmj.search.stages import Effort

        if not 1 <= len(given.velocity) <= 2:
            raise InputError(f"--velocity = {given.velocity}; expected one velocity, or the two ends of a range")
        check_measure(given)
        effort = build(Effort, given)
        own: dict[str, Any] = {"form": named_form(given.form, effort.beginning, **network_rules(given))}
        own |= {"low": given.velocity[0], "high": given.velocity[-1]}
        return build(Problem, given, **own), effort


@dataclass(frozen=True)
class CheckOptions:
    """Options of `hexmj check-controller`."""

    name: str
    """Controller to check: a name, a TOML file, module:object or file.py:object."""
    velocities: Sequence[float] = (0.0, 0.02, 0.5, 0.95)
    """Two or more velocities V_r at which the controller must plan and to which it must accelerate, each 0 <= V < 1."""
    dt: float = Stride.dt
    """Time step of the plans [time units]; 600 steps are checked."""


class CheckController(Command):
    """Check whether a controller follows the interface of hexmj. A failed check reports its error, and the exit code is
    then 1."""

    sources = (CheckOptions, Output)
    positional = "name"
    examples = ("ldvs", "mine.py:Mine --velocity 0.2 0.5 --json")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.controllers.conformance import findings
        from hexmj.controllers.registry import load_controller

        found = findings(load_controller(given.name), Stride(dt=given.dt), given.velocity)
        report_checks(found, given.json, controller=given.name)
