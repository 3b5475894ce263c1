"""Where a search begins, and how its real numbers are read as parameters."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Domain:
    """The box of the initial population, which a search may leave; binary parameters stay binary."""

    low: np.ndarray
    """(parameter,) least values, in the units of the parameters; below 1/2 where binary."""
    high: np.ndarray
    """(parameter,) greatest values; above 1/2 where binary."""
    binary: np.ndarray
    """(parameter,) whether the cost function takes only 0 or 1 there."""
    begin: np.ndarray | None = None
    """(parameter,) a set from which the search begins; each algorithm has a beginning of its own without it."""
    unit: np.ndarray | float = 1.0
    """(parameter,) what counts as 1 of each parameter where a step is told without a unit."""

    def read(self, individuals: np.ndarray) -> np.ndarray:
        """The parameters of individuals, both (..., parameter): a binary one is 1 where the number is above 1/2."""
        return np.where(self.binary, individuals > 0.5, individuals)

    def draw(self, size: int, rng: np.random.Generator) -> np.ndarray:
        """Individuals uniformly distributed over the box, (size, parameter)."""
        return rng.uniform(self.low, self.high, (size, len(self.low)))
