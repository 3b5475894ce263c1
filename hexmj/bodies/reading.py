"""What is read from a compiled MJCF of a body."""

import mujoco
import numpy as np

from hexmj.body import ROOT_QPOS, Body


def joint_numbers(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """MuJoCo's numbers of the legs' joints, (leg, joint)."""
    return np.array([[model.joint(joint).id for joint in leg.joints] for leg in body.legs])


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Where everything is with the joints as in `qpos`, (position,); the world is the root's frame."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    data.qpos[:ROOT_QPOS] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    return data


def segments(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """Lengths of the legs' parts from hinge to hinge and to the foot, in posture home, (leg, part) [mm]."""
    data, joints = posed(model, model.key(body.home).qpos), joint_numbers(model, body)
    feet = [model.site(foot).id for foot in body.feet]
    places = np.concatenate([data.xanchor[joints], data.site_xpos[feet][:, None]], axis=1)  # (leg, joint + 1, axis)
    return np.linalg.norm(np.diff(places, axis=1), axis=-1)
