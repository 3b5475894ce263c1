"""Minimisation of the cost function (paper, Section 4): a population from few starts, then the simplex from many."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from hexmj.checks import check_types, path_of, typed, whole
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError, without_extra
from hexmj.plain import plain
from hexmj.progress import Progress, shown
from hexmj.search.domain import Domain
from hexmj.search.evolution import Evolution
from hexmj.search.history import Asked, history
from hexmj.search.problems import Problem
from hexmj.search.samples import REFUSED, Sample
from hexmj.starts import check_draw
from hexmj.sweep import CachedValues, Cell
from hexmj.threads import thread_count

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.search.covariance import CovarianceAdaptation

Costs = Callable[[np.ndarray], np.ndarray]
"""(candidate, parameter) -> (candidate,)."""

MOST = 10_000
"""Individuals of the largest population."""


@dataclass(frozen=True)
class Effort:
    """How a problem is searched."""

    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """Reach of the initial population [mm, or 1], see `Problem.domain`."""
    begin: Controller | None = None
    """Where the population begins, by the rules of what is searched or as printed; without it at `forms.Form.begin`,
    and with none there either at the paper's '0'-individual (evolution) or in the middle of the domain (cmaes)."""
    starts: int = 500
    """Starts of each candidate."""
    budget: int = 1000
    """Most evaluations of the population's search; at L = 10 about the paper's 100 iterations."""
    refine_starts: int = 7000
    """Starts of each candidate of the simplex."""
    refine_budget: int = 400
    """Most evaluations of the simplex; 0 leaves it out."""
    seed: int = 0
    """Of the starts, their velocities and the algorithm."""

    def __post_init__(self) -> None:
        check_types(self)
        if self.algorithm == "cmaes" and find_spec("cmaes") is None:
            raise without_extra("search", "cmaes, which the algorithm of this name needs,")
        whole("population", self.population, 4 if self.algorithm == "cmaes" else 2, MOST, " individuals")
        check_draw(self.starts, self.seed)
        check_draw(self.refine_starts, self.seed, "refine_starts")
        if self.begin is not None:
            check_controller_type(self.begin)
        if self.budget < self.population:
            raise InputError(f"budget = {self.budget}; expected at least one generation, {self.population} evaluations")
        if self.refine_budget < 0:
            raise InputError(f"refine_budget = {self.refine_budget}; expected 0 or more evaluations")


@dataclass(frozen=True, eq=False)
class Found:
    """What a search has found."""

    vector: np.ndarray
    """(parameter,) the best candidate of the last stage."""
    cost: float
    """Its cost on the starts of that stage, see `Problem.minimised`."""
    lost: int | None
    """How many of these starts were lost, or fell; unknown of a mean over variants."""
    starts: int
    """Number of these starts."""
    history: "xr.Dataset"
    """Every candidate and cost, see `history.history`."""
    replayed: int
    """Different candidates whose cost an earlier run had kept."""
    refused: list[str]
    """Why the controller refused candidates as they were made, which cost 1 each; so do those that refuse to walk, that
    reach too far or whose simulation fails, of which nothing is told."""


