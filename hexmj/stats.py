"""Uncertainty of frequencies: 95 % intervals of a frequency, and of the difference of two on the same starts."""

import math

import numpy as np
from numpy.typing import ArrayLike

WILSON_Z = 1.959963984540054
"""Standard normal quantile of 97.5 %."""


def wilson_interval(lost: int, size: int) -> tuple[float, float]:
    """Return both ends of the 95 % Wilson interval of a frequency of `lost` losses in `size` starts."""
    z2, f = WILSON_Z**2, lost / size
    centre = f + z2 / (2 * size)
    half = math.sqrt(z2 * (f * (1 - f) / size + z2 / (4 * size**2)))
    low, high = (centre - half) / (1 + z2 / size), (centre + half) / (1 + z2 / size)
    return low if lost > 0 else 0.0, high if lost < size else 1.0


def wilson_intervals(lost: ArrayLike, size: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of Wilson intervals, both (...), of `lost` losses, (...), in `size` starts; NaN if that is 0."""
    counts, sizes = np.broadcast_arrays(lost, size)
    pairs = zip(counts.flat, sizes.flat, strict=True)
    ends = [wilson_interval(int(count), int(n)) if n else (np.nan, np.nan) for count, n in pairs]
    low, high = np.array(ends).reshape(*counts.shape, 2).transpose(-1, *range(counts.ndim))
    return low, high


def paired_difference(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the frequency of `first` minus that of `second` on the same starts, with its 95 % interval.

    Args:
        first: whether an event happened to each start, (..., start), 0 or 1, or in which fraction of several walks. A
            start with NaN in `first` or `second` is left out.
        second: the same under another condition or measure.

    Returns:
        Difference, lower and upper end of its interval, each (...); NaN if no start is left. The interval is that of
        Agresti and Min (Statistics in Medicine 24, 2005), which adds half a start to each of the four outcomes.
    """
    apart = np.subtract(first, second, dtype=float)
    known = np.isfinite(apart)
    size, total, squares = (np.where(known, value, 0.0).sum(axis=-1) for value in (1.0, apart, apart**2))
    middle = total / (size + 2)  # centre of the interval
    half = WILSON_Z * np.sqrt((squares + 1) / (size + 2) - middle**2) / np.sqrt(size + 2)
    with np.errstate(invalid="ignore"):
        no_start = 0.0 * size / size  # NaN if no start is left, else 0
        return total / size, np.maximum(middle - half, -1.0) + no_start, np.minimum(middle + half, 1.0) + no_start
