"""CMA-ES with margin, which keeps binary parameters binary, behind the same ask and tell as the evolution."""

import cmaes
import numpy as np

from hexmj.search.domain import Domain

STEP = 0.5
"""Initial standard deviation, as a fraction of half the domain."""


class CovarianceAdaptation:
    """CMA-ES on the domain scaled to -1 ... 1 (binary: 0 ... 1).

    It begins in the middle or where the domain says, and somewhere else once it has converged.
    """

    def __init__(self, domain: Domain, population: int = 10, seed: int = 0) -> None:
        self._domain, self._population, self._rng = domain, population, np.random.default_rng([seed, 3])
        self._middle = np.where(domain.binary, 0.0, (domain.low + domain.high) / 2)
        self._half = np.where(domain.binary, 1.0, (domain.high - domain.low) / 2)
        self._begin((domain.low + domain.high) / 2 if domain.begin is None else domain.begin)

    def ask(self) -> np.ndarray:
        """The next generation's parameters, (candidate, parameter)."""
        asked = [self._cma.ask() for _ in range(self._population)]
        self._raw = [raw for _, raw in asked]
        return self._middle + self._half * np.array([encoded for encoded, _ in asked])

    def tell(self, costs: np.ndarray) -> None:
        """Adapt mean and covariance to the costs of what was asked, (candidate,)."""
        self._cma.tell(list(zip(self._raw, costs.tolist(), strict=True)))
        if self._cma.should_stop():
            self._begin(self._domain.draw(1, self._rng)[0])

    def _begin(self, mean: np.ndarray) -> None:
        binary = self._domain.binary
        self._cma = cmaes.CMAwM(
            mean=(mean - self._middle) / self._half,
            sigma=STEP,
            bounds=np.where(binary[:, None], (0.0, 1.0), (-np.inf, np.inf)),
            steps=binary.astype(float),
            population_size=self._population,
            seed=int(self._rng.integers(2**32)),
        )
