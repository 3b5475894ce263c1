"""`hexmj search` and `hexmj check-controller`."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from hexmj.cli.command import Answer, Command
from hexmj.cli.measures import DYNAMIC
from hexmj.cli.options import Figures, Json, Output, Planning, Threads, build, check_kinematic, network_rules
from hexmj.cli.output import grid, report_checks, table
from hexmj.errors import InputError
from hexmj.timing import Stride


@dataclass(frozen=True)
class SearchOptions:
    """Options of `hexmj search` that `Effort` and `Problem` do not have."""

    velocities: tuple[float, ...] = (0.3,)
    """Velocity V_r of the walks (problem 1), or the least and the greatest V_r of a range (problem 2); fractions of
    V_p, 0 <= V < 1."""
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
        effort = result.effort
        lines = [
            title(problem, effort),
            table(("parameter", *result.vectors), numbers),
            f"{problem.frequency} on {effort.verdict_starts} fresh starts (seed {effort.verdict_seed}), 95 % intervals",
            grid(result.verdict, ("controller",), ("flss",)),
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
        if given.measure != "physical":
            check_kinematic(given, DYNAMIC if given.measure == "dynamic" else ())
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

    sources = (CheckOptions, Json)
    positional = "name"
    examples = ("ldvs", "mine.py:Mine --velocity 0.2 0.5 --json")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.controllers.conformance import findings
        from hexmj.controllers.registry import load_controller

        found = findings(load_controller(given.name), Stride(dt=given.dt), given.velocity)
        report_checks(found, given.json, controller=given.name)
