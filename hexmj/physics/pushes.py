"""Pushes from the side: how strong, when, and for how many steps of the plan."""

from dataclasses import dataclass
from math import gcd

import numpy as np

from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.timing import Stride, steps_within

PUSH_LASTS = 0.025
"""Duration of a push [s]."""


def steps_pushed(conditions: Conditions, stride: Stride) -> int:
    """Steps of the plan that a push lasts.

    Raises:
        InputError: a step of the plan is longer than a push.
    """
    if not can_push(conditions, stride):
        duration, longest = 1e3 * conditions.seconds(stride), 2e3 * PUSH_LASTS
        raise InputError(f"a step of the plan lasts {duration:g} ms; expected less than {longest:g} ms for a push")
    return round(PUSH_LASTS / conditions.seconds(stride))


def can_push(conditions: Conditions, stride: Stride, observation_time: float = np.inf) -> bool:
    """Whether a push lasts at least one step of the plan, and the observation time [time units] is long enough."""
    return 0 < round(PUSH_LASTS / conditions.seconds(stride)) <= observation_time / stride.dt + 1e-6


@dataclass(frozen=True, eq=False)
class Push:
    """A push from the side at the root for each start; it lasts `PUSH_LASTS`, to the nearest step of the plan."""

    impulse: np.ndarray
    """(start,) to the left [g mm/s]."""
    time: np.ndarray
    """(start,) at which it begins, rounded down to a step of the plan [time units]."""

    def begins(self, stride: Stride) -> np.ndarray:
        """(start,) steps of the plan before the push."""
        return np.floor(self.time / stride.dt + 1e-9).astype(int)

    def divisor(self, conditions: Conditions, stride: Stride) -> int:
        """Greatest common divisor of the steps at which pushes begin and end, so that chunks cut no push; 0 without."""
        begins = self.begins(stride)[self.impulse != 0.0]
        return gcd(steps_pushed(conditions, stride), *begins.tolist()) if begins.size else 0

    def check_within(self, duration: float, conditions: Conditions, stride: Stride, n_starts: int) -> None:
        """Raise InputError unless there is a push for each start, within a duration [time units]."""
        if self.impulse.shape != (n_starts,) or self.time.shape != (n_starts,):
            raise InputError(f"push: expected impulse and time of shape ({n_starts},), a number for each start")
        steps, pushed = int(steps_within(duration, stride)), self.impulse != 0.0
        lasts = steps_pushed(conditions, stride) if pushed.any() else 0
        outside = pushed & ((self.time < 0.0) | (self.begins(stride) + lasts > steps))
        if outside.any():
            start, last = int(np.argmax(outside)), (steps - lasts) * stride.dt
            raise InputError(f"push: time = {self.time[start]:g} of start {start}; expected 0 to {last:g} time units")
