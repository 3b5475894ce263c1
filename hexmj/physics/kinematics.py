"""From tips to joint angles and back, in closed form: three hinges per leg, no optimiser.

A leg is a chain coxa, femur, tibia (tarsus included) in one vertical plane that turns about the
thorax-coxa axis.  Joint angles are the biologist's and equal on both sides: protraction (0 across
the body axis, positive forward), levation of the femur (0 horizontal, positive up) and the inner
angle of the knee (pi is straight).  The knee always points up, so the angles are unique.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class LegDimensions:
    """What the geometry of the six legs needs, in the root frame (x forward, y left, z up)."""

    coxa_position: Floats
    """Thorax-coxa joints, (leg, axis) [mm]."""
    coxa: Floats
    """Thorax-coxa joint to coxa-trochanter joint, (leg,) [mm]."""
    femur: Floats
    """Coxa-trochanter joint to knee, (leg,) [mm]."""
    tibia: Floats
    """Knee to tip, the tarsus included, (leg,) [mm]."""
    foot: float
    """Radius of the foot: height of a standing foot's tip over the ground [mm]."""
    side: Floats
    """+1 on the left, -1 on the right, (leg,)."""
    joint_range: Floats
    """Least and greatest angle of each joint, (leg, joint, 2) [rad]."""


def tips_to_joints(tips: ArrayLike, dimensions: LegDimensions) -> tuple[Floats, Bools]:
    """Joint angles that put the tips where they are wanted (inverse kinematics).

    Args:
        tips: wanted tips in the root frame, (..., leg, axis) [mm].
        dimensions: the insect's legs.

    Returns:
        The angles, (..., leg, joint) [rad], NaN where a tip cannot be reached, and whether each
        tip can be reached within the leg's length and the joints' ranges, (..., leg).
    """
    tips = np.asarray(tips, dtype=np.float64)
    flat = np.ascontiguousarray(tips).reshape(-1, *tips.shape[-2:])
    d = dimensions
    joints, reachable = _solve(flat, d.coxa_position, d.coxa, d.femur, d.tibia, d.side, d.joint_range)
    return joints.reshape(tips.shape), reachable.reshape(tips.shape[:-1])


def joints_to_tips(joints: ArrayLike, dimensions: LegDimensions) -> Floats:
    """Tips in the root frame, (..., leg, axis) [mm], at the joint angles, (..., leg, joint) [rad]."""
    d = dimensions
    protraction, levation, knee = np.moveaxis(np.asarray(joints, dtype=np.float64), -1, 0)
    pitch = levation + knee - np.pi  # of the tibia above the horizontal
    outward = d.coxa + d.femur * np.cos(levation) + d.tibia * np.cos(pitch)
    forward = outward * np.sin(protraction)
    left = d.side * outward * np.cos(protraction)
    up = d.femur * np.sin(levation) + d.tibia * np.sin(pitch)
    return d.coxa_position + np.stack([forward, left, up], axis=-1)


@njit(cache=True, nogil=True)
def _solve(
    tips: Any, coxa_position: Any, coxa: Any, femur: Any, tibia: Any, side: Any, joint_range: Any
) -> tuple[Any, Any]:
    """`tips_to_joints` for tips shaped (n, leg, axis)."""
    joints = np.empty(tips.shape)
    reachable = np.empty(tips.shape[:2], dtype=np.bool_)
    for n in range(tips.shape[0]):
        for leg in range(tips.shape[1]):
            a, b = femur[leg], tibia[leg]
            forward = tips[n, leg, 0] - coxa_position[leg, 0]
            outward = side[leg] * (tips[n, leg, 1] - coxa_position[leg, 1])
            up = tips[n, leg, 2] - coxa_position[leg, 2]
            # The triangle of femur a, tibia b and c, from the coxa-trochanter joint to the tip.
            along = math.sqrt(forward * forward + outward * outward) - coxa[leg]
            c = math.sqrt(along * along + up * up)
            if abs(a - b) <= c <= a + b:
                protraction = math.atan2(forward, outward)
                levation = math.atan2(up, along) + math.acos((a * a + c * c - b * b) / (2 * a * c))
                knee = math.acos((a * a + b * b - c * c) / (2 * a * b))
            else:
                protraction = levation = knee = math.nan
            limits = joint_range[leg]
            within = (
                limits[0, 0] <= protraction <= limits[0, 1]
                and limits[1, 0] <= levation <= limits[1, 1]
                and limits[2, 0] <= knee <= limits[2, 1]
            )
            reachable[n, leg] = within
            joints[n, leg, 0] = protraction if within else math.nan
            joints[n, leg, 1] = levation if within else math.nan
            joints[n, leg, 2] = knee if within else math.nan
    return joints, reachable
