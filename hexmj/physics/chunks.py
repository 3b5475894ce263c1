"""Settled insects carry out orders, and every chunk of steps shows what happened.

A chunk shows the insects before each of their physics steps: what MuJoCo's sensors hold after a step belongs to the
state before it.  Of a step in parts (`fine_steps`) it shows the first part, but for the ground's forces, the torques
that acted and the depth.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.ground import WITH_ENDS, beyond_the_ground
from hexmj.controllers.protocol import Sensed
from hexmj.errors import InputError, SimulationError
from hexmj.physics.backend import Diverged, MujocoBatch
from hexmj.physics.divergence import walk_error
from hexmj.physics.explosions import check_landed, explosion
from hexmj.physics.fine_steps import FineSteps, Shown
from hexmj.physics.orders import Orders
from hexmj.physics.pushes import Push, steps_pushed
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import Settled
from hexmj.walks import PlannedWalk, joined

SHOWN = ("qpos", "sensors", "standing", "load", "targets", "force", "torque", "depth")
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
    """(n, substep, leg) whether the ground carried the foot within the last `Conditions.contact_gap`."""
    load: np.ndarray
    """(n, substep, leg) force of the ground on the foot along its normal, adhesion taken off [g mm/s^2]."""
    targets: np.ndarray
    """(n, substep, leg, 3) where the tips shall be, in the root frame [mm]."""
    force: np.ndarray
    """(n, substep, joint) torques of the joints [g mm^2/s^2]."""
    torque: np.ndarray
    """(n, substep, joint) the same as they acted over each substep, their means over a step in parts."""
    depth: np.ndarray
    """(n, substep) how deep the deepest foot gets in the ground by the end of each substep [mm]; negative above it."""
    valid: np.ndarray
    """(n,) substeps up to the fall, that one included."""
    fell: np.ndarray
    """(n,) whether the trunk touched the ground."""
    unreachable: np.ndarray
    """(n,) targets out of reach."""


class Insects:
    """Settled starts, wherever their steps have brought them."""

    def __init__(self, settled: Settled, push: Push | None = None, threads: int | None = None) -> None:
        """Put all at rest; `threads` step them, one per core unless given."""
        self.settled, self._push, self._columns = settled, push, settled.compiled.columns
        self._pushed = np.zeros(len(settled.starts))  # by impulses that add up, whatever their direction [g mm/s]
        self._batch = MujocoBatch(settled.compiled, len(settled.starts), threads)
        self._batch.put(np.arange(len(settled.starts)), settled.state)
        self._steps, self._senses = FineSteps.of(self._batch, settled.substeps, settled.compiled), Senses(settled)

    def sensed(self, ids: np.ndarray) -> Sensed:
        """What some starts know of themselves now."""
        return self._senses.sensed(ids, self._batch.qpos[ids], self._batch.qvel[ids])

    def carry_out(self, ordered: Iterable[Orders]) -> Chunk:
        """Carry out orders for the same starts, one after the other; no push begins or ends within them.

        Each is asked for when those before it are done, so it may depend on what they have done.

        Raises:
            SimulationError: a simulation that diverged, or a walk that exploded.
            InputError: a walk that leads beyond the ground.
        """
        first = next(rest := iter(ordered))
        self._apply_push(first)
        before = self._batch.replayed(first.ids)
        done, shown = [first], [self._show(first)]
        for orders in rest:
            shown.append(self._show(orders))
            done.append(orders)
        whole: dict[str, Any] = {name: _joined([part[name] for part in shown]) for name in SHOWN}
        touching = (whole["sensors"][:, :, self._columns.trunk] > 0).any(axis=2)
        fell = touching.any(axis=1)
        valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
        centre = whole["sensors"][:, :, self._columns.centre_of_mass]
        if odd := explosion(whole["qpos"], centre, valid, self._pushed[first.ids], self.settled):
            control = _joined([orders.control for orders in done])[odd.row, : odd.substep + 1]
            start = int(first.ids[odd.row])
            state = self._batch.saved(before, odd.row, start, control) | {"substeps": np.array(self.settled.substeps)}
            raise self._error(Diverged(start, odd.what, state, odd.substep), first)
        self._check_ground(whole["sensors"], valid, first.ids)
        missed = _joined([orders.missed for orders in done]).sum(axis=2)
        unreachable = np.where(np.arange(missed.shape[1]) < valid[:, None], missed, 0).sum(axis=1)
        plan = joined([orders.plan for orders in done])
        return Chunk(plan, first.first, first.ids, **whole, valid=valid, fell=fell, unreachable=unreachable)

    def check_landed(self, ids: np.ndarray) -> None:
        """Refuse starts that have not fallen, (n,), and are still thrown by their push.

        Raises:
            StillThrown: the first of them.
        """
        check_landed(ids, self._batch.qpos[ids], self._batch.qvel[ids], self._pushed[ids], self.settled)

    def _check_ground(self, sensors: np.ndarray, valid: np.ndarray, ids: np.ndarray) -> None:
        """Refuse walks, (n, substep, column) until they fall, that lead beyond the ground that was laid."""
        conditions = self.settled.conditions
        if conditions.ground not in WITH_ENDS:
            return
        feet = sensors[:, :, self._columns.foot].reshape(len(ids), -1, 6, 3)
        beyond = beyond_the_ground(conditions, feet).any(axis=2)
        beyond &= np.arange(sensors.shape[1]) < valid[:, None]
        if beyond.any():
            row, substep = np.argwhere(beyond)[0]
            x, y, _ = feet[row, substep].mean(axis=0).round().tolist()
            raise InputError(
                f"start {ids[row]} walks off the {conditions.ground} at x = {x:g} mm, y = {y:g} mm;"
                " expected shorter walks, in which no start leaves it"
            )

    def _show(self, orders: Orders) -> Shown:
        """What is shown over the orders' substeps."""
        ids, width = orders.ids, self._batch.qpos.shape[1]
        before = self._batch.qpos[ids, None]
        try:
            shown = self._steps.take(ids, orders.control)
        except Diverged as error:
            raise self._error(error, orders) from None
        standing, load = self._senses.feel(ids, shown["sensors"], shown["force"])
        return shown | {
            "qpos": np.concatenate([before, shown["after"][:, :-1, :width]], axis=1),
            "force": shown["force"][:, :, self._columns.ctrl],
            "standing": standing,
            "load": load,
            "targets": orders.tips,
        }

    def _error(self, error: Diverged, orders: Orders) -> SimulationError:
        """What became of an insect while it carried out orders."""
        time = orders.plan.time[0] + (error.substep / self.settled.substeps - 1) * self.settled.stride.dt
        doing = f"walking at V = {orders.plan.velocity[0, error.start]:g}"
        return walk_error(error, doing, time, self.settled.conditions)

    def _apply_push(self, orders: Orders) -> None:
        """Push those whose push goes on as the orders begin."""
        if self._push:
            self._batch.push[:] = 0.0
        if self._push and self._push.impulse.any():
            stride, seconds = self.settled.stride, self.settled.conditions.seconds(self.settled.stride)
            first, lasts = orders.first // self.settled.substeps, steps_pushed(self.settled.conditions, stride)
            begin = self._push.begins(stride)
            now = (begin <= first) & (first < begin + lasts)
            self._batch.push[:] = now * (self._push.impulse / (lasts * seconds))
            self._pushed += (begin == first) * np.abs(self._push.impulse)


def _joined(values: list[np.ndarray]) -> np.ndarray:
    """Values over the substeps, (n, substep, ...), that follow each other."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)