def search(
    problem: Problem,
    effort: Effort,
    *,
    folder: Path | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> Found:
    """Search with a population, then refine the best of it; binary parameters stay as the first stage found them.

    Args:
        problem: what is minimised.
        effort: how.
        folder: keeps every evaluation as it is made; none of them is made again, by this search or another of the same
            problem and starts.  It is held meanwhile, and another search has to wait.
        threads: one per core unless given; the result does not depend on it.
        progress: True shows a bar; or a function that is told the fraction done since it was last called.

    Raises:
        InputError: settings that make no sense, a file that is damaged or cannot be written, a folder in use, or a
            best candidate that its controller refuses, as where it refuses all.
        SimulationError: a start that does not settle, or a best candidate whose simulation fails.
    """
    typed("problem", problem, Problem)
    typed("effort", effort, Effort)
    thread_count(threads)
    folder = None if folder is None else path_of(folder)
    if problem.conditions:
        from hexmj.physics.settling import check_adhesion

        check_adhesion(problem.conditions, problem.stride, effort.seed)
    with shown(progress, "searching") as told:
        return _search(problem, effort, folder, threads, told)


def _search(
    problem: Problem, effort: Effort, folder: Path | None, threads: int | None, progress: Progress | None
) -> Found:
    domain, asked = problem.domain(effort.domain, effort.begin), list[Asked]()
    refine_budget = 0 if domain.binary.all() else effort.refine_budget  # which leaves binary ones as they are
    work = effort.budget * effort.starts + refine_budget * effort.refine_starts
    sizes = {"population": effort.starts} | ({"simplex": effort.refine_starts} if refine_budget else {})
    samples = {stage: Sample(problem, size, effort.seed) for stage, size in sizes.items()}
    for sample in samples.values():
        sample.settle(threads)
    searcher = _searcher(effort, domain)
    kept = {
        stage: CachedValues(Cell(stage, sample.costs, {}), folder, threads=threads) for stage, sample in samples.items()
    }

    def costs(stage: str, candidates: np.ndarray) -> np.ndarray:
        result = np.empty(len(candidates))
        together = 1 if problem.conditions else len(candidates)  # physical walks take long: each is kept at once
        for i in range(0, len(candidates), together):
            result[i : i + together] = kept[stage](candidates[i : i + together])
            if progress:
                progress(together * sizes[stage] / work)
        asked.append((stage, candidates.copy(), result))
        return result

    best, cost = run(searcher, partial(costs, "population"), effort.budget)
    if refine_budget:
        best, cost = refine(best, ~domain.binary, partial(costs, "simplex"), refine_budget, domain.unit)
    course = history(asked, problem.form.names, problem.minimised)
    settings = json.dumps({"problem": problem.settings(), "effort": plain(effort)}, sort_keys=True)
    replayed = sum(one.replayed for one in kept.values())
    refused = list(filter(None, map(problem.refusal, course.candidate.values)))
    if why := problem.refusal(best):
        raise InputError(
            f"{len(refused)} of {course.sizes['evaluation']} candidates were refused, the best one by: {why}"
        )
    stage, last = [*samples.items()][-1]
    if cost >= REFUSED:
        last.check_walks(best, stage, threads)
    told = course.assign_attrs(settings=settings, refused=len(refused))
    return Found(best, cost, last.lost(cost), last.n_starts, told, replayed, refused)


def _searcher(effort: Effort, domain: Domain) -> "Evolution | CovarianceAdaptation":
    """An algorithm that sees only vectors and their costs."""
    if effort.algorithm == "evolution":
        return Evolution(domain, effort.population, effort.seed)
    from hexmj.search.covariance import CovarianceAdaptation

    return CovarianceAdaptation(domain, effort.population, effort.seed)


def run(searcher: "Evolution | CovarianceAdaptation", costs: Costs, budget: int) -> tuple[np.ndarray, float]:
    """Drive a searcher for as many whole generations as `budget` evaluations allow; the best vector and its cost."""
    done, tried = 0, []
    while done + len(candidates := searcher.ask()) <= budget:
        told = costs(candidates)
        searcher.tell(told)
        done += len(candidates)
        tried.append((candidates[np.argmin(told)], told.min()))
    return _least(tried)


def refine(
    start: np.ndarray, free: np.ndarray, costs: Costs, budget: int, unit: np.ndarray | float = 1.0
) -> tuple[np.ndarray, float]:
    """Downhill simplex from `start` over its `free` parameters; the best vector and its cost.

    The first simplex is long enough to leave the steps of a frequency: each edge is a tenth of the
    parameter and 0.1 of its `unit`, see `Domain`.  Corners of the last are within some 1e-4 of it and cost the same.
    """
    from scipy.optimize import minimize

    tried = []
    scale = np.ldexp(1.0, np.frexp(np.broadcast_to(unit, start.shape))[1] - 1)[free]  # powers of 2 round no number

    def cost(x: np.ndarray) -> float:
        vector = start.copy()
        vector[free] = x * scale
        tried.append((vector, costs(vector[None])[0]))
        return tried[-1][1]

    x, edge = start[free], (0.1 * np.abs(start) + 0.1 * unit)[free]
    how = {"maxfev": budget, "initial_simplex": np.vstack([x, x + np.diag(edge)]) / scale}
    minimize(cost, x / scale, method="Nelder-Mead", options=how | {"xatol": 1e-4, "fatol": 1e-9})
    return _least(tried)


def _least(tried: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, float]:
    vector, cost = min(tried, key=lambda one: one[1])
    return vector, float(cost)
