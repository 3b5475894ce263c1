"""The axis of velocities that tables lie along, with the observation time of each."""

from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np

from hexmj.starts import checked_list
from hexmj.timing import Acceleration, Stride, check_in_time, check_reached, observation_duration, steps_within

VELOCITY = {"units": "V_p", "long_name": "velocity V_r"}
"""Attributes of an axis of velocities."""


def several(velocities: Sequence[float] | float) -> Sequence[float]:
    """Velocities as a list, one alone too."""
    alone = getattr(velocities, "ndim", None) == 0 or (
        isinstance(velocities, Real) and not isinstance(velocities, bool)
    )
    return [velocities] if alone else velocities  # pyright: ignore[reportReturnType]


def observed(
    velocities: Sequence[float] | float,
    observation_time: str | float,
    stride: Stride,
    acceleration: Acceleration | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The velocities of a table and their observation times [time units], both (velocity,), if they make sense.

    Raises:
        InputError: a velocity that is none, comes twice or is not reached within its time, or a time without steps.
    """
    v = checked_list(several(velocities), acceleration)
    check_reached(v, stride, acceleration)
    duration = observation_duration(observation_time, v, stride, acceleration)
    check_in_time(v, duration, acceleration)
    steps_within(duration, stride)
    return v, duration


def velocity_axis(v: np.ndarray, duration: np.ndarray) -> dict[str, Any]:
    """Velocities and their observation times, both (velocity,), as a table has them."""
    return {
        "velocity": ("velocity", v, VELOCITY),
        "duration": ("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
    }
