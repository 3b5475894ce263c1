"""Pushes from the side: how strong, when, and for how many steps of the plan."""

from dataclasses import dataclass
from math import gcd

import numpy as np

from hexmj.checks import numbers
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.timing import Stride, steps_within

PUSH_LASTS = 0.025
"""How long a push lasts [s]."""


def steps_pushed(conditions: Conditions, stride: Stride) -> int:
    """Steps of the plan that a push lasts.

    Raises:
        InputError: not even one.
    """
    if not can_push(conditions, stride):
        told = f"{1e3 * conditions.seconds(stride):g} ms; expected less than {2e3 * PUSH_LASTS:g} ms"
        raise InputError(f"steps of the plan last {told}, since a push lasts {1e3 * PUSH_LASTS:g} ms")
    return round(PUSH_LASTS / conditions.seconds(stride))


def can_push(conditions: Conditions, stride: Stride, observation_time: float = np.inf) -> bool:
    """Whether steps of the plan are short enough for a push, and a observation time [time units] holds it."""
    return 0 < round(PUSH_LASTS / conditions.seconds(stride)) <= observation_time / stride.dt + 1e-6


@dataclass(frozen=True, eq=False)
class Push:
    """A push from the side at the root, for each start; it lasts `PUSH_LASTS`, to the nearest step of the plan."""

    impulse: np.ndarray
    """(start,) to the left [g mm/s]."""
    time: np.ndarray
    """(start,) when it begins, rounded down to a step of the plan [time units]."""

    def __post_init__(self) -> None:
        for name, given in vars(self).items():
            values = numbers(f"a push's {name}", given)
            if not np.isfinite(values).all():
                raise InputError(f"a push's {name} = {values[~np.isfinite(values)][0]}; expected a finite number")
            object.__setattr__(self, name, values)

    def begins(self, stride: Stride) -> np.ndarray:
        """(start,) steps of the plan before it."""
        return np.floor(self.time / stride.dt + 1e-9).astype(int)

    def divisor(self, conditions: Conditions, stride: Stride) -> int:
        """The most steps of which beginnings and ends are multiples: chunks of these cut no push; 0 without one.

        Raises:
            InputError: see `steps_pushed`.
        """
        begins = self.begins(stride)[self.impulse != 0.0]
        return gcd(steps_pushed(conditions, stride), *begins.tolist()) if begins.size else 0

    def check_within(self, duration: float, conditions: Conditions, stride: Stride, n_starts: int) -> None:
        """Refuse a push that is not of so many starts, or not all within a duration [time units].

        Raises:
            InputError: it is of others, or begins before that or ends after it.
        """
        for name, values in vars(self).items():
            if values.shape != (n_starts,):
                raise InputError(f"a push's {name} has the shape {values.shape}; expected one of {n_starts} starts")
        steps, pushed = int(steps_within(duration, stride)), self.impulse != 0.0
        lasts = steps_pushed(conditions, stride) if pushed.any() else 0
        beside = pushed & ((self.time < 0.0) | (self.begins(stride) + lasts > steps))
        if beside.any():
            start = int(np.argmax(beside))
            raise InputError(
                f"the push of start {start} is at {self.time[start]:g} time units and lasts {lasts * stride.dt:g};"
                f" expected one between 0 and {steps * stride.dt:g}, where the walk ends"
            )
