"""What supports a walking body: the feet at the ground, whether it carries them or not, and the centre of pressure.

The ground can carry a body that stands on more than three feet in many ways.  Which of them it carries hangs on how far
the servos give way: a foot that the plan lets stand may hover a fiftieth of the standing height up while the others
carry.  It supports the body all the same, since it would carry as soon as the trunk came down by as much.
"""

from dataclasses import replace

import numpy as np

from hexmj.checks import typed
from hexmj.measures.physical import PhysicalWalk
from hexmj.stability import stability_margin
from hexmj.walks import Walk

GROUNDED = 0.05
"""How high a foot may hover that counts as on the ground, as a share of the standing height; 0.05 to 0.2 give the same
FLSS at V_p = 20 mm/s within 0.04, see `docs/static_limit.md`."""


def grounded(walk: PhysicalWalk, share: float = GROUNDED) -> Walk:
    """The measured walk, in which feet that hover by less than a share of the standing height stand, too.

    Raises:
        InputError: it is no physical walk.
    """
    near = typed("walk", walk, PhysicalWalk).height <= share * walk.conditions.standing_height
    return replace(walk.measured, stance=walk.measured.stance | near)


def centre_of_pressure(walk: PhysicalWalk) -> np.ndarray:
    """Where the ground pushes feet up, seen from the centre of mass, (step, start, 2) [mm]; NaN where it pushes none.

    A foot that pulls, and is held by adhesion, counts nothing.

    Raises:
        InputError: it is no physical walk.
    """
    pushed = np.maximum(typed("walk", walk, PhysicalWalk).load, 0.0)
    with np.errstate(invalid="ignore"):
        share = pushed / pushed.sum(axis=-1, keepdims=True)
    return (share[..., None] * walk.measured.feet).sum(axis=-2)


def pressure_margin(walk: PhysicalWalk) -> np.ndarray:
    """Distance of the centre of pressure from the nearest edge of the polygon of the feet at the ground, (step, start).

    It never lies outside, and on the edge over which the body tips; NaN [mm] where the ground pushes no foot up.

    Raises:
        InputError: it is no physical walk.
    """
    support, centre = grounded(walk), centre_of_pressure(walk)
    known = np.isfinite(centre[..., 0])
    feet = np.where(known[..., None, None], support.feet - centre[..., None, :], 0.0)
    return np.where(known, np.abs(stability_margin(feet, support.stance & known[..., None])), np.nan)
