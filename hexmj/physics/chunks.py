"""Settled insects carry out orders, and every chunk of steps shows what happened.

A chunk shows the insects before each of their physics steps: what MuJoCo's sensors hold after a step belongs to the
state before it.  Of a step in parts (`fine_steps`) it shows the first part, but for the ground's forces and the depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.grounds import depth_in_ground
from hexmj.controllers.protocol import Sensed
from hexmj.physics.backend import Diverged, MujocoBatch
from hexmj.physics.divergence import walk_error
from hexmj.physics.fine_steps import SINK, FineSteps, Shown
from hexmj.physics.orders import Orders
from hexmj.physics.sensing import sensed
from hexmj.physics.settling import Settled
from hexmj.physics.standing import StandingFeet
from hexmj.walks import PlannedWalk, joined

PUSH_LASTS = 0.025
"""How long a push lasts [s]."""

SHOWN = ("qpos", "sensors", "standing", "targets", "force", "depth")
"""What is shown of every start, see `Chunk`."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """What some physics steps of the starts that still walk have shown."""

    plan: PlannedWalk
    """The plan over the chunk, of all starts."""
    first: int
    """Index of the first substep shown."""
    ids: np.ndarray
    """(n,) which starts these are."""
    qpos: np.ndarray
    """(n, substep, position)."""
    sensors: np.ndarray
    """(n, substep, column), see `compiled.Columns`; the ground's forces are means over a step in parts."""
    standing: np.ndarray
    """(n, substep, leg) whether the ground carried the foot within the last `Numerics.contact_gap`."""
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
    """A push from the side at the root, for each start; it lasts `PUSH_LASTS`, in whole steps of the plan."""

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
        compiled, conditions = settled.compiled, settled.conditions
        self._columns = compiled.columns
        self._batch = MujocoBatch(compiled, len(settled.starts), threads)
        self._batch.put(np.arange(len(settled.starts)), settled.state)
        self._steps = FineSteps(
            self._batch,
            conditions.substeps(settled.stride),
            lambda feet: depth_in_ground(conditions.ground, conditions.body.lengths, feet, compiled.foot_radius),
            SINK * conditions.path.standing_height,
            self._columns.touch,
        )
        self._standing = StandingFeet(len(settled.starts), conditions, compiled.model.opt.timestep)
        self._load, self._torques = settled.load.copy(), settled.torques.copy()
        self._contact = np.ones((len(settled.starts), 6), dtype=bool)

    def sensed(self, ids: np.ndarray) -> Sensed:
        """What some starts know of themselves now; contacts gained and lost are those since this was last asked."""
        qpos, qvel, contact = self._batch.qpos[ids], self._batch.qvel[ids], self._standing.now(ids)
        before, self._contact[ids] = self._contact[ids], contact
        return sensed(ids, qpos, qvel, contact, before, self._load[ids], self._torques[ids], self.settled.compiled)

    def obey(self, ordered: Iterable[Orders], steps: int) -> Chunk:
        """Carry out orders for the same starts, one after the other; together they last `steps` steps of the plan.

        Each is asked for when those before it are done, so it may depend on what they have done.

        Raises:
            SimulationError: a simulation that diverged.
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
        return Chunk(
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
        ids, width = orders.ids, self._batch.qpos.shape[1]
        before = self._batch.qpos[ids, None]
        try:
            shown = self._steps.take(ids, orders.control)
        except Diverged as error:
            dt, conditions = self.settled.stride.dt, self.settled.conditions
            time = orders.plan.time[0] + (error.substep / conditions.substeps(self.settled.stride) - 1) * dt
            doing = f"walking at V = {orders.plan.velocity[0, error.start]:g}"
            raise walk_error(error, doing, time, conditions) from None
        force = shown["force"][:, :, self._columns.ctrl]
        touch = shown["sensors"][:, :, self._columns.touch]
        self._load[ids], self._torques[ids] = touch[:, -1], force[:, -1]
        return shown | {
            "qpos": np.concatenate([before, shown["after"][:, :-1, :width]], axis=1),
            "force": force,
            "standing": self._standing.after(touch > 0, ids),
            "targets": orders.tips,
        }

    def _apply_push(self, orders: Orders, steps: int) -> None:
        """Push with the part of the impulse that falls within the `steps` of the plan that begin with the orders."""
        if self._push:
            stride, conditions = self.settled.stride, self.settled.conditions
            seconds = conditions.time.seconds(stride)
            first, lasts = orders.first // conditions.substeps(stride), max(1, round(PUSH_LASTS / seconds))
            begin = np.floor(self._push.time / stride.dt + 1e-9) // lasts * lasts
            within = np.minimum(begin + lasts, first + steps) - np.maximum(begin, first)
            self._batch.push[:] = np.maximum(within, 0.0) / lasts * self._push.impulse / (steps * seconds)


def _joined(values: list[np.ndarray]) -> np.ndarray:
    """Values over the substeps, (n, substep, ...), that follow each other."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)
