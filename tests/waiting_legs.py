"""A controller in a file of a user's own, with two fields that a search finds."""

OWN = """
from dataclasses import dataclass

import numpy as np

from hexmj.controllers import Step, stepwise


@dataclass(frozen=True)
class Waits:
    \"""The legs of a side swing one after the other, and both sides alike or not.\"""

    share: float = 0.5
    shift: float = 0.1
    name: str = "waits"
    legs: int = 6

    def __post_init__(self):
        if self.share > 2:
            raise ValueError("share")

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        time, x = 0.0, starts.copy()
        offsets = np.tile([0.0, self.share, 2 * self.share], 2) + np.repeat([0.0, self.shift], 3)

        def step(v):
            nonlocal time, x
            time += stride.dt
            period = (stride.aep0 - stride.pep0) * (1 + 1 / v[:, None])
            stands = (time / period + offsets) % 1 < 1 / (1 + v[:, None])
            x = np.clip(np.where(stands, x - v[:, None] * stride.dt, x + stride.dt), stride.pep_min, stride.aep0)
            return Step(x, stands)

        return stepwise(step, starts, velocity, stride, acceleration)
"""
