"""Cells of sweeps: physical walks of one controller at one velocity, from random starts."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.measures.tables import over_start
from hexmj.progress import Progress
from hexmj.starts import draw_starts
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.measures.physical import PhysicalWalk
    from hexmj.physics.settle import Settled

UNITS = {
    **dict.fromkeys(("planned_loss", "measured_loss", "fall", "topple"), "time unit"),
    **dict.fromkeys(("clearance", "tracking", "depth"), "mm"),
    **{"tilt": "rad", "slip": "mm/s"},
}
"""Units of `Outcomes`; the others are numbers."""


@dataclass(frozen=True)
class WalkSettings:
    """Settings of the walks of a cell."""

    controller: Controller
    velocity: float
    """V_r, or its final value when accelerating."""
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

    def walk(self, starts: np.ndarray, threads: int | None) -> "PhysicalWalk":
        """Return physical walks, kept whole, from some starts, (start, leg) [mm]."""
        from hexmj.measures.physical import physical_walk

        how: Any = {"conditions": self.conditions, "stride": self.stride, "acceleration": self.acceleration}
        return physical_walk(starts, self.controller, self.velocity, self.duration, **how, threads=threads)


@lru_cache(maxsize=1)
def settled_starts(n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None) -> "Settled":
    """Return the seed's starts at rest; cached, since all controllers begin with the same starts."""
    from hexmj.physics.settle import settle

    return settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)


def outcome_table(walks: WalkSettings, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
    """Return every field of `Outcomes` over start."""
    from hexmj.measures.physical import physical_outcomes

    settled = settled_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads)
    outcomes = physical_outcomes(
        settled, walks.controller, walks.velocity, walks.duration,
        acceleration=walks.acceleration, threads=threads, progress=progress,
    )  # fmt: skip
    return over_start(vars(outcomes), UNITS)
