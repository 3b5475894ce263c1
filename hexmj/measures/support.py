"""Support of a walking body: feet at the ground, whether they carry or not, and the centre of pressure.

The ground can carry a body with more than three standing feet in many ways. Which feet carry depends on how far the
servos yield: a standing foot may hover by a fiftieth of the standing height while others carry. It supports the body
nevertheless, since it carries as soon as the trunk sinks by as much.
"""

from dataclasses import replace

import numpy as np

from hexmj.measures.physical import PhysicalWalk
from hexmj.stability import stability_margin
from hexmj.walks import Walk

GROUNDED = 0.05
"""Height below which a foot is at the ground, as a fraction of the standing height; 0.05 to 0.2 give the same FLSS at
V_p = 20 mm/s within 0.04 (`docs/static_limit.md`)."""


def grounded(walk: PhysicalWalk, share: float = GROUNDED) -> Walk:
    """Return the measured walk with the feet that hover by less than a share of the standing height standing too."""
    near = walk.height <= share * walk.conditions.standing_height
    return replace(walk.measured, stance=walk.measured.stance | near)


def centre_of_pressure(walk: PhysicalWalk) -> np.ndarray:
    """Return the centre of the forces that push feet up, seen from the centre of mass, (step, start, 2) [mm].

    A foot that adhesion holds down does not count. NaN where the ground pushes no foot up.
    """
    pushed = np.maximum(walk.load, 0.0)
    with np.errstate(invalid="ignore"):
        share = pushed / pushed.sum(axis=-1, keepdims=True)
    return (share[..., None] * walk.measured.feet).sum(axis=-2)


def pressure_margin(walk: PhysicalWalk) -> np.ndarray:
    """Return the distance of the centre of pressure from the nearest edge of the support polygon, (step, start) [mm].

    The polygon is that of all feet at the ground. The centre of pressure never lies outside, and lies on the edge over
    which the body tips. NaN where the ground pushes no foot up.
    """
    support, centre = grounded(walk), centre_of_pressure(walk)
    known = np.isfinite(centre[..., 0])
    feet = np.where(known[..., None, None], support.feet - centre[..., None, :], 0.0)
    return np.where(known, np.abs(stability_margin(feet, support.stance & known[..., None])), np.nan)
