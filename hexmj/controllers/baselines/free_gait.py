"""A free gait: a planner lifts the leg that needs it most, if the body stays stable without it.

After McGhee and Iswandhi 1979 (IEEE Trans. Syst. Man Cybern. 9, 176) and Kugushev and Jaroshevskij 1975. The
*kinematic margin* of a standing leg is the time until its tip leaves the leg's reach. Of the legs that have made a step
of at least `least_step`, the planner lifts the leg with the least kinematic margin without which the body stays stable
for the whole swing, and repeats this until no leg can be lifted.

Unlike the sources, the planner knows no terrain, chooses no footholds besides AEP_0, and does not look ahead beyond one
swing. Fitted by us: both fields, for little slip and few falls at V = 0.3. Sensed: nothing, not even the loads.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted
from hexmj.jitted import jitted
from hexmj.stability import margin_of
from hexmj.validate import number

EVERY = 5
"""Number of steps between two decisions."""


@dataclass(frozen=True)
class FreeGait(Lifted):
    """A planner of stable steps."""

    margin: float = 2.0
    """Minimum stability margin without a lifted leg, until its swing has ended [mm]."""
    least_step: float = 12.0
    """Minimum distance of a tip from AEP_0 at which the leg may be lifted [mm]."""
    name: str = "free"

    def __post_init__(self) -> None:
        super().__post_init__()
        number("margin", self.margin, 0.0, 30.0)
        number("least_step", self.least_step, 0.1, 100.0)

    def at_start(self, legs: Legs) -> np.ndarray:
        """Return the number of steps so far, (start,); see `Lifted.at_start`."""
        return np.zeros(len(legs.x), dtype=int)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted.lifts`."""
        stride, stands = legs.stride, legs.stands.copy()
        ends, limits = (stride.pep_min, stride.aep0), (self.margin, self.least_step)
        lines = np.array(stride.geometry.origin), np.array(stride.geometry.y)
        _decide(legs.x, stands, legs.v[:, 0], state % EVERY == 0, lines, ends, limits)
        return state + 1, legs.stands & ~stands


@jitted
def _decide(x: Any, stands: Any, v: Any, decides: Any, lines: Any, ends: Any, limits: Any) -> None:
    """Change `stands`, (start, leg), to False for the legs to lift, in the starts that decide now, (start,)."""
    rear, front = ends
    least_margin, least_step = limits
    for start in range(len(x)):
        if not decides[start] or v[start] == 0.0:
            continue
        own, standing = x[start], stands[start]
        for leg in np.argsort(own):  # the least kinematic margin first
            swing = front - own[leg]
            if standing[leg] and own[leg] > rear and swing >= least_step:
                standing[leg] = False
                standing[leg] = not _stays(own, standing, v[start] * swing, lines, least_margin)


@jitted
def _stays(x: Any, standing: Any, way: float, lines: Any, least: float) -> bool:
    """Return whether the margin of the standing legs stays at `least` [mm] while their tips recede by `way` [mm]."""
    feet = np.empty((6, 2))
    for part in (0.0, 0.5, 1.0):
        for leg in range(6):
            feet[leg, 0], feet[leg, 1] = lines[0][leg] + x[leg] - part * way, lines[1][leg]
        if margin_of(feet, standing) < least:
            return False
    return True
