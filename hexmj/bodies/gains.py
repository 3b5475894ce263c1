"""Gains of the position servos at the joints, from mass, lengths, inertias and a time step.

Torque limit: one leg alone carries the whole weight W where its lever is longest, so it is W times that lever.  The
lever of a hinge is the way along the leg from it to the foot, times the share of its axis that lies horizontal in
posture home: a vertical hinge carries no weight.

Stiffness: as much as a step h allows for the lightest joint of a leg, whose inertia about its axis, with the armature,
is I.  An undamped servo of stiffness k makes it swing with omega^2 = k / I; on the mean over the legs (omega h)^2 is 1,
so k = 1 / (h^2 mean(1 / I)).  The damping is integrated implicitly, so it sets no limit.

Both are rounded to the significant digits that the body's `servo` asks for: 398728 and 1.5384e6 to 4.0e5 g mm^2/s^2
and 1.5e6 g mm^2/s^2/rad for the stick insect (lever 40.645 mm; knees of 1.733, 1.327 and 1.615 g mm^2).
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from hexmj.bodies.reading import joint_numbers, posed, segments
from hexmj.body import Body


@dataclass(frozen=True)
class Gains:
    """Of all joints of a body alike."""

    torque: float
    """Greatest torque [g mm^2/s^2]."""
    stiffness: float
    """Torque per angle off the target [g mm^2/s^2/rad]."""
    damping_ratio: float
    """1 is critical; MuJoCo computes the damping of each joint from it as it compiles."""


def gains(model: mujoco.MjModel, body: Body) -> Gains:
    """The gains for a compiled body without load."""
    servo, weight = body.servo, -body.mass * float(model.opt.gravity[2])
    inertia = model.dof_M0[model.jnt_dofadr[joint_numbers(model, body)]]
    lightest = inertia.min(axis=1)  # (leg,)
    return Gains(
        torque=_rounded(weight * longest_lever(model, body), servo.digits),
        stiffness=_rounded(1.0 / (servo.step**2 * (1.0 / lightest).mean()), servo.digits),
        damping_ratio=servo.damping_ratio,
    )


def longest_lever(model: mujoco.MjModel, body: Body) -> float:
    """The longest lever with which the weight, on one foot, can turn a joint [mm]."""
    data, joints = posed(model, model.key(body.home).qpos), joint_numbers(model, body)
    way = np.cumsum(segments(model, body)[:, ::-1], axis=1)[:, ::-1]
    horizontal = np.linalg.norm(data.xaxis[joints][..., :2], axis=-1)
    return float((way * horizontal).max())


def _rounded(value: float, digits: int) -> float:
    """To so many significant digits."""
    return float(f"{value:.{digits - 1}e}")
