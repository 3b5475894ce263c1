"""Settled insects carry out orders, and every stretch shows what happened.

A stretch shows the insects before each of their physics steps: what MuJoCo's sensors hold after a step belongs to the
state before it.  Of a step in parts (`strikes`) it shows the first part, but for the ground's forces and the depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from hexmj.physics import insect
from hexmj.physics.joint_targets import Orders
from hexmj.physics.kinematics import joints_to_tips
from hexmj.physics.settling import Settled
from hexmj.physics.stepping import Shown, Stepper
from hexmj.walks import Walk, joined

PUSH_LASTS = 0.025
"""How long a push lasts [s]."""

SHOWN = ("qpos", "sensors", "standing", "targets", "force", "depth")
"""What is shown of every start, see `Stretch`."""


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
    """(n, substep, column), see `insect.Sensors`; the ground's forces are means over a step in parts."""
    standing: np.ndarray
    """(n, substep, leg) whether the ground carried the foot within the last `Body.contact_gap`."""
    targets: np.ndarray
    """(n, substep, leg, 3) where the tips shall be, in the root frame [mm]."""
    force: np.ndarray
    """(n, substep, joint) torques of the joints [g mm^2/s^2]."""
    depth: np.ndarray
    """(n, substep) how deep the deepest foot gets in the ground by the end of each substep [mm]; negative above it."""
    valid: np.ndarray
    """(n,) substeps up to the fall, that one included."""
    fell: np.ndarray
    """(n,) whether the trunk touched the ground."""
    unreachable: np.ndarray
    """(n,) targets out of reach."""


@dataclass(frozen=True, eq=False)
class Push:
    """A push from the side at the root, for each start; it lasts `PUSH_LASTS`, in whole steps of the network."""

    impulse: np.ndarray
    """(start,) to the left [g mm/s]."""
    time: np.ndarray
    """(start,) when it begins, rounded down to a multiple of how long it lasts [time units]."""


class Insects:
    """Settled starts, wherever their steps have brought them."""

    def __init__(self, settled: Settled, push: Push | None = None, threads: int | None = None) -> None:
        """Put all at rest; `threads` step them, one per core unless given."""
        self.settled = settled
        self._push = push
        self._stepper = Stepper(settled, threads)
        self._columns, self._legs = insect.sensors(settled.mujoco_model), insect.dimensions(settled.mujoco_model)
        self._unloaded = np.zeros((len(settled.starts), 6), dtype=int)
        self._longest_gap = settled.body.contact_gap / 1000.0 / settled.mujoco_model.opt.timestep

    def tips(self, ids: np.ndarray) -> np.ndarray:
        """Where the joint angles put the tips of some starts, on their axes, (n, leg) [mm]."""
        joints = self._stepper.qpos[ids, insect.ROOT_QPOS :].reshape(-1, 6, 3)
        return joints_to_tips(joints, self._legs)[..., 0] - np.array(self.settled.network.geometry.origin)

    def carried(self, ids: np.ndarray) -> np.ndarray:
        """Which feet of some starts the ground carried within the last `Body.contact_gap`, (n, leg)."""
        return self._unloaded[ids] <= self._longest_gap

    def obey(self, ordered: Iterable[Orders], steps: int) -> Stretch:
        """Carry out orders for the same starts, one after the other; together they last `steps` steps of the network.

        Each is asked for when those before it are done, so it may depend on what they have done.
        """
        done: list[Orders] = []
        shown: list[Shown] = []
        for orders in ordered:
            if not done:
                self._apply_push(orders, steps)
            shown.append(self._carry_out(orders))
            done.append(orders)
        whole: dict[str, Any] = {name: _joined([part[name] for part in shown]) for name in SHOWN}
        touching = (whole["sensors"][:, :, self._columns.trunk] > 0).any(axis=2)
        fell = touching.any(axis=1)
        valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
        missed = _joined([orders.missed for orders in done])
        return Stretch(
            plan=joined([orders.plan for orders in done]),
            first=done[0].first,
            ids=done[0].ids,
            valid=valid,
            fell=fell,
            unreachable=np.where(np.arange(missed.shape[1]) < valid[:, None], missed, 0).sum(axis=1),
            **whole,
        )

    def _carry_out(self, orders: Orders) -> Shown:
        """What is shown over the orders' substeps."""
        shown = self._stepper.take(orders)
        touches = shown["sensors"][:, :, self._columns.touch] > 0
        standing = _standing(touches, self._unloaded, orders.ids, self._longest_gap)
        return shown | {"standing": standing, "targets": orders.tips}

    def _apply_push(self, orders: Orders, steps: int) -> None:
        """Push with the part of the impulse that falls within the `steps` of the network that begin with the orders."""
        if self._push:
            network, seconds = self.settled.network, self.settled.body.seconds(self.settled.network)
            first, lasts = orders.first // self.settled.body.substeps(network), max(1, round(PUSH_LASTS / seconds))
            begin = np.floor(self._push.time / network.dt + 1e-9) // lasts * lasts
            within = np.minimum(begin + lasts, first + steps) - np.maximum(begin, first)
            self._stepper.push[:] = np.maximum(within, 0.0) / lasts * self._push.impulse / (steps * seconds)


def _joined(values: list[np.ndarray]) -> np.ndarray:
    """Values over the substeps, (n, substep, ...), that follow each other."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)


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
