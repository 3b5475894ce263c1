"""Settled insects in one MuJoCo batch: they carry out orders, and every stretch shows what happened.

A stretch shows the insects before each of its physics steps: what MuJoCo's sensors hold after a step belongs
to the state before it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mujoco.batch import Batch
from numba import njit

from hexmj.physics import insect
from hexmj.physics.divergence import raise_if_diverged
from hexmj.physics.joint_targets import Orders
from hexmj.physics.kinematics import joints_to_tips
from hexmj.physics.settling import Settled
from hexmj.threads import thread_count
from hexmj.walks import Walk, joined


@dataclass(frozen=True, eq=False)
class Stretch:
    """What some physics steps of the starts that still walk have shown."""

    plan: Walk
    """The plan over the stretch, of all starts."""
    first: int
    """Index of the first substep shown."""
    ids: np.ndarray
    """(n,) which starts these are."""
    qpos: np.ndarray
    """(n, substep, 25)."""
    sensors: np.ndarray
    """(n, substep, column), see `insect.Sensors`."""
    standing: np.ndarray
    """(n, substep, leg) whether the ground carried the foot within the last `Body.contact_gap`."""
    targets: np.ndarray
    """(n, substep, leg, 3) where the tips shall be, in the root frame [mm]."""
    force: np.ndarray
    """(n, substep, joint) torques of the joints [g mm^2/s^2]."""
    valid: np.ndarray
    """(n,) substeps up to the fall, that one included."""
    fell: np.ndarray
    """(n,) whether the trunk touched the ground."""
    unreachable: np.ndarray
    """(n,) targets out of reach."""


@dataclass(frozen=True, eq=False)
class Push:
    """A push from the side at the root, for each start; it lasts one stretch."""

    impulse: np.ndarray
    """(start,) to the left [g mm/s]."""
    time: np.ndarray
    """(start,) when it begins, rounded down to the beginning of a stretch [time units]."""


class Insects:
    """Settled starts, wherever their steps have brought them."""

    def __init__(self, settled: Settled, push: Push | None = None, threads: int | None = None) -> None:
        """Put all at rest; `threads` step them, one per core unless given."""
        self.settled = settled
        self._push = push
        self._batch = Batch(settled.mujoco_model, len(settled.starts), thread_count(threads))
        self._qpos = self._batch.bind("qpos")
        self._qpos[:], self._batch.bind("qvel")[:] = settled.qpos, settled.qvel
        self._batch.bind("qacc_warmstart")[:] = settled.warmstart
        self._columns, self._legs = insect.sensors(settled.mujoco_model), insect.dimensions(settled.mujoco_model)
        self._unloaded = np.zeros((len(settled.starts), 6), dtype=int)
        self._longest_gap = settled.body.contact_gap / 1000.0 / settled.mujoco_model.opt.timestep

    def tips(self, ids: np.ndarray) -> np.ndarray:
        """Where the joint angles put the tips of some starts, on their axes, (n, leg) [mm]."""
        joints = self._qpos[ids, insect.ROOT_QPOS :].reshape(-1, 6, 3)
        return joints_to_tips(joints, self._legs)[..., 0] - np.array(self.settled.network.geometry.origin)

    def carried(self, ids: np.ndarray) -> np.ndarray:
        """Which feet of some starts the ground carried within the last `Body.contact_gap`, (n, leg)."""
        return self._unloaded[ids] <= self._longest_gap

    def obey(self, ordered: Iterable[Orders], steps: int) -> Stretch:
        """Carry out orders for the same starts, one after the other; together they last `steps` steps of the network.

        Each is asked for when those before it are done, so it may depend on what they have done.
        """
        before: dict[str, np.ndarray] = {}
        done: list[Orders] = []
        shown: list[dict[str, np.ndarray]] = []
        for orders in ordered:
            if not done:
                before = {name: self._batch.bind(name)[orders.ids] for name in ("qpos", "qvel", "qacc_warmstart")}
                self._begin_push(orders, steps)
            shown.append(self._carry_out(orders))
            done.append(orders)
        plan, ids, body = joined([orders.plan for orders in done]), done[0].ids, self.settled.body
        before["ctrl"] = _joined([orders.control for orders in done])
        raise_if_diverged(self._batch, body, ids, plan.time[0] - self.settled.network.dt, plan.velocity[0], before)
        whole: dict[str, Any] = {name: _joined([part[name] for part in shown]) for name in shown[0]}
        touching = (whole["sensors"][:, :, self._columns.trunk] > 0).any(axis=2)
        fell = touching.any(axis=1)
        valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
        missed = whole.pop("missed")
        return Stretch(
            plan=plan,
            first=done[0].first,
            ids=ids,
            valid=valid,
            fell=fell,
            unreachable=np.where(np.arange(missed.shape[1]) < valid[:, None], missed, 0).sum(axis=1),
            **whole,
        )

    def _carry_out(self, orders: Orders) -> dict[str, np.ndarray]:
        """What is shown over the orders' substeps, each (n, substep, ...)."""
        before = self._qpos[orders.ids]
        record = ("qpos", "sensordata", "actuator_force")
        seen = self._batch.rollout(orders.control.shape[1], orders.control, record=record, ids=orders.ids)
        touches = seen["sensordata"][:, :, self._columns.touch] > 0
        return {
            "qpos": np.concatenate([before[:, None], seen["qpos"][:, :-1]], axis=1),
            "sensors": seen["sensordata"],
            "standing": _standing(touches, self._unloaded, orders.ids, self._longest_gap),
            "targets": orders.tips,
            "force": seen["actuator_force"][:, :, : insect.JOINT_ACTUATORS],
            "missed": orders.missed,
        }

    def _begin_push(self, orders: Orders, steps: int) -> None:
        """Push those whose time has come for a stretch of `steps` steps that begins with the orders, no others."""
        if self._push:
            dt, push = self.settled.network.dt, self._push
            time = orders.plan.time[0] - dt
            now = (push.time >= time - 1e-9) & (push.time < time + steps * dt - 1e-9)
            force = np.where(now, push.impulse / (steps * self.settled.body.seconds(self.settled.network)), 0.0)
            self._batch.bind("xfrc_applied")[:, self.settled.mujoco_model.body("mesothorax").id, 1] = force


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    """Values over the substeps, (n, substep, ...), that follow each other."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


@njit(cache=True, nogil=True)
def _standing(touches: Any, unloaded: Any, ids: Any, longest_gap: float) -> Any:
    """Which feet stand, (n, substep, leg); `unloaded`, (start, leg), counts the substeps since they last touched."""
    standing = np.empty(touches.shape, dtype=np.bool_)
    for i, start in enumerate(ids):
        for t in range(touches.shape[1]):
            for leg in range(6):
                unloaded[start, leg] = 0 if touches[i, t, leg] else unloaded[start, leg] + 1
                standing[i, t, leg] = unloaded[start, leg] <= longest_gap
    return standing
