"""Pushes on the root: their impulses, directions, times and durations."""

from dataclasses import dataclass
from math import cos, gcd, pi, sin

import numpy as np

from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.timing import Stride, steps_within

PUSH_LASTS = 0.025
"""Duration of a push [s]."""


def steps_pushed(conditions: Conditions, stride: Stride) -> int:
    """Return the duration of a push as a number of steps of the plan.

    Raises:
        InputError: a step of the plan lasts at least twice as long as a push.
    """
    if not can_push(conditions, stride):
        duration, longest = 1e3 * conditions.seconds(stride), 2e3 * PUSH_LASTS
        raise InputError(f"a push needs steps of the plan shorter than {longest:g} ms; these last {duration:g} ms")
    return round(PUSH_LASTS / conditions.seconds(stride))


def can_push(conditions: Conditions, stride: Stride, observation_time: float = np.inf) -> bool:
    """Return whether a push lasts at least one step of the plan, and at most the observation time [time units]."""
    return 0 < round(PUSH_LASTS / conditions.seconds(stride)) <= observation_time / stride.dt + 1e-6


@dataclass(frozen=True, eq=False)
class Push:
    """A horizontal push on the root body of each start; it lasts `PUSH_LASTS`, in whole plan steps."""

    impulse: np.ndarray
    """(start,) impulse [g mm/s]; 0 means no push."""
    time: np.ndarray
    """(start,) time at which the push begins, rounded down to a step of the plan [time units]."""
    direction: float = pi / 2
    """Direction of the impulse relative to the heading at time 0: 0 ahead, pi / 2 to the left [rad]."""

    @property
    def vector(self) -> np.ndarray:
        """(start, 2) impulse ahead and to the left in the world [g mm/s]."""
        return self.impulse[:, None] * np.round([cos(self.direction), sin(self.direction)], 15)

    def begins(self, stride: Stride) -> np.ndarray:
        """Return the number of plan steps before each push, (start,)."""
        return np.floor(self.time / stride.dt + 1e-9).astype(int)

    def divisor(self, conditions: Conditions, stride: Stride) -> int:
        """Return the greatest common divisor of the plan steps at which pushes begin and end; 0 without a push.
        Chunks whose number of plan steps divides it cut no push."""
        begins = self.begins(stride)[self.impulse != 0.0]
        return gcd(steps_pushed(conditions, stride), *begins.tolist()) if begins.size else 0

    def check_within(self, duration: float, conditions: Conditions, stride: Stride, n_starts: int) -> None:
        """Raise InputError unless impulse and time have one number per start and pushes fit a duration [time units]."""
        if self.impulse.shape != (n_starts,) or self.time.shape != (n_starts,):
            shapes = f"{self.impulse.shape} and {self.time.shape}"
            raise InputError(f"push: impulse and time have the shapes {shapes}; expected ({n_starts},) for both")
        steps, pushed = int(steps_within(duration, stride)), self.impulse != 0.0
        lasts = steps_pushed(conditions, stride) if pushed.any() else 0
        outside = pushed & ((self.time < 0.0) | (self.begins(stride) + lasts > steps))
        if outside.any():
            start, last = int(np.argmax(outside)), (steps - lasts) * stride.dt
            raise InputError(f"push: time of start {start} = {self.time[start]:g}; expected 0 to {last:g} time units")
