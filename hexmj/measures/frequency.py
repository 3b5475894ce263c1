"""Frequencies of losses as tables, with their intervals and all that is needed to measure them again."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.controllers.protocol import Controller, settings_of
from hexmj.measures.velocities import velocity_axis
from hexmj.starts import SAMPLE
from hexmj.stats import wilson_intervals
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr


def settings(
    controllers: Mapping[str, Controller],
    observation_time: str | float,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
) -> dict[str, Any]:
    """All that is needed to run a measure again, as plain data; every result has it, see `attributes.settings`."""
    return {
        "controllers": {name: settings_of(one) for name, one in controllers.items()},
        "observation_time": observation_time,
        "starts": n_starts,
        "seed": seed,
        "stride": asdict(stride),
        "acceleration": asdict(acceleration) if acceleration else None,
    }


def losses_by_sample(lost: np.ndarray, first: int = 0) -> np.ndarray:
    """Number of losses in each sample of 1000 starts, (velocity, sample), from (velocity, start) of those from `first`
    on: the samples at both ends may have fewer."""
    begin = np.arange(-(first % SAMPLE), lost.shape[1], SAMPLE).clip(0)
    return np.add.reduceat(lost, begin, axis=1, dtype=int)


def frequency_table(losses: np.ndarray, n_starts: int, velocities: np.ndarray, duration: np.ndarray) -> "xr.Dataset":
    """FLSS with its intervals, from the number of losses in each sample of `n_starts` starts, (velocity, sample)."""
    import xarray as xr

    total = losses.sum(axis=1)
    low, high = wilson_intervals(total, n_starts)
    samples = losses[:, : n_starts // SAMPLE] / SAMPLE
    spread = samples.std(axis=1, ddof=1) if samples.shape[1] > 1 else np.full(len(total), np.nan)
    columns = {
        "flss": (total / n_starts, "frequency of the loss of static stability"),
        "low": (low, "lower end of the 95 % Wilson interval"),
        "high": (high, "upper end of the 95 % Wilson interval"),
        "sample_sd": (spread, "standard deviation over samples of 1000 starts"),
    }
    told = {name: ("velocity", values, {"units": "1", "long_name": text}) for name, (values, text) in columns.items()}
    return xr.Dataset(told).assign(velocity_axis(velocities, duration))


def over_start(columns: Mapping[str, np.ndarray], units: Mapping[str, str] = {}) -> "xr.Dataset":
    """A table of columns, (start,) each; those whose unit is not told are numbers."""
    import xarray as xr

    return xr.Dataset({name: ("start", values, {"units": units.get(name, "1")}) for name, values in columns.items()})
