"""How often something happened to starts, and how much more often than to others of the same starts."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.intervals import WILSON_Z, wilson_intervals

if TYPE_CHECKING:
    import xarray as xr


def came(time: "xr.DataArray") -> "xr.DataArray":
    """Whether a time came, 1 or 0; NaN where the walk was refused."""
    return (time < np.inf).where(time.notnull())


def padded(rows: Sequence[Sequence[Any]]) -> np.ndarray:
    """What happened to each start, 0 or 1, as one array (row, column, start); NaN beyond the starts that there are."""
    found = [[np.asarray(one, dtype=float) for one in row] for row in rows]
    whole = np.full((len(found), len(found[0]), max(len(one) for row in found for one in row)), np.nan)
    for i, row in enumerate(found):
        for j, one in enumerate(row):
            whole[i, j, : len(one)] = one
    return whole


def frequencies(name: str, happened: np.ndarray, dims: tuple[str, ...]) -> dict[str, Any]:
    """The frequency `name` over the starts, (..., start), its 95 % Wilson interval `_low`, `_high`, and how many
    `_starts`; NaN where there are none."""
    starts, count = np.isfinite(happened).sum(axis=-1), np.nansum(happened, axis=-1)
    with np.errstate(invalid="ignore"):
        columns = {"": count / starts}
    columns |= dict(zip(("_low", "_high"), wilson_intervals(count, starts), strict=True)) | {"_starts": starts}
    return {name + end: (dims, column, {"units": "1"}) for end, column in columns.items()}


def differences(name: str, happened: np.ndarray, other: np.ndarray, dims: tuple[str, ...]) -> dict[str, Any]:
    """How far the frequency is above another of the same starts, `name`, with its 95 % interval `_low`, `_high`.

    Args:
        name: of the difference.
        happened: (..., start).
        other: what broadcasts to it.
        dims: of the frequency.
    """
    starts = happened.shape[-1]
    pairs = (one.reshape(-1, starts) for one in (happened, np.broadcast_to(other, happened.shape)))
    ends = np.array([difference(*pair) for pair in zip(*pairs, strict=True)]).reshape(*happened.shape[:-1], 3)
    return {f"{name}{end}": (dims, ends[..., i], {"units": "1"}) for i, end in enumerate(("", "_low", "_high"))}


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
