"""Which feet stand: those that the ground carried within the last `Numerics.contact_gap`."""

from typing import Any

import numpy as np
from numba import njit

from hexmj.conditions import Conditions


class StandingFeet:
    """Counts for every foot the physics steps since the ground last carried it."""

    def __init__(self, n_starts: int, conditions: Conditions, timestep: float) -> None:
        """All stand; physics steps last `timestep` [s]."""
        self._unloaded = np.zeros((n_starts, 6), dtype=int)
        self._longest_gap = conditions.numerics.contact_gap / 1000.0 / timestep

    def now(self, ids: np.ndarray) -> np.ndarray:
        """Which feet of some starts stand, (n, leg)."""
        return self._unloaded[ids] <= self._longest_gap

    def after(self, touches: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """Which feet of some starts stand after each of the next steps, from whether they touch, (n, step, leg)."""
        return _standing(touches, self._unloaded, ids, self._longest_gap)


@njit(cache=True, nogil=True)
def _standing(touches: Any, unloaded: Any, ids: Any, longest_gap: float) -> Any:
    """`StandingFeet.after`; `unloaded`, (start, leg), counts on."""
    standing = np.empty(touches.shape, dtype=np.bool_)
    for i, start in enumerate(ids):
        for t in range(touches.shape[1]):
            for leg in range(6):
                unloaded[start, leg] = 0 if touches[i, t, leg] else unloaded[start, leg] + 1
                standing[i, t, leg] = unloaded[start, leg] <= longest_gap
    return standing
