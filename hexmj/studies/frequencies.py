"""How often something happened to starts, and how much more often than to others of the same starts."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.stats import paired_difference, wilson_intervals

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
    """As `frequency`, and how many `_starts` it is of."""
    starts = np.isfinite(happened).sum(axis=-1)
    return frequency(name, happened, dims) | {f"{name}_starts": (dims, starts, {"units": "1"})}


def frequency(name: str, happened: np.ndarray, dims: tuple[str, ...]) -> dict[str, Any]:
    """The frequency `name` over the starts, (..., start), and its 95 % Wilson interval `_low`, `_high`; NaN where there
    are none."""
    starts, count = np.isfinite(happened).sum(axis=-1), np.nansum(happened, axis=-1)
    with np.errstate(invalid="ignore"):
        return columns(name, dims, count / starts, *wilson_intervals(count, starts))


def differences(name: str, happened: np.ndarray, other: np.ndarray, dims: tuple[str, ...]) -> dict[str, Any]:
    """How far the frequency, from (..., start), is above that of another on the same starts, which broadcasts to it:
    `name`, with its 95 % interval `_low`, `_high`."""
    return columns(name, dims, *paired_difference(happened, np.broadcast_to(other, happened.shape)))


def columns(name: str, dims: tuple[str, ...], *values: np.ndarray) -> dict[str, Any]:
    """A number `name`, and the ends of its interval `_low`, `_high`, as variables over `dims`."""
    ends = zip(("", "_low", "_high"), values, strict=True)
    return {f"{name}{end}": (dims, one, {"units": "1"}) for end, one in ends}
