"""The paper's evolutionary algorithm (Section 4.1): selection against individual 1, then mutation.

Individuals are numbered from 1 in the paper and from 0 in the arrays.  Where the paper is silent: the
individual holds a real number for a binary parameter too, which is mutated like every other and read as
the nearer of 0 and 1 (`Domain.read`); the '0'-individual is individual 1 of the initial population.
"""

import numpy as np

from hexmj.search.domain import Domain

SIGMA = 0.3
"""Standard deviation of the mutation of individual i is i times this, in units of `Domain.unit`."""


class Evolution:
    """Q^n, the population of the n-th generation, behind ask and tell."""

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        """Q^0: the '0'-individual or the domain's `begin`, and `population` - 1 individuals drawn over the domain."""
        self._domain, self._rng = domain, np.random.default_rng([seed, 2])
        self.individuals = domain.draw(population, self._rng)
        """(individual, parameter) before binary parameters are read."""
        self.individuals[0] = 0.0 if domain.begin is None else domain.begin
        self._known = np.empty(0)

    def ask(self) -> np.ndarray:
        """Parameters whose cost is not yet known, (candidate, parameter): all but individual 1's after Q^0."""
        return self._domain.read(self.individuals[len(self._known) :])

    def tell(self, costs: np.ndarray) -> None:
        """Form Q^{n+1} from the costs of what was asked, (candidate,)."""
        costs = np.concatenate([self._known, costs])
        fittest = np.argmin(costs)
        others = self._rng.choice(len(costs), len(costs) - 1, p=selection_probabilities(costs))
        self.individuals = mutated(self.individuals[[fittest, *others]], self._rng, self._domain.unit)
        self._known = costs[[fittest]]


def selection_probabilities(costs: np.ndarray) -> np.ndarray:
    """P(q_j) of Section 4.1.1 for each individual, (individual,); with K = 0 only individual 1 is copied."""
    advantage = np.maximum(costs[0] - costs, 0.0)
    if not advantage.any():
        return np.eye(len(costs))[0]
    advantage /= advantage.max()
    return advantage / advantage.sum()


def mutated(individuals: np.ndarray, rng: np.random.Generator, unit: np.ndarray | float = 1.0) -> np.ndarray:
    """Individual i = 2 ... L with a normal component of standard deviation 0.3 i on every number (Section 4.1.2)."""
    sigma = SIGMA * np.arange(1, len(individuals) + 1)[:, None]
    sigma[0] = 0.0
    return individuals + unit * sigma * rng.standard_normal(individuals.shape)
