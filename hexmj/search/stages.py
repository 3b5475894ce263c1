"""A search in two stages (paper, Section 4): a population on few starts, then the downhill simplex on many."""

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import load_controller
from hexmj.errors import without_extra
from hexmj.plain import plain
from hexmj.progress import Progress, part_of, shown
from hexmj.search.algorithms import Costs, CovarianceAdaptation, Evolution, refine, search_population
from hexmj.search.problems import REFUSED, Problem, Sample
from hexmj.starts import SAMPLE, check_draw
from hexmj.sweep import Cell
from hexmj.validate import choice, whole

if TYPE_CHECKING:
    import xarray as xr

STAGES: tuple[str, ...] = ("population", "simplex")  # of a search, in this order


@dataclass(frozen=True)
class Effort:
    """Algorithm, budgets and starts of a search."""

    algorithm: Literal["evolution", "cmaes"] = "evolution"
    """Algorithm of the population: the paper's evolution, or CMA-ES."""
    population: int = 10
    """Number of individuals in a generation, the paper's L."""
    domain: float = 10.0
    """Range D of the initial population, which the paper does not print: shifts [mm] and weights from 0 to D, neutral
    positions [mm] from -D to D. Fields of another controller: from 0 to D times the default, or to D if the default is
    0."""
    begin: str | Controller | None = None
    """Controller from which the population begins. Default: all weights 0, the paper's '0'-individual (evolution); the
    middle of the domain (cmaes); or, for a controller of your own, its default field values."""
    starts: int | None = None
    """Number of random starts on which every candidate walks; by default 500, or 50 in physical walks."""
    budget: int = 1000
    """Maximum number of evaluations by the population; 1000 are about the paper's 100 iterations with L = 10."""
    refine_starts: int | None = None
    """Number of random starts for the simplex; by default 7000, or 100 in physical walks."""
    refine_budget: int = 400
    """Maximum number of evaluations by the simplex; 0 omits the simplex."""
    seed: int = 0
    """Seed of the starts, of their velocities and of the algorithm."""
    verdict_starts: int | None = None
    """Number of fresh random starts for the final FLSS; by default 7000, or 200 in physical walks."""
    verdict_seed: int = 1998
    """Seed of the fresh starts; it must differ from the seed of the search."""

    def __post_init__(self) -> None:
        if choice("algorithm", self.algorithm, ("evolution", "cmaes")) == "cmaes" and find_spec("cmaes") is None:
            raise without_extra("search", "cmaes, which the algorithm 'cmaes' needs,")
        whole("population", self.population, 4 if self.algorithm == "cmaes" else 2)
        for name in ("starts", "refine_starts", "verdict_starts"):
            if (size := getattr(self, name)) is not None:
                check_draw(size, self.seed, name)
        whole("budget", self.budget, self.population)
        whole("refine_budget", self.refine_budget, 0)
        check_draw(1, self.seed)
        check_draw(1, self.verdict_seed, seed_name="verdict_seed")

    def completed(self, physical: bool) -> "Effort":
        """Return the effort with the default numbers of starts in place of None."""
        sizes = {"starts": (500, 50), "refine_starts": (7 * SAMPLE, 100), "verdict_starts": (7 * SAMPLE, 200)}
        return replace(self, **{name: both[physical] for name, both in sizes.items() if getattr(self, name) is None})

    @property
    def beginning(self) -> Controller | None:
        """The controller `begin`, loaded if it is a name; None without one."""
        return load_controller(self.begin) if isinstance(self.begin, str) else self.begin


