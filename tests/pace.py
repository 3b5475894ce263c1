"""A controller with one field that matters and one that does not."""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers import Step, stepwise


@dataclass(frozen=True)
class Pace:
    """Two numbers, of which one is best at 3 and the other makes no difference: legs stand or not, all of them."""

    good: float = 2.0
    idle: float = -0.5
    name: str = "pace"
    legs: int = 6

    def __post_init__(self) -> None:
        if self.good < 0:
            raise ValueError("good")

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        off, steps = abs(self.good - 3.0), 0

        def step(v: np.ndarray) -> Step:
            nonlocal steps
            steps += 1
            stands = np.abs(starts).sum(axis=1, keepdims=True) > 30 * off
            return Step(starts - 1e-3 * steps, stands & np.ones(6, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)
