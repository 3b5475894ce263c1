"""What the cells of most sweeps are told of their walks."""

from dataclasses import dataclass

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.starts import draw_starts
from hexmj.timing import Acceleration, Stride


@dataclass(frozen=True)
class WalkSettings:
    """Walks of one controller at one velocity, from random starts."""

    controller: Controller
    """Plans them."""
    velocity: float
    """V_r, or its final value."""
    duration: float
    """Observation time [time units]."""
    n_starts: int
    """Number of starts."""
    seed: int
    """Of the starts."""
    conditions: Conditions
    """Of the physical walks."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""

    @property
    def starts(self) -> np.ndarray:
        """Tips at time 0, (start, leg) [mm]."""
        return draw_starts(self.n_starts, self.seed, self.stride)
