"""Ranks where intervals separate; everything else is a tie."""

import numpy as np

from hexmj.intervals import WILSON_Z


def difference(one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Mean difference of what happened to the same starts, each (start,) from 0 to 1, and its 95 % interval.

    As `intervals.paired_difference`, also for frequencies over several velocities; starts that are NaN are left out.
    """
    apart = (one - other)[np.isfinite(one - other)]
    size = len(apart)
    if size < 2:
        return np.nan, np.nan, np.nan
    middle = apart.sum() / (size + 2)
    half = WILSON_Z * np.sqrt((apart @ apart + 1) / (size + 2) - middle**2) / np.sqrt(size + 2)
    return apart.mean(), max(middle - half, -1.0), min(middle + half, 1.0)


def ranks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best and worst rank that each may have, (entrant,), from 1 on; equal only where intervals separate it from all.

    Args:
        values: of the same starts, (entrant, start), less is better; an entrant that is NaN throughout has no rank,
            which is 0.

    Returns:
        1 and how many are better for sure; the number of those that are ranked less how many are worse for sure.
    """
    ranked = np.isfinite(values).sum(axis=1) > 1
    best, worst = np.zeros(len(values), dtype=int), np.zeros(len(values), dtype=int)
    for i in np.flatnonzero(ranked):
        ends = [difference(values[i], values[j])[1:] for j in np.flatnonzero(ranked) if j != i]
        best[i] = 1 + sum(low > 0 for low, _ in ends)
        worst[i] = ranked.sum() - sum(high < 0 for _, high in ends)
    return best, worst
