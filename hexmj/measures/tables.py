"""Settings of walks, and parts of result tables: axes, frequencies with 95 % intervals, recorded settings."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.errors import InputError
from hexmj.starts import checked_list, draw_starts
from hexmj.stats import wilson_intervals
from hexmj.timing import Acceleration, Stride, check_reached, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

VELOCITY = {"units": "V_p", "long_name": "velocity V_r"}
"""Attributes of the coordinate `velocity`."""

Measure = Literal["kinematic", "dynamic", "physical"]
"""What counts as a loss: static (kinematic) or dynamic stability of the plan, or a fall of the body (physical)."""

Dims = tuple[str, ...]


@dataclass(frozen=True)
class WalkSettings:
    """Settings of walks from random starts, which together are one cell of a study."""

    controller: Controller
    velocity: float
    """Velocity V_r as a fraction of V_p; the final velocity when accelerating."""
    duration: float
    """Observation time [time units]."""
    n_starts: int
    seed: int
    conditions: Conditions
    stride: Stride
    acceleration: Acceleration | None = None

    @property
    def starts(self) -> np.ndarray:
        """Tips at time 0, (start, leg) [mm]."""
        return draw_starts(self.n_starts, self.seed, self.stride)

    @property
    def work(self) -> float:
        """Relative computing time of the walks; losses and falls end more of the fast walks early."""
        return self.duration * (1.0 - self.velocity) * self.n_starts


def observed(
    velocities: Sequence[float] | float,
    observation_time: str | float,
    stride: Stride,
    acceleration: Acceleration | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocities V_r and their observation times [time units], both (velocity,), after a check.

    Raises:
        InputError: a velocity is out of range, occurs twice or is not reached within its time, or a time is too short.
    """
    v = checked_list(np.atleast_1d(velocities).tolist(), acceleration)
    check_reached(v, stride, acceleration)
    duration = observation_duration(observation_time, v, stride, acceleration)
    if acceleration and (late := np.flatnonzero(duration < acceleration.duration(v) * (1.0 - 1e-9))).size:
        reached = f"V = {v[late[0]]:g} is reached after {acceleration.duration(v[late[0]]):g} time units"
        raise InputError(f"{reached}, but the walk ends after {duration[late[0]]:g}; increase the observation time")
    steps_within(duration, stride)
    return v, duration


def velocity_axis(v: np.ndarray, duration: np.ndarray) -> dict[str, Any]:
    """Return the coordinates `velocity` and `duration` for velocities and their observation times, both (velocity,)."""
    return {
        "velocity": ("velocity", v, VELOCITY),
        "duration": ("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
    }


def settings(
    controllers: Mapping[str, Controller],
    observation_time: str | float,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
) -> dict[str, Any]:
    """Return the settings from which a measurement can be repeated as plain data; every result records them."""
    return {
        "controllers": {name: settings_of(controller) for name, controller in controllers.items()},
        "observation_time": observation_time,
        "starts": n_starts,
        "seed": seed,
        "stride": asdict(stride),
        "acceleration": asdict(acceleration) if acceleration else None,
    }


def over_start(columns: Mapping[str, np.ndarray], units: Mapping[str, str] = {}) -> "xr.Dataset":
    """Return columns, each (start,), as a dataset over start; a column that is missing in `units` is a plain number."""
    import xarray as xr

    return xr.Dataset({name: ("start", values, {"units": units.get(name, "1")}) for name, values in columns.items()})


def happened(time: "xr.DataArray") -> "xr.DataArray":
    """Return 1 where an event has a finite time, 0 where its time is inf, and NaN where its walk failed."""
    return (time < np.inf).where(time.notnull())


def frequency(name: str, events: np.ndarray, dims: Dims) -> dict[str, Any]:
    """Return the frequency of an event with its 95 % Wilson interval, as variables of a dataset.

    Args:
        name: name of the frequency; the ends of its interval are `name_low` and `name_high`.
        events: 1 for starts with the event and 0 without, (..., start); starts with NaN are left out.
        dims: names of the axes before `start`.
    """
    starts, count = np.isfinite(events).sum(axis=-1), np.nansum(events, axis=-1)
    with np.errstate(invalid="ignore"):
        return columns(name, dims, count / starts, *wilson_intervals(count, starts))


def frequencies(name: str, events: np.ndarray, dims: Dims) -> dict[str, Any]:
    """Return the variables of `frequency`, and `name_starts`, the number of starts without NaN."""
    starts = np.isfinite(events).sum(axis=-1)
    return frequency(name, events, dims) | {f"{name}_starts": (dims, starts, {"units": "1"})}


def columns(name: str, dims: Dims, *values: np.ndarray) -> dict[str, Any]:
    """Return up to three arrays, a value and the ends of its interval, as variables `name`, `name_low`, `name_high`."""
    ends = zip(("", "_low", "_high"), values, strict=True)
    return {f"{name}{end}": (dims, number, {"units": "1"}) for end, number in ends}
