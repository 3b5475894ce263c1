"""What insects feel, substep by substep: which feet stand, what they carry, and what they know for plans that read."""

import math
from typing import Any

import numpy as np

from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.conditions import ROUNDING
from hexmj.controllers.protocol import Sensed
from hexmj.jitted import jitted
from hexmj.physics.settling import Settled
from hexmj.rotations import heading, lean, turned


class Senses:
    """Senses of settled starts; a foot stands if the ground carried it within the last `Conditions.contact_gap`."""

    def __init__(self, settled: Settled) -> None:
        """All feet stand."""
        self._compiled = settled.compiled
        self._unloaded = np.zeros(settled.starts.shape, dtype=int)  # substeps since the ground last carried a foot
        gap = settled.conditions.contact_gap / 1000.0 / settled.compiled.model.opt.timestep
        self._longest_gap = math.floor(gap * (1.0 + ROUNDING))  # substeps
        self._before = np.ones(settled.starts.shape, dtype=bool)
        self._load, self._torques = settled.load.copy(), settled.torques.copy()

    def restart(self, ids: np.ndarray, settled: Settled) -> None:
        """Some starts stand at rest again, as others that were settled, (n,)."""
        self._unloaded[ids], self._before[ids] = 0, True
        self._load[ids], self._torques[ids] = settled.load, settled.torques

    def feel(self, ids: np.ndarray, sensors: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which feet of some starts stand after each of the next substeps, and the force of the ground on them along
        its normal, adhesion taken off [g mm/s^2]; both (n, substep, leg).

        Args:
            ids: of the starts, (n,).
            sensors: as `backend.Rolled` has them.
            force: of the actuators, the joints' first, (n, substep, actuator).
        """
        felt = self._unloaded, self._load, self._torques
        loads = self._compiled.carried(sensors, force)
        touch = sensors[..., self._compiled.columns.touch]
        return _feel(ids, touch, loads, force, self._longest_gap, felt), loads

    def standing(self, ids: np.ndarray | slice = np.s_[:]) -> np.ndarray:
        """Which feet of some starts stand now, (n, leg); of all unless told."""
        return self._unloaded[ids] <= self._longest_gap

    def sensed(self, ids: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> Sensed:
        """What some starts, (n,), know of themselves, at `qpos`, (n, position), and with `qvel`, (n, velocity).

        Contacts gained and lost are those since they were last asked.
        """
        before, contact = self._before[ids], self.standing(ids)
        self._before[ids] = contact
        joints, root = qpos[:, self._compiled.columns.qpos].reshape(len(ids), 6, -1), qpos[:, 3:ROOT_QPOS]
        return Sensed(
            ids=ids.copy(),
            tips=self._compiled.forward(joints),
            contact=contact,
            gained=contact & ~before,
            lost=before & ~contact,
            load=self._load[ids],
            joints=joints,
            torques=self._torques[ids].reshape(joints.shape),
            tilt=np.arcsin(np.clip(lean(root)[0], -1.0, 1.0)),
            velocity=np.concatenate([turned(qvel[:, None, :2], -heading(root))[:, 0], qvel[:, 2:3]], axis=1),
            turning=qvel[:, 3:ROOT_QVEL],
        )


@jitted
def _feel(ids: Any, touch: Any, loads: Any, force: Any, longest_gap: int, felt: Any) -> Any:
    """Which feet stand, of `Senses.feel`; `felt` goes on: substeps without touch and load (start, leg), and torques
    (start, joint)."""
    unloaded, load, torques = felt
    standing = np.empty(touch.shape, dtype=np.bool_)
    for i, start in enumerate(ids):
        for t in range(touch.shape[1]):
            for leg in range(6):
                unloaded[start, leg] = 0 if touch[i, t, leg] > 0 else unloaded[start, leg] + 1
                standing[i, t, leg] = unloaded[start, leg] <= longest_gap
        load[start] = loads[i, -1]
        for joint in range(torques.shape[1]):
            torques[start, joint] = force[i, -1, joint]
    return standing
