"""A search (paper, Section 4): a population on few starts, then the downhill simplex on many."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import load_controller
from hexmj.errors import InputError, without_extra
from hexmj.plain import plain
from hexmj.progress import Progress, shown
from hexmj.search.algorithms import CovarianceAdaptation, Evolution, refine, search_population
from hexmj.search.problems import REFUSED, Problem, Sample
from hexmj.starts import SAMPLE, check_draw
from hexmj.sweep import CachedValues, Cell
from hexmj.validate import choice, whole

if TYPE_CHECKING:
    import xarray as xr

STAGES: tuple[str, ...] = ("population", "simplex")


@dataclass(frozen=True)
class Effort:
    """Algorithm, budgets and starts of a search."""

    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """The first population's shifts [mm] and weights are drawn from 0 to this, its neutral positions [mm] from minus
    this to this; the paper does not print it. Fields of another controller: from 0 to this times the usual value, or to
    this if that is 0."""
    begin: str | Controller | None = None
    """Controller from which the population begins. By default the paper's '0'-individual (evolution), the middle of
    the domain (cmaes), or the usual values of a controller of your own."""
    starts: int | None = None
    """Random starts of each candidate, the same for all; by default 500, or 50 in physical walks."""
    budget: int = 1000
    """Most evaluations of the population's search; for L = 10 about the paper's 100 iterations."""
    refine_starts: int | None = None
    """Random starts of each candidate of the simplex; by default 7000, or 100 in physical walks."""
    refine_budget: int = 400
    """Most evaluations of the simplex; 0 leaves it out."""
    seed: int = 0
    """Seed of the starts, their velocities and the algorithm."""
    verdict_starts: int | None = None
    """Fresh random starts for the verdict; by default 7000, or 200 in physical walks."""
    verdict_seed: int = 1998
    """Seed of the fresh starts; another than that of the search."""

    def __post_init__(self) -> None:
        if choice("algorithm", self.algorithm, ("evolution", "cmaes")) == "cmaes" and find_spec("cmaes") is None:
            raise without_extra("search", "cmaes, which the algorithm of this name needs,")
        whole("population", self.population, 4 if self.algorithm == "cmaes" else 2)
        for name in ("starts", "refine_starts", "verdict_starts"):
            if (size := getattr(self, name)) is not None:
                check_draw(size, self.seed, name)
        whole("budget", self.budget, self.population)
        whole("refine_budget", self.refine_budget, 0)
        check_draw(1, self.seed)
        check_draw(1, self.verdict_seed, seed_name="verdict_seed")

    def completed(self, physical: bool) -> "Effort":
        """Return the effort with numbers of starts in place of None."""
        sizes = {"starts": (500, 50), "refine_starts": (7 * SAMPLE, 100), "verdict_starts": (7 * SAMPLE, 200)}
        return replace(self, **{name: both[physical] for name, both in sizes.items() if getattr(self, name) is None})

    @property
    def beginning(self) -> Controller | None:
        """The controller that `begin` names."""
        return load_controller(self.begin) if isinstance(self.begin, str) else self.begin


@dataclass(frozen=True, eq=False)
class Found:
    """The outcome of a search."""

    vector: np.ndarray
    """(parameter,) best candidate of the last stage."""
    cost: float
    """Its cost on the starts of that stage, see `Problem.minimised`."""
    lost: int | None
    """Number of these starts that were lost, or fell; None for a mean over variants."""
    starts: int
    """Number of these starts."""
    history: "xr.Dataset"
    """All candidates and their costs, see `history`."""
    replayed: int
    """Number of distinct candidates whose costs an earlier run had cached."""
    refused: list[str]
    """Reasons for which no controller could be made of candidates, which cost 1 each. Candidates that do not walk,
    reach too far or whose simulation fails cost 1 too, and are not listed."""

    def report(self, problem: Problem) -> list[str]:
        """Return sentences on the evaluations, the least cost and refused candidates."""
        least = f"least cost {self.cost:.4g}"
        if problem.ties == "later":
            least += f" ({problem.minimised}" + (f"; {self.lost} of {self.starts} starts lost)" if self.lost else ")")
        lines = [f"{len(self.history.cost)} evaluations, {self.replayed} candidates from an earlier run; {least}"]
        if lost := int((self.history.cost.values >= REFUSED).sum()):
            lines.append(f"{lost} evaluations cost 1: all starts lost stability, or the candidate does not walk")
        if self.refused:
            lines.append(f"{len(self.refused)} candidates were refused, the first by {self.refused[0]}")
        return lines


def search(
    problem: Problem,
    effort: Effort,
    *,
    folder: Path | str | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    fresh: bool = False,
) -> Found:
    """Search with a population, then refine the best candidate; the simplex leaves binary parameters as they are.

    Args:
        problem: the cost function.
        effort: algorithm, budgets and starts.
        folder: caches every evaluation; a search that is killed resumes with equal results.
        threads: one per core by default; the result does not depend on them.
        progress: True shows a bar; a function receives the fraction done since its last call.
        fresh: discard the cached evaluations of this search.

    Raises:
        InputError: settings that make no sense, or a best candidate that its controller refuses.
        SimulationError: a start does not settle, or the best candidate's simulation fails.
    """
    effort = effort.completed(physical=problem.conditions is not None)
    domain = problem.domain(effort.domain, effort.beginning)
    budgets = dict(zip(STAGES, (effort.budget, effort.refine_budget), strict=True))
    sizes = dict(zip(STAGES, (effort.starts or 0, effort.refine_starts or 0), strict=True))
    work = sum(budgets[stage] * sizes[stage] for stage in STAGES)
    samples = {stage: Sample(problem, sizes[stage], effort.seed) for stage in STAGES if budgets[stage]}
    how: Any = {"threads": threads, "fresh": fresh}
    cached = {stage: CachedValues(Cell(stage, one.costs, {}), folder, **how) for stage, one in samples.items()}
    evaluated: list[Evaluated] = []
    with shown(progress, "searching") as advance:
        for sample in samples.values():
            sample.settle(threads)

        def costs(stage: str, candidates: np.ndarray) -> np.ndarray:
            result = np.empty(len(candidates))
            together = 1 if problem.conditions else len(candidates)  # physical walks take long: each is cached at once
            for i in range(0, len(candidates), together):
                result[i : i + together] = cached[stage](candidates[i : i + together])
                if advance:
                    advance(together * sizes[stage] / work)
            evaluated.append((stage, candidates.copy(), result))
            return result

        algorithm = Evolution if effort.algorithm == "evolution" else CovarianceAdaptation
        searcher = algorithm(domain, effort.population, effort.seed)
        best, cost = search_population(searcher, partial(costs, "population"), effort.budget)
        if effort.refine_budget:
            best, cost = refine(best, ~domain.binary, partial(costs, "simplex"), effort.refine_budget, domain.unit)
    course = history(evaluated, problem.form.names, problem.minimised)
    refused = list(filter(None, map(problem.refusal, course.candidate.values)))
    if reason := problem.refusal(best):
        raise InputError(f"{len(refused)} of {len(course.cost)} candidates were refused, the best one: {reason}")
    last = list(samples.values())[-1]
    if cost >= REFUSED:
        last.check_walks(best, threads)
    settings = json.dumps({"problem": problem.settings(), "effort": plain(effort)}, sort_keys=True)
    course = course.assign_attrs(settings=settings, refused=len(refused))
    replayed = sum(values.replayed for values in cached.values())
    return Found(best, cost, last.lost(cost), last.n_starts, course, replayed, refused)


Evaluated = tuple[str, np.ndarray, np.ndarray]
"""A stage, some of its candidates, (candidate, parameter), and their costs, (candidate,)."""


def history(evaluated: Sequence[Evaluated], names: Sequence[str], minimised: str) -> "xr.Dataset":
    """Return stage, candidate, cost and least cost so far of the stage over `evaluation`, counted from 0.

    `names` are those of the parameters, and `minimised` is the cost in words.
    """
    import pandas as pd
    import xarray as xr

    stages, candidates, costs = zip(*evaluated, strict=True)
    stage, cost = np.repeat([STAGES.index(one) for one in stages], [*map(len, costs)]), np.concatenate(costs)
    best = pd.Series(cost).groupby(stage).cummin().values
    flags = {"flag_values": [0, 1], "flag_meanings": " ".join(STAGES)}
    return xr.Dataset(
        {
            "stage": ("evaluation", stage, flags),
            "candidate": (("evaluation", "parameter"), np.concatenate(candidates), {"long_name": "parameters"}),
            "cost": ("evaluation", cost, {"units": "1", "long_name": minimised}),
            "best": ("evaluation", best, {"units": "1", "long_name": f"least so far of the stage: {minimised}"}),
        },
        coords={"evaluation": np.arange(len(cost)), "parameter": list(names)},
        attrs={"study": "search", "title": minimised},
    )
