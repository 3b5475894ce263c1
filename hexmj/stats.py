"""How sure a frequency is: 95 % intervals of counts, and of differences on the same starts."""

import math

import numpy as np
from numpy.typing import ArrayLike

WILSON_Z = 1.959963984540054
"""Standard normal quantile of 97.5 %."""


def wilson_interval(lost: int, size: int) -> tuple[float, float]:
    """The 95 % Wilson interval of a frequency, from `lost` losses in `size` starts."""
    z2, f = WILSON_Z**2, lost / size
    centre = f + z2 / (2 * size)
    half = math.sqrt(z2 * (f * (1 - f) / size + z2 / (4 * size**2)))
    low, high = (centre - half) / (1 + z2 / size), (centre + half) / (1 + z2 / size)
    return low if lost > 0 else 0.0, high if lost < size else 1.0


def wilson_intervals(lost: ArrayLike, size: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends for counts, (...), in `size` starts, one number or (...); NaN where there are no starts."""
    counts, sizes = np.broadcast_arrays(lost, size)
    pairs = zip(counts.flat, sizes.flat, strict=True)
    ends = [wilson_interval(int(n), int(of)) if of else (np.nan, np.nan) for n, of in pairs]
    low, high = np.array(ends).reshape(*counts.shape, 2).transpose(-1, *range(counts.ndim))
    return low, high


def paired_difference(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Difference of two frequencies on the same starts, `one` less `other`, and its 95 % interval.

    Args:
        one: whether it happened, (..., start), or in which part of several walks, 0 to 1; starts that are NaN here or
            there are left out.
        other: the same under another condition or measure.

    Returns:
        Difference, low and high, each (...); NaN where no start is left.  The interval is that of Agresti and Min
        (Statistics in Medicine 24, 2005): half a start is added to each of the four cells.
    """
    apart = np.subtract(one, other, dtype=float)
    known = np.isfinite(apart)
    size, total, squares = (np.where(known, value, 0.0).sum(axis=-1) for value in (1.0, apart, apart**2))
    middle = total / (size + 2)
    half = WILSON_Z * np.sqrt((squares + 1) / (size + 2) - middle**2) / np.sqrt(size + 2)
    with np.errstate(invalid="ignore"):
        nothing = 0.0 * size / size  # NaN without a start
        return total / size, np.maximum(middle - half, -1.0) + nothing, np.minimum(middle + half, 1.0) + nothing
