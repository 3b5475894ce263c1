"""Algorithms of a search: the paper's evolution (Section 4.1), CMA-ES with margin, and the downhill simplex.

Each sees vectors and their costs only. The paper counts individuals from 1, the arrays here from 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SIGMA = 0.3
"""The mutation of individual i has i times this standard deviation, in units of `Domain.unit`."""

STEP = 0.5
"""Initial standard deviation of CMA-ES, as a fraction of half the domain."""

Costs = Callable[[np.ndarray], np.ndarray]
"""(candidate, parameter) -> (candidate,)."""


@dataclass(frozen=True, eq=False)
class Domain:
    """The box of the initial population. A search may leave it; binary parameters stay binary."""

    low: np.ndarray
    """(parameter,) least values, in the units of the parameters; below 1/2 if binary."""
    high: np.ndarray
    """(parameter,) greatest values; above 1/2 if binary."""
    binary: np.ndarray
    """(parameter,) whether the cost function takes only 0 or 1."""
    begin: np.ndarray | None = None
    """(parameter,) vector from which the search begins; by default each algorithm has its own."""
    unit: np.ndarray | float = 1.0
    """(parameter,) unit of each parameter, in which steps are measured."""

    def read(self, individuals: np.ndarray) -> np.ndarray:
        """Return the parameters of individuals, both (..., parameter): a binary one is 1 if its number exceeds 1/2."""
        return np.where(self.binary, individuals > 0.5, individuals)

    def draw(self, size: int, rng: np.random.Generator) -> np.ndarray:
        """Draw individuals, (size, parameter), uniformly from the box."""
        return rng.uniform(self.low, self.high, (size, len(self.low)))


class Evolution:
    """The paper's evolutionary algorithm: selection against individual 1, then mutation.

    Two choices that the paper leaves open: an individual holds a real number for a binary parameter too, which is
    mutated like the others and rounded by `Domain.read`; individual 1 of the initial population is the '0'-individual.
    """

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        """Form Q^0: the '0'-individual or `Domain.begin`, and `population` - 1 individuals drawn from the domain."""
        self._domain, self._rng = domain, np.random.default_rng([seed, 2])
        self.individuals = domain.draw(population, self._rng)
        """Q^n, (individual, parameter), before binary parameters are rounded."""
        self.individuals[0] = 0.0 if domain.begin is None else domain.begin
        self._known = np.empty(0)

    def ask(self) -> np.ndarray:
        """Return the individuals of unknown cost, (candidate, parameter): after Q^0 all but individual 1."""
        return self._domain.read(self.individuals[len(self._known) :])

    def tell(self, costs: np.ndarray) -> None:
        """Form Q^{n+1} from the costs, (candidate,), of what `ask` returned."""
        costs = np.concatenate([self._known, costs])
        fittest = np.argmin(costs)
        others = self._rng.choice(len(costs), len(costs) - 1, p=selection_probabilities(costs))
        self.individuals = mutated(self.individuals[[fittest, *others]], self._rng, self._domain.unit)
        self._known = costs[[fittest]]


def selection_probabilities(costs: np.ndarray) -> np.ndarray:
    """Return P(q_j) of each individual, (individual,) (Section 4.1.1); if K = 0 only individual 1 is copied."""
    advantage = np.maximum(costs[0] - costs, 0.0)
    if not advantage.any():
        return np.eye(len(costs))[0]
    advantage /= advantage.max()
    return advantage / advantage.sum()


def mutated(individuals: np.ndarray, rng: np.random.Generator, unit: np.ndarray | float = 1.0) -> np.ndarray:
    """Add to individual i = 2 ... L normal numbers of standard deviation 0.3 i (Section 4.1.2)."""
    sigma = SIGMA * np.arange(1, len(individuals) + 1)[:, None]
    sigma[0] = 0.0
    return individuals + unit * sigma * rng.standard_normal(individuals.shape)


class CovarianceAdaptation:
    """CMA-ES with margin, on the domain scaled to -1 ... 1 (binary parameters: 0 ... 1).

    It begins in the middle of the domain or at `Domain.begin`, and restarts from a random vector when it has converged.
    """

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        self._domain, self._population, self._rng = domain, population, np.random.default_rng([seed, 3])
        self._middle = np.where(domain.binary, 0.0, (domain.low + domain.high) / 2)
        self._half = np.where(domain.binary, 1.0, (domain.high - domain.low) / 2)
        self._start((domain.low + domain.high) / 2 if domain.begin is None else domain.begin)

    def ask(self) -> np.ndarray:
        """Return the next generation, (candidate, parameter)."""
        asked = [self._cma.ask() for _ in range(self._population)]
        self._raw = [raw for _, raw in asked]
        return self._middle + self._half * np.array([encoded for encoded, _ in asked])

    def tell(self, costs: np.ndarray) -> None:
        """Adapt mean and covariance to the costs, (candidate,), of what `ask` returned."""
        self._cma.tell(list(zip(self._raw, costs.tolist(), strict=True)))
        if self._cma.should_stop():
            self._start(self._domain.draw(1, self._rng)[0])

    def _start(self, mean: np.ndarray) -> None:
        import cmaes

        binary = self._domain.binary
        self._cma = cmaes.CMAwM(
            mean=(mean - self._middle) / self._half,
            sigma=STEP,
            bounds=np.where(binary[:, None], (0.0, 1.0), (-np.inf, np.inf)),
            steps=binary.astype(float),
            population_size=self._population,
            seed=int(self._rng.integers(2**32)),
        )


def search_population(
    searcher: Evolution | CovarianceAdaptation, costs: Costs, budget: int
) -> tuple[np.ndarray, float]:
    """Run the whole generations that `budget` evaluations allow; return the best vector, (parameter,), and its cost."""
    done, tried = 0, []
    while done + len(candidates := searcher.ask()) <= budget:
        values = costs(candidates)
        searcher.tell(values)
        done += len(candidates)
        tried.append((candidates[np.argmin(values)], values.min()))
    return _best(tried)


def refine(
    start: np.ndarray, free: np.ndarray, costs: Costs, budget: int, unit: np.ndarray | float = 1.0
) -> tuple[np.ndarray, float]:
    """Search with the downhill simplex from `start` over its `free` parameters, (parameter,) each.

    The first simplex is larger than the steps of a frequency: each edge is a tenth of the parameter plus a tenth of its
    `unit`. The corners of the last simplex are within about 1e-4 and have the same cost.

    Returns:
        The best vector, (parameter,), and its cost.
    """
    from scipy.optimize import minimize

    tried = []
    scale = np.ldexp(1.0, np.frexp(np.broadcast_to(unit, start.shape))[1] - 1)[free]  # powers of 2 are exact

    def cost(x: np.ndarray) -> float:
        vector = start.copy()
        vector[free] = x * scale
        tried.append((vector, costs(vector[None])[0]))
        return tried[-1][1]

    x, edge = start[free], (0.1 * np.abs(start) + 0.1 * unit)[free]
    options = {"maxfev": budget, "initial_simplex": np.vstack([x, x + np.diag(edge)]) / scale}
    minimize(cost, x / scale, method="Nelder-Mead", options=options | {"xatol": 1e-4, "fatol": 1e-9})
    return _best(tried)


def _best(tried: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, float]:
    vector, cost = min(tried, key=lambda pair: pair[1])
    return vector, float(cost)
