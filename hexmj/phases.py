"""Relative phases of legs (paper, Section 5.3): pairs of legs, means on the circle, and names of gaits.

The relative phase Phi_{j-k} is the time from an onset of leg j to the next onset of leg k, divided by the period.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hexmj.legs import MIRROR, N2

PAIRS: dict[str, tuple[int, int]] = {
    f"{j + 1}-{k + 1}": (j, k)
    for j, k in [(front, rear) for front, behind in enumerate(N2) for rear in behind] + list(enumerate(MIRROR[:3]))
}
"""Name j-k of each pair of neighbours in the paper -> indices of both legs; four ipsilateral, then three contralateral.

We take the paper's contralateral pairs (1-3), (2-4), (5-6) as a misprint of 1-4, 2-5, 3-6.
"""

IPSILATERAL, CONTRALATERAL = slice(0, 4), slice(4, 7)
"""Slices of the ipsilateral and of the contralateral pairs on an axis `pair`."""

NEAR = 0.05
"""Maximum difference of two phases that `classify` counts as equal."""

ROUNDING = 1e-12
"""Length of the mean vector of unit vectors below which they balance and have no mean direction."""

GaitName = Literal["tripod", "positive metachrony", "negative metachrony", "other"]


def circular_mean(phase: ArrayLike, axis: int | None = None) -> np.ndarray:
    """Return the mean of phases on the circle [0, 1), along an axis or of all; NaN if they have no mean direction."""
    angle = 2.0 * np.pi * np.asarray(phase)
    across, along = np.sin(angle).mean(axis), np.cos(angle).mean(axis)
    mean = np.arctan2(across, along) / (2.0 * np.pi)
    balance = np.hypot(across, along) < ROUNDING
    return np.where(balance, np.nan, mean % 1.0 % 1.0)[()]  # the first remainder of -1e-17 is 1.0


def circular_range(phase: ArrayLike) -> np.ndarray:
    """Return the length of the shortest arc of the circle [0, 1) with all phases of a row, (row, n) -> (row,)."""
    ordered = np.sort(np.asarray(phase) % 1.0, axis=1)
    return 1.0 - np.diff(ordered, axis=1, append=ordered[:, :1] + 1.0).max(axis=1)


def unrolled(phase: ArrayLike) -> np.ndarray:
    """Return phases, (n,), shifted by whole periods to near their circular mean: 0.02 becomes 1.02 if it is 0.98.

    NaN stays NaN; phases without a mean direction do not change.
    """
    phase = np.asarray(phase)
    known = phase[np.isfinite(phase)]
    middle = circular_mean(known) if len(known) else np.nan
    return phase + (phase < middle - 0.5) - (phase > middle + 0.5)


def wilson_phase(v: ArrayLike) -> np.ndarray:
    """Return the ipsilateral phase of Wilson's Gait II at velocity V, 1 / (1 + V).

    A leg begins protraction when the leg behind it ends protraction (zero delay), and the duration of protraction
    and the range of motion do not depend on velocity. So protraction takes V / (1 + V) of the period, and by this
    fraction each leg lags behind the leg to its rear.
    """
    return 1.0 / (1.0 + np.asarray(v))


def classify(phase_12: float, phase_23: float, contralateral: float) -> GaitName:
    """Return the name of a gait by its phases Phi_{1-2}, Phi_{2-3} and a contralateral phase, as in Section 5.3.

    'other': the contralateral phase differs from 0.5 by more than `NEAR`, or no other name fits. 'tripod': all phases
    are 0.5, within `NEAR`. 'positive metachrony': Phi_{1-2} and Phi_{2-3} are above 0.5; protraction runs from hind to
    front. 'negative metachrony': both are between 0 and 0.5; protraction runs from front to hind.
    """
    along = phase_12, phase_23
    if not abs(contralateral - 0.5) <= NEAR:
        return "other"
    if all(abs(phase - 0.5) <= NEAR for phase in along):
        return "tripod"
    if all(0.5 < phase < 1.0 for phase in along):
        return "positive metachrony"
    if all(0.0 < phase < 0.5 for phase in along):
        return "negative metachrony"
    return "other"
