"""From tips to joint angles and back, in closed form: three hinges per leg, no optimiser.

A leg is a chain of three segments in one vertical plane that turns about the first hinge's axis.  Joint angles are the
biologist's and equal on both sides: protraction (0 across the body axis, positive forward), levation of the second
segment (0 horizontal, positive up) and the inner angle of the knee (pi is straight).  The knee always points up, so the
angles are unique.
"""

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.numeric import Bools, Floats, HingeChains, over_tips
from hexmj.bodies.reading import joint_numbers
from hexmj.body import Body
from hexmj.jitted import jitted
from hexmj.legs import SIDE

SAMPLES, SAME = 32, 1e-9
"""Postures in which a chain is compared with the closed form, and how far apart their tips may be [mm]."""


class ThreeHinges(NamedTuple):
    """Six legs of three hinges in the root frame (x forward, y left, z up)."""

    coxa_position: Floats
    """First hinges, (leg, axis) [mm]."""
    coxa: Floats
    """First to second hinge, (leg,) [mm]."""
    femur: Floats
    """Second hinge to knee, (leg,) [mm]."""
    tibia: Floats
    """Knee to tip, (leg,) [mm]."""
    side: Floats
    """+1 on the left, -1 on the right, (leg,)."""
    joint_range: Floats
    """Least and greatest angle of each joint, (leg, joint, 2) [rad]."""

    def inverse(self, tips: ArrayLike) -> tuple[Floats, Bools]:
        """See `compiled.CompiledBody.inverse`."""
        return over_tips(_solve, tips, tuple(self))

    def forward(self, joints: ArrayLike) -> Floats:
        """See `compiled.CompiledBody.forward`."""
        protraction, levation, knee = np.moveaxis(np.asarray(joints, dtype=np.float64), -1, 0)
        pitch = levation + knee - np.pi  # of the tibia above the horizontal
        outward = self.coxa + self.femur * np.cos(levation) + self.tibia * np.cos(pitch)
        forward = outward * np.sin(protraction)
        left = self.side * outward * np.cos(protraction)
        up = self.femur * np.sin(levation) + self.tibia * np.sin(pitch)
        return self.coxa_position + np.stack([forward, left, up], axis=-1)


def three_hinges(model: mujoco.MjModel, body: Body, chains: HingeChains) -> ThreeHinges | None:
    """The closed form of a compiled body's legs, or none where they are arranged in another way.

    The segments are read as if they lay along the x axes of their bodies; whether they do, and whether angles are
    counted as here, is seen in random postures: there the closed form puts the feet where the chains do.
    """
    joints = joint_numbers(model, body)
    if joints.shape[1] != 3:
        return None
    coxa, femur, tibia = (model.body_pos[model.jnt_bodyid[hinge]] for hinge in joints.T)
    legs = ThreeHinges(
        coxa_position=coxa,
        coxa=femur[:, 0].copy(),
        femur=tibia[:, 0].copy(),
        tibia=np.array([model.site(foot).pos[0] for foot in body.feet]),
        side=np.array(SIDE, dtype=np.float64),
        joint_range=model.jnt_range[joints],
    )
    unique = (chains.low >= (-np.pi, -np.pi, 0.0)).all() and (chains.high <= np.pi).all()
    postures = np.random.default_rng(0).uniform(chains.low, chains.high, (SAMPLES, *joints.shape))
    apart = np.abs(legs.forward(postures) - chains.forward(postures)).max()
    return legs if unique and apart <= SAME else None


@jitted
def _solve(tips: Any, legs: Any) -> tuple[Any, Any]:
    """`ThreeHinges.inverse` for tips shaped (n, leg, axis); `legs` as a plain tuple, which is handed over faster."""
    coxa_position, coxas, femurs, tibias, side, joint_range = legs
    joints = np.empty(tips.shape)
    reachable = np.empty(tips.shape[:2], dtype=np.bool_)
    for n in range(tips.shape[0]):
        for leg in range(tips.shape[1]):
            coxa, a, b = coxas[leg], femurs[leg], tibias[leg]
            forward = tips[n, leg, 0] - coxa_position[leg, 0]
            outward = side[leg] * (tips[n, leg, 1] - coxa_position[leg, 1])
            up = tips[n, leg, 2] - coxa_position[leg, 2]
            # The triangle of femur a, tibia b and c, from the coxa-trochanter joint to the tip.
            along = math.sqrt(forward * forward + outward * outward) - coxa
            c = math.sqrt(along * along + up * up)
            if abs(a - b) <= c <= a + b:
                protraction = math.atan2(forward, outward)
                levation = math.atan2(up, along) + math.acos((a * a + c * c - b * b) / (2 * a * c))
                knee = math.acos((a * a + b * b - c * c) / (2 * a * b))
                angles = protraction, levation, knee
            else:
                angles = math.nan, math.nan, math.nan
            within = True
            for j in range(3):
                joints[n, leg, j] = angles[j]
                within &= joint_range[leg, j, 0] <= angles[j] <= joint_range[leg, j, 1]
            reachable[n, leg] = within
            if not within:
                joints[n, leg] = math.nan
    return joints, reachable
