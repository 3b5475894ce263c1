"""The one type of walk that both measures of stability read."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexmj.legs import FIG1, Geometry


@dataclass(frozen=True, eq=False)
class Walk:
    """Where the tips are, seen from the centre of mass, and which of them stand.

    A planned walk has the paper's centre of mass (fixed at O) and the network's tips; a measured
    walk has the body's own centre of mass, the physical tips and the feet that touch the ground.
    """

    time: np.ndarray
    """(step,) time at the end of each step [time units of the network]."""
    velocity: np.ndarray
    """(step, start) commanded velocity V_r during each step, as a fraction of V_p."""
    x: np.ndarray
    """(step, start, leg) tips on their own axes O_i X_i [mm]."""
    y: np.ndarray
    """(step, start, leg) tips beside the body axis, left positive [mm]."""
    stance: np.ndarray
    """(step, start, leg) True where the leg retracts (planned) or touches the ground (measured)."""
    geometry: Geometry = FIG1
    """Origins of the legs' axes."""

    @property
    def feet(self) -> np.ndarray:
        """(step, start, leg, 2) tips from the centre of mass: ahead, to the left [mm]."""
        return np.stack([self.x + np.array(self.geometry.origin), self.y], axis=-1)


def joined(walks: Sequence[Walk]) -> Walk:
    """One walk of the same starts out of those that follow each other."""
    if len(walks) == 1:
        return walks[0]
    names = ("time", "velocity", "x", "y", "stance")
    return replace(walks[0], **{name: np.concatenate([getattr(one, name) for one in walks]) for name in names})
