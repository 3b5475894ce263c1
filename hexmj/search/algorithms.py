"""Search algorithms: the paper's evolution (Section 4.1), CMA-ES with margin, and the downhill simplex.

An algorithm receives only parameter vectors and their costs. The paper numbers individuals from 1, arrays from 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SIGMA = 0.3
"""Mutation strength: individual i mutates with i times this standard deviation, in units of `Domain.unit`."""

STEP = 0.5
"""Initial standard deviation of CMA-ES, as a fraction of half the domain."""

Costs = Callable[[np.ndarray], np.ndarray]
"""Cost function: candidates, (candidate, parameter) -> their costs, (candidate,)."""


@dataclass(frozen=True, eq=False)
class Domain:
    """Box from which the initial population is drawn. The search may leave it; binary parameters stay binary."""

    low: np.ndarray
    """(parameter,) lower ends of the box, in the units of the parameters; below 1/2 for binary parameters."""
    high: np.ndarray
    """(parameter,) upper ends of the box; above 1/2 for binary parameters."""
    binary: np.ndarray
    """(parameter,) whether a parameter is binary: the cost function accepts only 0 and 1."""
    begin: np.ndarray | None = None
    """(parameter,) vector from which the search begins; None uses the default of the algorithm."""
    unit: np.ndarray | float = 1.0
    """(parameter,) scale of each parameter: mutations and simplex edges are proportional to it."""

    def read(self, individuals: np.ndarray) -> np.ndarray:
        """Return the parameters of individuals, (..., parameter): binary ones become 1 if above 1/2, else 0."""
        return np.where(self.binary, individuals > 0.5, individuals)

    def draw(self, size: int, rng: np.random.Generator) -> np.ndarray:
        """Draw `size` individuals uniformly from the box, (size, parameter)."""
        return rng.uniform(self.low, self.high, (size, len(self.low)))


class Evolution:
    """The paper's evolutionary algorithm: selection against individual 1, then mutation.

    The paper leaves two choices open. Here an individual stores a binary parameter as a real number, which mutates like
    all numbers and is rounded by `Domain.read`. Individual 1 of the initial population is the '0'-individual (zeros).
    """

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        """Form the population Q^0: `Domain.begin` or else zeros, and `population` - 1 individuals from the domain."""
        self._domain, self._rng = domain, np.random.default_rng([seed, 2])
        self.individuals = domain.draw(population, self._rng)
        """Population Q^n, (individual, parameter), before binary parameters are rounded."""
        self.individuals[0] = 0.0 if domain.begin is None else domain.begin
        self._known_costs = np.empty(0)

    def ask(self) -> np.ndarray:
        """Return the individuals whose costs are unknown, (candidate, parameter); after Q^0 all except individual 1."""
        return self._domain.read(self.individuals[len(self._known_costs) :])

    def tell(self, costs: np.ndarray) -> None:
        """Form the population Q^{n+1} from the costs, (candidate,), of the individuals that `ask` returned."""
        costs = np.concatenate([self._known_costs, costs])
        fittest = np.argmin(costs)
        copies = self._rng.choice(len(costs), len(costs) - 1, p=selection_probabilities(costs))
        self.individuals = mutated(self.individuals[[fittest, *copies]], self._rng, self._domain.unit)
        self._known_costs = costs[[fittest]]


def selection_probabilities(costs: np.ndarray) -> np.ndarray:
    """Return P(q_j), the probability of copying each individual, (individual,), by its advantage over individual 1."""
    advantage = np.maximum(costs[0] - costs, 0.0)
    if not advantage.any():
        return np.eye(len(costs))[0]  # K = 0 in Section 4.1.1: only individual 1 is copied
    advantage /= advantage.max()
    return advantage / advantage.sum()


def mutated(individuals: np.ndarray, rng: np.random.Generator, unit: np.ndarray | float = 1.0) -> np.ndarray:
    """Add normal random numbers of standard deviation 0.3 i to individuals i = 2 ... L (Section 4.1.2)."""
    sigma = SIGMA * np.arange(1, len(individuals) + 1)[:, None]
    sigma[0] = 0.0
    return individuals + unit * sigma * rng.standard_normal(individuals.shape)


class CovarianceAdaptation:
    """CMA-ES with margin, in coordinates that scale the domain to -1 ... 1 (binary parameters: 0 ... 1).

    The search begins at `Domain.begin`, or else in the middle of the domain, and restarts at random when it converges.
    """

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        self._domain, self._population, self._rng = domain, population, np.random.default_rng([seed, 3])
        self._middle = np.where(domain.binary, 0.0, (domain.low + domain.high) / 2)
        self._half = np.where(domain.binary, 1.0, (domain.high - domain.low) / 2)
        self._start((domain.low + domain.high) / 2 if domain.begin is None else domain.begin)

    def ask(self) -> np.ndarray:
        """Return the next generation of candidates, (candidate, parameter)."""
        asked = [self._cma.ask() for _ in range(self._population)]
        self._raw = [raw for _, raw in asked]
        return self._middle + self._half * np.array([encoded for encoded, _ in asked])

    def tell(self, costs: np.ndarray) -> None:
        """Adapt mean and covariance to the costs, (candidate,), of the candidates that `ask` returned."""
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
    """Evaluate as many generations as the budget allows; return the best vector, (parameter,), and its cost."""
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
    """Search with the downhill simplex from the vector `start`, (parameter,), over the parameters with `free` True.

    Each edge of the first simplex is a tenth of the parameter plus a tenth of its `unit`, so that costs differ between
    corners although FLSS changes in steps. The search stops at edges of about 1e-4 and equal costs, or at `budget`.

    Returns:
        The best vector, (parameter,), and its cost.
    """
    from scipy.optimize import minimize

    tried = []
    scale = np.ldexp(1.0, np.frexp(np.broadcast_to(unit, start.shape))[1] - 1)[free]  # powers of 2 divide exactly

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
