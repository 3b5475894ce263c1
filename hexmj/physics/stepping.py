"""Insects in one MuJoCo batch take physics steps; a step of the network in which a foot strikes is taken again, finely.

A MuJoCo warning ends everything even in a roll that would have been taken again.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch

from hexmj.physics import insect
from hexmj.physics.divergence import raise_if_diverged
from hexmj.physics.ground import depth_in_ground
from hexmj.physics.joint_targets import Orders
from hexmj.physics.settling import Settled
from hexmj.physics.strikes import FINER, FINEST, in_whole_steps, strikes
from hexmj.threads import thread_count

Shown = dict[str, np.ndarray]
"""What is shown of some starts by its name, each (n, substep, ...)."""

STATE = ("qpos", "qvel", "qacc_warmstart")
"""What an insect goes on from, 25 + 24 + 24 numbers."""

AFTER = int(mujoco.mjtState.mjSTATE_QPOS | mujoco.mjtState.mjSTATE_QVEL | mujoco.mjtState.mjSTATE_WARMSTART)
"""The same as MuJoCo records it, in one array."""


class Stepper:
    """MuJoCo's batch of settled starts, and where in it the states, contacts and sensors are."""

    qpos: np.ndarray
    """(start, 25), as they are now."""
    push: np.ndarray
    """(start,) force on the root to the left [g mm/s^2], 0 unless the caller sets it."""

    def __init__(self, settled: Settled, threads: int | None) -> None:
        """Put all at rest; `threads` step them, one per core unless given."""
        self._settled, self._model = settled, settled.mujoco_model
        self._batch = Batch(self._model, len(settled.starts), thread_count(threads))
        self._timestep, self._contact = self._batch.expand("opt.timestep"), self._batch.expand("pair_solref")
        self._state = [self._batch.bind(name) for name in STATE]
        self._ends = np.cumsum([values.shape[1] for values in self._state])[:-1]
        rest = np.concatenate([settled.qpos, settled.qvel, settled.warmstart], axis=1)
        self._put(np.arange(len(settled.starts)), rest)
        self.qpos = self._state[0]
        self.push = self._batch.bind("xfrc_applied")[:, self._model.body("mesothorax").id, 1]
        self._sensors, self._columns = self._batch.bind("sensordata"), insect.sensors(self._model)
        self._foot = insect.dimensions(self._model).foot
        self._substeps = settled.body.substeps(settled.network)

    def take(self, orders: Orders) -> Shown:
        """Take the orders' substeps; what is shown of them is named as in `stretches.Stretch`.

        Who strikes the ground is put back to where that step of the network began, takes it finely, and goes on.
        """
        m, end = self._substeps, orders.control.shape[1]
        before = self._states(orders.ids)
        shown, struck = self._roll(orders, 0, end)
        for begin in range(0, end, m):
            if (again := np.flatnonzero(struck == begin)).size:
                few, then = orders.only(again), min(begin + m, end)
                self._put(few.ids, shown["after"][again, begin - 1] if begin else before[again])
                _show(shown, again, begin, self._roll_finely(few, begin, then))
                if then < end:
                    rest, struck[again] = self._roll(few, then, end)
                    _show(shown, again, then, rest)
        return shown

    def _roll(self, orders: Orders, begin: int, end: int, parts: int = 1) -> tuple[Shown, np.ndarray]:
        """Every part of the substeps; and where the first step begins in which a foot strikes, (n,), `end` for none."""
        settled, ids, m = self._settled, orders.ids, self._substeps
        control, before = orders.control[:, begin:end].repeat(parts, axis=1), self._states(ids)
        seen = self._batch.rollout(control.shape[1], control, record=(AFTER, "sensordata", "actuator_force"), ids=ids)
        time = orders.plan.time[0] + (begin / m - 1) * settled.network.dt
        saved = dict(zip(STATE, np.split(before, self._ends, axis=1), strict=True)) | {"ctrl": control}
        raise_if_diverged(self._batch, ids, time, orders.plan.velocity[0], saved)
        self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)  # for the feet at the end
        feet = [sensors[:, :, self._columns.foot] for sensors in (seen["sensordata"], self._sensors[ids, None])]
        depth = depth_in_ground(settled.body, np.concatenate(feet, axis=1).reshape(len(ids), -1, 6, 3), self._foot)
        strike = strikes(depth, parts * m, settled.body.standing_height)
        width = self.qpos.shape[1]
        shown = {
            "qpos": np.concatenate([before[:, None, :width], seen[AFTER][:, :-1, :width]], axis=1),
            "sensors": seen["sensordata"],
            "force": seen["actuator_force"][:, :, : insect.JOINT_ACTUATORS],
            "depth": depth[:, 1:].max(axis=2),
            "after": seen[AFTER],
        }
        return shown, np.where(strike.any(axis=1), begin + np.argmax(strike, axis=1) // (parts * m) * m, end)

    def _roll_finely(self, orders: Orders, begin: int, end: int, parts: int = FINER) -> Shown:
        """One step's substeps in parts, in more where even then a foot strikes; shown is every substep."""
        ids, model, before = orders.ids, self._model, self._states(orders.ids)
        timestep = model.opt.timestep / parts
        self._timestep[ids], self._contact[ids, :, 0] = timestep, 2 * timestep
        every, struck = self._roll(orders, begin, end, parts)
        self._timestep[ids], self._contact[ids] = model.opt.timestep, model.pair_solref
        shown = {name: values[:, ::parts] for name, values in every.items()} | {
            "sensors": in_whole_steps(every["sensors"], parts, self._columns.touch),
            "depth": every["depth"].reshape(len(ids), -1, parts).max(axis=2),
            "after": every["after"][:, parts - 1 :: parts],
        }
        if parts < FINEST and (again := np.flatnonzero(struck < end)).size:
            self._put(ids[again], before[again])
            _show(shown, again, 0, self._roll_finely(orders.only(again), begin, end, FINER * parts))
        return shown

    def _states(self, ids: np.ndarray) -> np.ndarray:
        """What some starts go on from, (n, 73)."""
        return np.concatenate([values[ids] for values in self._state], axis=1)

    def _put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Put some starts where they shall go on from."""
        for values, now in zip(np.split(states, self._ends, axis=1), self._state, strict=True):
            now[ids] = values


def _show(shown: Shown, rows: np.ndarray, begin: int, instead: Shown) -> None:
    """Show something else of some rows, from a substep on."""
    for name, values in instead.items():
        shown[name][rows, begin : begin + values.shape[1]] = values
