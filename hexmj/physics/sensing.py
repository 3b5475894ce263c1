"""What insects know of themselves, for plans that read the legs."""

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.description import ROOT_QPOS, ROOT_QVEL
from hexmj.controllers.protocol import Sensed
from hexmj.rotations import heading, lean, turned


def sensed(
    ids: np.ndarray,
    qpos: np.ndarray,
    qvel: np.ndarray,
    contact: np.ndarray,
    before: np.ndarray,
    load: np.ndarray,
    torques: np.ndarray,
    compiled: CompiledBody,
) -> Sensed:
    """See `Sensed`; `before` are the contacts a step before, (n, leg), and torques those of all joints, (n, joint)."""
    joints, root = qpos[:, compiled.columns.qpos].reshape(len(ids), 6, -1), qpos[:, 3:ROOT_QPOS]
    return Sensed(
        ids=ids,
        tips=compiled.forward(joints),
        contact=contact,
        gained=contact & ~before,
        lost=before & ~contact,
        load=load,
        joints=joints,
        torques=torques.reshape(joints.shape),
        tilt=np.arcsin(np.clip(lean(root)[0], -1.0, 1.0)),
        velocity=np.concatenate([turned(qvel[:, None, :2], -heading(root))[:, 0], qvel[:, 2:3]], axis=1),
        turning=qvel[:, 3:ROOT_QVEL],
    )
