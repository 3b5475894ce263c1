"""Minimisation of the cost function (paper, Section 4): a population from few starts, then the simplex from many."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from hexmj.errors import InputError
from hexmj.parameters import Model
from hexmj.progress import Progress
from hexmj.search.covariance import CovarianceAdaptation
from hexmj.search.evolution import Evolution
from hexmj.search.history import Costs, History
from hexmj.search.problems import Problem, Sample

if TYPE_CHECKING:
    import xarray as xr

ALGORITHMS = {"evolution": Evolution, "cmaes": CovarianceAdaptation}


class Searcher(Protocol):
    """An algorithm that sees only vectors and their costs."""

    def ask(self) -> np.ndarray:
        """The next candidates, (candidate, parameter)."""
        ...

    def tell(self, costs: np.ndarray) -> None:
        """Their costs, (candidate,)."""
        ...


@dataclass(frozen=True)
class Plan:
    """How a problem is searched."""

    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """The paper's evolutionary algorithm, or CMA-ES."""
    population: int = 10
    """Individuals of a generation; the paper's L."""
    domain: float = 10.0
    """Reach of the initial population [mm, or 1], see `Problem.domain`."""
    begin: Model | None = None
    """A set from which the population begins; without it the paper's '0'-individual, or the middle of the domain."""
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
        if self.algorithm not in ALGORITHMS:
            raise InputError(f"algorithm = {self.algorithm!r}; valid names: {', '.join(ALGORITHMS)}")
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
    """Its cost on the starts of that stage."""
    history: "xr.Dataset"
    """Every candidate and cost, see `History.dataset`."""
    replayed: int
    """Evaluations that an earlier, unfinished run had already made."""


def search(
    problem: Problem,
    plan: Plan,
    *,
    path: Path | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Found:
    """Search with a population, then refine the best of it; P^2 and P^4 stay as the first stage found them.

    Args:
        problem: what is minimised.
        plan: how.
        path: NetCDF file for the history; a search that was killed goes on from it, to the same bits.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Raises:
        InputError: settings that make no sense, or a file that is damaged or of another search.
        SimulationError: a physical walk that failed; the history up to it is kept.
    """
    domain = problem.domain(plan.domain, plan.begin)
    begin = None if domain.begin is None else domain.begin.tolist()
    history = History(path, problem.names(), {"problem": asdict(problem), "plan": asdict(plan) | {"begin": begin}})
    work = plan.budget * plan.starts + plan.refine_budget * plan.refine_starts

    def costs(stage: str, starts: int) -> Costs:
        evaluate = history.recorded(stage, Sample.draw(problem, starts, plan.seed, threads).costs)

        def told(candidates: np.ndarray) -> np.ndarray:
            result = evaluate(candidates)
            if progress:
                progress(len(candidates) * starts / work)
            return result

        return told

    few, many = costs("population", plan.starts), costs("simplex", plan.refine_starts)
    searcher = ALGORITHMS[plan.algorithm](domain, plan.population, plan.seed)
    try:
        best, cost = run(searcher, few, plan.budget)
        if plan.refine_budget:
            best, cost = refine(best, ~domain.binary, many, plan.refine_budget)
    finally:
        history.save()
    return Found(best, cost, history.dataset(), history.known)


def run(searcher: Searcher, costs: Costs, budget: int) -> tuple[np.ndarray, float]:
    """Drive a searcher for as many whole generations as `budget` evaluations allow; the best vector and its cost."""
    done, tried = 0, []
    while done + len(candidates := searcher.ask()) <= budget:
        told = costs(candidates)
        searcher.tell(told)
        done += len(candidates)
        tried.append((candidates[np.argmin(told)], told.min()))
    return _least(tried)


def refine(start: np.ndarray, free: np.ndarray, costs: Costs, budget: int) -> tuple[np.ndarray, float]:
    """Downhill simplex from `start` over its `free` parameters; the best vector and its cost.

    The first simplex is long enough to leave the steps of a frequency: each edge is a tenth of the
    parameter and 0.1 of its unit.
    """
    from scipy.optimize import minimize

    tried = []

    def cost(x: np.ndarray) -> float:
        vector = start.copy()
        vector[free] = x
        tried.append((vector, costs(vector[None])[0]))
        return tried[-1][1]

    x = start[free]
    simplex = np.vstack([x, x + np.diag(0.1 * np.abs(x) + 0.1)])
    minimize(cost, x, method="Nelder-Mead", options={"maxfev": budget, "initial_simplex": simplex, "fatol": 1e-9})
    return _least(tried)


def _least(tried: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, float]:
    vector, cost = min(tried, key=lambda one: one[1])
    return vector, float(cost)
