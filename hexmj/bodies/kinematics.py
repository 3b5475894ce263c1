"""Kinematics of the legs: from tips to joint angles and back, in closed form or numerically.

Closed form: a leg of three hinges whose segments lie in one vertical plane, which turns about the first hinge's axis.
Its angles are the biologist's and equal on both sides: protraction (0 across the body axis, positive forward),
levation of the second segment (0 horizontal, positive up) and the inner angle of the knee (pi is straight). The knee
always points up, so the angles are unique.

Numeric: any chain of hinges, by `newton`. With more than three hinges it chooses, of all postures that reach the tip,
the nearest to posture home. It takes 1.8 instead of 0.05 microseconds for a tip of the stick insect on one core. Where
a chain is nearly singular a tip can be missed: at most 3 in 1000 random postures of random chains, and none of 10^5
of the stick insect.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexmj.bodies.newton import reach
from hexmj.body import ROOT_QPOS, Body
from hexmj.jitted import jitted
from hexmj.legs import SIDE
from hexmj.timing import Stride

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SAMPLES, SAME = 32, 1e-9
"""Number of postures in which a chain is compared with the closed form, and tolerance of the tips [mm]."""


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
        return _over_tips(_solve, tips, tuple(self))

    def forward(self, joints: ArrayLike) -> Floats:
        """See `compiled.CompiledBody.forward`."""
        protraction, levation, knee = np.moveaxis(np.asarray(joints, dtype=np.float64), -1, 0)
        pitch = levation + knee - np.pi  # of the tibia above the horizontal
        outward = self.coxa + self.femur * np.cos(levation) + self.tibia * np.cos(pitch)
        forward = outward * np.sin(protraction)
        left = self.side * outward * np.cos(protraction)
        up = self.femur * np.sin(levation) + self.tibia * np.sin(pitch)
        return self.coxa_position + np.stack([forward, left, up], axis=-1)


class HingeChains(NamedTuple):
    """Six chains with the same number of hinges, as the MJCF defines them, in the root frame."""

    axis: Floats
    """Unit vector of each hinge, (leg, joint, axis)."""
    anchor: Floats
    """A point on each hinge, (leg, joint, axis) [mm]."""
    foot: Floats
    """The tip, (leg, axis) [mm]."""
    length: Floats
    """From the first hinge to the tip of the stretched leg, (leg,) [mm]."""
    zero: Floats
    """Angles in the MJCF's reference posture, (leg, joint) [rad]."""
    home: Floats
    """Angles in posture home, (leg, joint) [rad]."""
    low: Floats
    """Least angles, (leg, joint) [rad]."""
    high: Floats
    """Greatest angles, (leg, joint) [rad]."""

    def inverse(self, tips: ArrayLike) -> tuple[Floats, Bools]:
        """See `compiled.CompiledBody.inverse`."""
        return _over_tips(reach, tips, self)

    def forward(self, joints: ArrayLike) -> Floats:
        """See `compiled.CompiledBody.forward`."""
        turns = np.asarray(joints, dtype=np.float64)[..., np.newaxis] - self.zero[..., np.newaxis]
        place = np.broadcast_to(self.foot, (*turns.shape[:-2], 3))
        for j in reversed(range(turns.shape[-2])):  # from the foot to the body
            axis, cosine, sine = self.axis[:, j], np.cos(turns[..., j, :]), np.sin(turns[..., j, :])
            off = place - self.anchor[:, j]
            along = axis * (axis * off).sum(axis=-1, keepdims=True)
            place = self.anchor[:, j] + along + cosine * (off - along) + sine * np.cross(axis, off)
        return place


def kinematics(model: mujoco.MjModel, body: Body) -> ThreeHinges | HingeChains:
    """Kinematics of a compiled body's legs, in closed form if all of them have one.

    For it the segments are read as if they lay along the x axes of their bodies. Random postures show whether they do,
    and whether the angles have the same meaning: there both forms must put the feet at the same places.
    """
    chains, joints = hinge_chains(model, body), joint_numbers(model, body)
    if joints.shape[1] != 3:
        return chains
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
    distance = np.abs(legs.forward(postures) - chains.forward(postures)).max()
    return legs if unique and distance <= SAME else chains


def hinge_chains(model: mujoco.MjModel, body: Body) -> HingeChains:
    """The chains of a compiled body."""
    joints, data = joint_numbers(model, body), posed(model, model.qpos0)
    columns = model.jnt_qposadr[joints]
    anchor, foot = data.xanchor[joints], np.array([data.site(foot).xpos for foot in body.feet])
    lengths = np.diff(np.concatenate([anchor, foot[:, np.newaxis]], axis=1), axis=1)
    return HingeChains(
        axis=data.xaxis[joints],
        anchor=anchor,
        foot=foot,
        length=np.linalg.norm(lengths, axis=-1).sum(axis=1),
        zero=model.qpos0[columns],
        home=model.key(body.home).qpos[columns],
        low=np.ascontiguousarray(model.jnt_range[joints][..., 0]),
        high=np.ascontiguousarray(model.jnt_range[joints][..., 1]),
    )


def joint_numbers(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """MuJoCo's indices of the legs' joints, (leg, joint)."""
    return np.array([[model.joint(joint).id for joint in leg.joints] for leg in body.legs])


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Positions of all parts with the joints as in `qpos`, (position,), and the root's frame at the world's."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    data.qpos[:ROOT_QPOS] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    return data


def standing_tips(x: np.ndarray, standing_height: float, stride: Stride) -> np.ndarray:
    """Tips on the ground in the root frame, (..., leg, 3) [mm], from `x` on their own axes, (..., leg) [mm]."""
    tips = x + np.array(stride.geometry.origin), np.broadcast_to(stride.geometry.y, x.shape)
    return np.stack([*tips, np.full(x.shape, -standing_height)], axis=-1)


def _over_tips(solve: Callable[..., Any], tips: ArrayLike, legs: Any) -> tuple[Floats, Bools]:
    """Call a compiled inverse with tips that have any leading axes."""
    tips = np.ascontiguousarray(tips, dtype=np.float64)
    joints, reachable = solve(tips.reshape(-1, *tips.shape[-2:]), legs)
    leading = tips.shape[:-1]
    return joints.reshape(*leading, joints.shape[-1]), reachable.reshape(leading)


@jitted
def _solve(tips: Any, legs: Any) -> tuple[Any, Any]:
    """`ThreeHinges.inverse` for tips of shape (n, leg, axis); `legs` is a plain tuple, which numba unpacks faster."""
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
