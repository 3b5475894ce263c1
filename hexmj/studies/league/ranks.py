"""Ranks where intervals separate; everything else is a tie."""

import numpy as np

from hexmj.intervals import paired_difference


def ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best and worst rank that each may have, (entrant,), from 1 on; equal only where intervals separate it from all.

    Args:
        values: of the same starts, (entrant, start), less is better; an entrant that is NaN throughout has no rank,
            which is 0.

    Returns:
        1 and how many are better for sure; the number of those that are ranked less how many are worse for sure.
    """
    ranked = np.isfinite(values).any(axis=1)
    best, worst = np.zeros(len(values), dtype=int), np.zeros(len(values), dtype=int)
    for i in np.flatnonzero(ranked):
        _, low, high = paired_difference(values[i], values[ranked])  # of itself the interval holds 0
        best[i], worst[i] = 1 + (low > 0).sum(), ranked.sum() - (high < 0).sum()
    return best, worst
