"""The forces of the ground on the feet, of which sensors show the normal part alone."""

import copy

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody


class GroundForces:
    """Solves the contacts of a state once more, as the step did that began with it."""

    def __init__(self, compiled: CompiledBody) -> None:
        """Of a body whose feet do not grasp; its servos are put in by their torques."""
        self._model, self._columns = copy.copy(compiled.model), compiled.columns
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self._data, self._wrench = mujoco.MjData(self._model), np.zeros(6)
        self._legs = {self._model.geom(foot).id: leg for leg, foot in enumerate(compiled.body.feet)}

    def on_feet(self, qpos: np.ndarray, qvel: np.ndarray, torques: np.ndarray) -> np.ndarray:
        """Forces on the feet in the world, (leg, 3) [g mm/s^2].

        Args:
            qpos: (position,).
            qvel: (dof,).
            torques: of the servos, (joint,) [g mm^2/s^2].
        """
        model, data, forces = self._model, self._data, np.zeros((6, 3))
        data.qpos[:], data.qvel[:], data.qfrc_applied[self._columns.qvel] = qpos, qvel, torques
        mujoco.mj_forward(model, data)
        for i in range(data.ncon):
            for geom, sign in zip(data.contact[i].geom.tolist(), (-1.0, 1.0), strict=True):
                if geom in self._legs:
                    mujoco.mj_contactForce(model, data, i, self._wrench)
                    forces[self._legs[geom]] += sign * self._wrench[:3] @ data.contact[i].frame.reshape(3, 3)
        return forces
