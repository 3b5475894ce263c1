"""`hexmj search`."""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Figures, Workers
from hexmj.cli.tables import interval, print_json, show, table
from hexmj.cli.walking_command import WalkingCommand
from hexmj.errors import InputError
from hexmj.io import MANIFEST, save_manifest

if TYPE_CHECKING:
    from hexmj.search.problems import Problem
    from hexmj.search.results import Result
    from hexmj.search.stages import Effort


@dataclass(frozen=True)
class Search(WalkingCommand):
    """Options of `hexmj search`, which `commands.COMMANDS` describes."""

    form: str = "ldvs"
    """Nine parameters (hws), ten with a neutral position that depends on the velocity (ldvs), or 29, in which only
    left and right are alike (mirrored), or all 58 weights (general) of the 1998 network; or a controller of your own
    (module:object, file.py:object, an entry point), whose float fields are searched."""
    velocity: float | None = None
    """Problem 1: this velocity V_r as a fraction of V_p, 0 <= V < 1; 0.3 unless one or a range is given."""
    velocities: tuple[float, float] | None = None
    """Problem 2: velocities drawn uniformly from this range."""
    physical: bool = False
    """Minimise falls of the insect in MuJoCo instead of losses of the planned polygon."""
    over: Literal["usual", "mean", "worst"] = "usual"
    """Minimise the FLSS as given (usual), or its mean or worst over variants of constants and rules that the paper does
    not print (`hexmj variants`; in physics without AEP0 11); what is so anyway is as usually instead."""
    ties: Literal["equal", "later"] = "equal"
    """Of candidates that lose equally many starts none is better (equal), or that which loses them later."""
    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """The first population's shifts [mm] and weights are drawn from 0 to this, neutral positions [mm] from minus this
    to this; not printed in the paper.  Fields of a controller of your own: from 0 to this times the usual value,
    or to this where that is 0."""
    begin: str | None = None
    """A controller from which the population begins, with its order of updates and reading unless they are given;
    without it the paper's '0'-individual (evolution), the middle of the domain (cmaes), or the usual values of a
    controller of your own."""
    starts: int | None = None
    """Random starts of each candidate, the same for all; 500 unless given, 50 if physical."""
    budget: int = 1000
    """Most evaluations of the population's search; at L = 10 about the paper's 100 iterations."""
    refine_starts: int | None = None
    """Random starts of each candidate of the simplex; 7000 unless given, 100 if physical."""
    refine_budget: int = 400
    """Most evaluations of the simplex; 0 leaves it out."""
    verdict_starts: int | None = None
    """Fresh random starts for the verdict; 7000 unless given, 200 if physical."""
    verdict_seed: int = 1998
    """Seed of the fresh starts; another than --seed."""
    fresh: bool = False
    """Discard the cached evaluations of this search."""
    out: Path = Path("results/search")
    """Folder for what was found (TOML), the history (NetCDF), a figure, a manifest and all evaluations."""
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    drawn: OmitArgPrefixes[Figures] = field(default_factory=Figures)

    def run(self) -> None:
        """Search, judge what was found on fresh starts, write and print."""
        from hexmj.search.results import run_search
        from hexmj.search.stages import Effort

        if not self.physical:
            self.refuse_physical("without --physical")
        names = "algorithm", "population", "domain", "begin", "starts", "budget", "refine_starts", "refine_budget"
        options = {name: getattr(self, name) for name in (*names, "verdict_starts", "verdict_seed")}
        effort = Effort(**options, seed=self.walks.seed)
        problem = self._problem(effort)
        figure = self.drawn.named("convergence.png")
        result = run_search(
            problem, effort, self.out, threads=self.workers.threads, progress=True, fresh=self.fresh, figure=figure
        )
        result.files.append(save_manifest(sys.argv[1:], result.settings, result.files, self.out / MANIFEST))
        if self.json:
            print_json(result.summary())
        else:
            self._show(result)

    def _problem(self, effort: "Effort") -> "Problem":
        from hexmj.search.forms import named_form
        from hexmj.search.problems import Problem

        if self.velocity is not None and self.velocities is not None:
            raise InputError("--velocity and --velocities were both given; expected one velocity or one range")
        how = {name: value for name, value in self.walked.items() if name != "seed"}
        how |= {"feedback": self.controlled.feedback, "over": self.over, "ties": self.ties}
        form = named_form(self.form, effort.beginning, **self.controlled.rules)
        return Problem(form, *self.commanded, **how, conditions=self.conditions if self.physical else None)

    @property
    def commanded(self) -> tuple[float, float]:
        v = 0.3 if self.velocity is None else self.velocity
        return self.velocities or (v, v)

    def _show(self, result: "Result") -> None:
        from hexmj.search.results import title

        found, verdict, problem = result.found, result.verdict, result.problem
        rows = zip(problem.form.names, *result.vectors.values(), strict=True)
        numbers = [(name.replace("_", " "), *(f"{value:.4g}" for value in values)) for name, *values in rows]
        times = verdict.observation_time.values.tolist()
        judged = [
            (name, *(interval(verdict.sel(controller=name, observation_time=time), "flss") for time in times))
            for name in verdict.controller.values.tolist()
        ]
        over = f"{self.over} over {len(problem.variants)} variants of " if self.over != "usual" else ""
        kind = "physical" if self.physical else "kinematic"
        effort = result.effort
        show(
            title(problem, effort),
            table(("parameter", *result.vectors), numbers),
            f"{over}{kind} FLSS on {effort.verdict_starts} fresh starts (seed {effort.verdict_seed}), 95 % intervals",
            table(("model", *(f"observation time {time.removesuffix('.0')}" for time in times)), judged),
            *found.report(problem),
            self.conditions_line(self.physical),
            *map(str, result.files),
        )