@dataclass(frozen=True, eq=False)
class Found:
    """The outcome of a search."""

    vector: np.ndarray
    """(parameter,) candidate with the lowest cost in the last stage."""
    cost: float
    """Cost of `vector` on the starts of the last stage, see `Problem.minimised`."""
    starts: int
    """Number of starts of the last stage."""
    history: "xr.Dataset"
    """All candidates and their costs, see the function `history`."""

    def report(self, problem: Problem) -> list[str]:
        """Return lines for printing: evaluations, lowest cost, and candidates that cost 1."""
        least = f"lowest cost {self.cost:.4g}" + (f" ({problem.minimised})" if problem.ties == "later" else "")
        lines = [f"{len(self.history.cost)} evaluations; {least}"]
        if lost := int((self.history.cost.values >= REFUSED).sum()):
            lines.append(f"evaluations that cost 1: {lost}; all starts lost stability, or the candidate cannot walk")
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
    """Search with a population, then refine the best candidate with the simplex, except its binary parameters.

    Args:
        problem: the cost function.
        effort: algorithm, budgets and starts.
        folder: directory that caches every evaluation, so that an interrupted search resumes with equal results.
        threads: number of threads, by default one per core; the result does not depend on it.
        progress: True shows a bar; a function receives the fraction of the work since its last call.
        fresh: whether to discard the cached evaluations of this search.

    Raises:
        InputError: a setting is invalid, or the best candidate cannot walk.
        SimulationError: the body does not settle at a start, or the simulation of the best candidate fails.
    """
    effort = effort.completed(physical=problem.physical)
    domain = problem.domain(effort.domain, effort.beginning)
    sizes = {
        "population": (effort.starts or 0, effort.budget),
        "simplex": (effort.refine_starts or 0, effort.refine_budget),
    }
    work = sum(n_starts * budget for n_starts, budget in sizes.values())
    stages, costs = list[Stage](), dict[str, Costs]()
    with shown(progress, "searching") as advance:
        for name, (n_starts, budget) in sizes.items():
            if budget:
                stages.append(Stage(name, Sample(problem, n_starts, effort.seed), folder, fresh))
                stages[-1].sample.settle(threads)
                evaluated = part_of(advance, n_starts / work)
                costs[name] = partial(stages[-1].costs, threads=threads, progress=evaluated)
                if evaluated and stages[-1].known:
                    evaluated(min(len(stages[-1].known), budget))
        algorithm = Evolution if effort.algorithm == "evolution" else CovarianceAdaptation
        searcher = algorithm(domain, effort.population, effort.seed)
        best, cost = search_population(searcher, costs["population"], effort.budget)
        if effort.refine_budget:
            best, cost = refine(best, ~domain.binary, costs["simplex"], effort.refine_budget, domain.unit)
    last = stages[-1].sample
    if cost >= REFUSED:
        last.check_walks(best, threads)
    course = history([one for stage in stages for one in stage.evaluated], problem.form.names, problem.minimised)
    settings = json.dumps({"problem": problem.settings(), "effort": plain(effort)}, sort_keys=True)
    return Found(best, cost, last.n_starts, course.assign_attrs(settings=settings))


class Stage:
    """The evaluations of a stage. Each cost is cached as a line of a text file, so that a stopped search resumes.

    A line is a JSON list of the parameters and the cost. An incomplete line, left by a killed process, is ignored.
    """

    def __init__(self, name: str, sample: Sample, folder: Path | str | None, fresh: bool) -> None:
        """Read the costs that are cached in the folder, or discard them if `fresh`; None caches nothing."""
        self.name, self.sample, self._path = name, sample, None
        self.known: dict[tuple[float, ...], float] = {}
        """Parameters -> cost."""
        self.evaluated = list[Evaluated]()
        """All evaluations of this run, in order."""
        if folder is None:
            return
        cell = Cell(name, sample.costs, {})
        self._path = Path(folder) / f"{cell.stem(cell.record())}.txt"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        if fresh:
            self._path.unlink(missing_ok=True)
        for line in self._path.read_text().splitlines() if self._path.exists() else ():
            with suppress(ValueError):
                *parameters, cost = json.loads(line)
                self.known[tuple(parameters)] = cost

    def costs(self, candidates: np.ndarray, threads: int | None = None, progress: Progress | None = None) -> np.ndarray:
        """Return the costs, (candidate,), of candidates, (candidate, parameter); only new candidates walk.

        `progress` is called with the number of new candidates that have walked.
        """
        rows = [tuple(candidate) for candidate in candidates.tolist()]
        new = [row for row in dict.fromkeys(rows) if row not in self.known]
        size = 1 if self.sample.problem.physical else len(rows)  # physical walks are slow: cache each cost at once
        for i in range(0, len(new), size):
            part = new[i : i + size]
            self.known |= zip(part, self.sample.costs(np.array(part), threads).tolist(), strict=True)
            if self._path:
                with self._path.open("a") as file:
                    file.writelines(f"\n{json.dumps([*row, self.known[row]])}\n" for row in part)
            if progress:
                progress(len(part))
        costs = np.array([self.known[row] for row in rows])
        self.evaluated.append((self.name, candidates.copy(), costs))
        return costs


Evaluated = tuple[str, np.ndarray, np.ndarray]
"""Name of a stage, candidates evaluated together, (candidate, parameter), and their costs, (candidate,)."""


def history(evaluated: Sequence[Evaluated], names: Sequence[str], minimised: str) -> "xr.Dataset":
    """Return stage, candidate, cost and the stage's lowest cost so far for every evaluation, in order from 0.

    `names` are the names of the parameters, and `minimised` describes the cost, see `Problem.minimised`.
    """
    import pandas as pd
    import xarray as xr

    stages, candidates, costs = zip(*evaluated, strict=True)
    stage, cost = np.repeat([STAGES.index(name) for name in stages], [*map(len, costs)]), np.concatenate(costs)
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
