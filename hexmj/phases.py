"""Phases (paper, Section 5.3): the pairs of legs that have them, means on the circle, and gaits named by them.

The relative phase Phi_{j-k} is the time lag of leg k behind leg j, from onset to onset, divided by the period.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hexmj.legs import MIRROR, N2

PAIRS: dict[str, tuple[int, int]] = {
    f"{j + 1}-{k + 1}": (j, k)
    for j, k in [(front, rear) for front, behind in enumerate(N2) for rear in behind] + list(enumerate(MIRROR[:3]))
}
"""The paper's name j-k of each pair of neighbours -> their indices: four ipsilateral pairs, three contralateral.

The paper's contralateral pairs (1-3), (2-4), (5-6) are taken for a misprint of 1-4, 2-5, 3-6.
"""

IPSILATERAL, CONTRALATERAL = slice(0, 4), slice(4, 7)
"""The two kinds on an axis `pair`."""

NEAR = 0.05
"""Greatest difference of phases that count as equal when a gait is named."""

ROUNDING = 1e-12
"""Greatest length of the mean of directions that balance, as a fraction of the circle's radius."""

GaitName = Literal["tripod", "positive metachrony", "negative metachrony", "other"]


def circular_mean(phase: ArrayLike, axis: int | None = None) -> np.ndarray:
    """Return the mean direction of phases on the circle [0, 1), along an axis or of all; NaN where they balance."""
    angle = 2.0 * np.pi * np.asarray(phase)
    across, along = np.sin(angle).mean(axis), np.cos(angle).mean(axis)
    mean = np.arctan2(across, along) / (2.0 * np.pi)
    balance = np.hypot(across, along) < ROUNDING
    return np.where(balance, np.nan, mean % 1.0 % 1.0)[()]  # the first remainder of -1e-17 is 1.0


def circular_range(phase: ArrayLike) -> np.ndarray:
    """Return the shortest arc of the circle [0, 1) that holds all phases of a row, (row, n) -> (row,)."""
    ordered = np.sort(np.asarray(phase) % 1.0, axis=1)
    return 1.0 - np.diff(ordered, axis=1, append=ordered[:, :1] + 1.0).max(axis=1)


def unrolled(phase: ArrayLike) -> np.ndarray:
    """Return phases, (n,), near their mean direction on the circle: 0.02 becomes 1.02 among some around 0.98.

    NaN stays NaN; phases without a mean direction stay as they are.
    """
    phase = np.asarray(phase)
    known = phase[np.isfinite(phase)]
    middle = circular_mean(known) if len(known) else np.nan
    return phase + (phase < middle - 0.5) - (phase > middle + 0.5)


def wilson_phase(v: ArrayLike) -> np.ndarray:
    """Return the ipsilateral phase of Wilson's Gait II at velocity V, 1 / (1 + V).

    A front leg begins protraction when the leg behind it ends its own (zero delay), and the duration of protraction
    and the range of motion do not depend on velocity. So protraction takes V / (1 + V) of the period, and by this
    fraction the front leg lags behind.
    """
    return 1.0 / (1.0 + np.asarray(v))


def classify(phase_12: float, phase_23: float, contralateral: float) -> GaitName:
    """Name a gait by its phases, as Section 5.3 does.

    Neighbours across the body move in anti-phase, within `NEAR`, or the gait is 'other'. In a 'tripod' neighbours along
    the sides do so too. 'positive metachrony': Phi_{1-2} and Phi_{2-3} are above 0.5, and protraction runs from hind to
    front. 'negative metachrony': both are between 0 and 0.5, and protraction runs from front to hind.
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
