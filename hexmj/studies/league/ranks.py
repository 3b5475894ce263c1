"""Ranks where intervals separate; everything else is a tie."""

import numpy as np

from hexmj.studies.league.frequencies import difference


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
