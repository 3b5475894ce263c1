"""Rollouts: settled starts follow a plan in MuJoCo, all at once on all cores, and chunks record their walks.

A start is dropped once its trunk has touched the ground. A feedback plan senses the bodies before each of its steps.
A plan without feedback is computed ahead: while MuJoCo's threads step one chunk, this thread plans the next chunk, and
the caller measures the previous one.

A chunk records the bodies before each physics step, since MuJoCo's sensors after a step belong to the state before it.
Of a fine step (`substeps`) it records the first part, but means of the ground's forces and of the acting torques.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.bodies.ground import beyond_the_ground
from hexmj.body import ROOT_QPOS, ROOT_QVEL
from hexmj.conditions import ROUNDING
from hexmj.controllers.protocol import FeedbackPlan, Plan, Sensed
from hexmj.errors import InputError, SimulationError, StillThrown
from hexmj.jitted import jitted
from hexmj.physics.divergence import explosion, most_energy, twice_gravity
from hexmj.physics.engine import Diverged, MujocoBatch, walk_error
from hexmj.physics.foot_path import Orders, OrdersFromPlan
from hexmj.physics.pushes import Push, steps_pushed
from hexmj.physics.settle import Settled
from hexmj.physics.substeps import FineSteps, Shown
from hexmj.progress import Progress
from hexmj.rotations import heading, lean, turned
from hexmj.walks import PlannedWalk, joined

RECORDED = ("qpos", "sensors", "standing", "load", "targets", "force", "torque", "depth")
"""Fields of `Chunk` that are recorded for each substep."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """Record of consecutive physics steps of the n starts that still walk."""

    plan: PlannedWalk
    """Plan of all starts over the chunk."""
    first: int
    """Index of the chunk's first substep, counted from the beginning of the walk."""
    ids: np.ndarray
    """(n,) indices of the starts that walk."""
    qpos: np.ndarray
    """(n, substep, position) positions at the beginning of each substep."""
    sensors: np.ndarray
    """(n, substep, column) `sensordata`, see `compiled.Columns`; forces of the ground are means over a fine step."""
    standing: np.ndarray
    """(n, substep, leg) whether the ground carried the foot within the last `Conditions.contact_gap`."""
    load: np.ndarray
    """(n, substep, leg) normal force of the ground on the foot, without adhesion [g mm/s^2]."""
    targets: np.ndarray
    """(n, substep, leg, 3) targets of the tips in the root frame [mm]."""
    force: np.ndarray
    """(n, substep, joint) torques of the servos at the beginning of each substep [g mm^2/s^2]."""
    torque: np.ndarray
    """(n, substep, joint) torques that act over each substep, see `engine.Rolled`; means in fine steps [g mm^2/s^2]."""
    depth: np.ndarray
    """(n, substep) depth of the deepest foot in the ground at the end of each substep [mm]; negative above ground."""
    valid: np.ndarray
    """(n,) number of substeps up to and including the fall; without a fall, of all substeps."""
    fell: np.ndarray
    """(n,) whether the trunk touches the ground within the chunk."""
    unreachable: np.ndarray
    """(n,) number of foot targets out of reach until the fall."""


def drive(
    settled: Settled,
    plan: Plan,
    duration: float,
    *,
    pushes: Sequence[Push] = (),
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Chunk]:
    """Yield the chunks in which settled starts walk by a plan.

    Args:
        settled: starts at rest.
        plan: plan of the same starts, at time 0.
        duration: observation time [time units].
        pushes: pushes of all starts.
        threads: number of threads, by default one per core; the result does not depend on it.
        progress: called with the fraction done since the last call.

    Raises:
        InputError: the plan has other starts or another stride, is not at time 0, or returns arrays of a wrong shape;
            or a push lies outside of the observation time.
        SimulationError: a simulation diverged; the error has its last finite state.
        StillThrown: the observation time ends while a push still throws a start; raised after the last chunk.
    """
    for push in pushes:
        push.check_within(duration, settled.conditions, settled.stride, len(settled.starts))
    divisor = math.gcd(*(push.divisor(settled.conditions, settled.stride) for push in pushes))
    rollout, orders = Rollout(settled, pushes, threads), OrdersFromPlan(settled, plan, duration, divisor)
    total, reported, walking = orders.steps * settled.substeps, 0.0, np.arange(len(settled.starts))
    chunks = _with_feedback(rollout, plan, orders) if isinstance(plan, FeedbackPlan) else _planned(rollout, orders)
    for chunk in chunks:
        yield chunk
        if progress:
            done = 1.0 if chunk.fell.all() else min(1.0, (chunk.first + chunk.qpos.shape[1]) / total)
            progress(done - reported)
            reported = done
        walking = chunk.ids[~chunk.fell]
    if pushes:
        rollout.check_landed(walking)


def _planned(rollout: "Rollout", orders: OrdersFromPlan) -> Iterator[Chunk]:
    """Yield the chunks of a plan without feedback; the next chunk is planned while one is stepped."""
    now = orders.ahead(np.arange(len(rollout.settled.starts)))
    with ThreadPoolExecutor(1) as stepper:
        stepping = now and stepper.submit(rollout.carry_out, [now])
        while now and stepping:
            ahead = orders.ahead(now.ids)
            chunk = stepping.result()
            now = ahead.only(~chunk.fell) if ahead and not chunk.fell.all() else None
            stepping = now and stepper.submit(rollout.carry_out, [now])
            yield chunk


def _with_feedback(rollout: "Rollout", plan: FeedbackPlan, orders: OrdersFromPlan) -> Iterator[Chunk]:
    """Yield the chunks of a plan that senses the bodies before each of its steps."""
    ids = np.arange(len(rollout.settled.starts))
    while len(ids) and (steps := orders.steps_ahead()):
        chunk = rollout.carry_out(next_orders(rollout, plan, orders, ids, steps))
        yield chunk
        ids = ids[~chunk.fell]


def next_orders(
    rollout: "Rollout", plan: Plan, orders: OrdersFromPlan, ids: np.ndarray, steps: int
) -> Iterator[Orders]:
    """Yield the orders of the starts `ids`, (n,), for the next steps of a plan: step by step if it has feedback."""
    feedback = plan if isinstance(plan, FeedbackPlan) else None
    for part in [1] * steps if feedback else [steps]:
        if feedback:
            feedback.sense(rollout.sensed(ids))
        if now := orders.ahead(ids, part):
            yield now


class Rollout:
    """Settled starts that carry out orders in MuJoCo."""

    def __init__(self, settled: Settled, pushes: Sequence[Push] = (), threads: int | None = None) -> None:
        """Put all starts at rest; `threads` threads step them, by default one per core."""
        self.settled, self._pushes, self._columns = settled, pushes, settled.compiled.columns
        self._pushed = np.zeros(len(settled.starts))  # sum of the impulses' sizes [g mm/s]
        self._batch = MujocoBatch(settled.compiled, len(settled.starts), threads)
        self._batch.put(np.arange(len(settled.starts)), settled.state)
        self._steps, self._senses = FineSteps.of(self._batch, settled.substeps, settled.compiled), Senses(settled)

    def sensed(self, ids: np.ndarray) -> Sensed:
        """Return what the starts `ids`, (n,), sense now."""
        return self._senses.sensed(ids, self._batch.qpos[ids], self._batch.qvel[ids])

    def carry_out(self, orders: Iterable[Orders]) -> Chunk:
        """Carry out successive orders for the same starts and return their chunk; no push begins or ends within it.

        Each item of `orders` is requested after the previous item is carried out, so it may depend on the new state.

        Raises:
            SimulationError: a simulation diverged or exploded.
            InputError: a walk crosses an edge of the ground.
        """
        first = next(rest := iter(orders))
        self._apply_push(first)
        before = self._batch.states(first.ids)
        done, records = [first], [self._step(first)]
        for order in rest:
            records.append(self._step(order))
            done.append(order)
        whole: dict[str, Any] = {name: _joined([record[name] for record in records]) for name in RECORDED}
        touching = (whole["sensors"][:, :, self._columns.trunk] > 0).any(axis=2)
        fell = touching.any(axis=1)
        valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
        centre = whole["sensors"][:, :, self._columns.centre_of_mass]
        if exploded := explosion(whole["qpos"], centre, valid, self._pushed[first.ids], self.settled):
            row, substep, text = exploded
            raise self._error(Diverged(int(first.ids[row]), text, self._batch.named(before[row]), substep), first)
        self._check_ground(whole["sensors"], valid, first.ids)
        missed = _joined([order.missed for order in done]).sum(axis=2)
        unreachable = np.where(np.arange(missed.shape[1]) < valid[:, None], missed, 0).sum(axis=1)
        plan = joined([order.plan for order in done])
        return Chunk(plan, first.first, first.ids, **whole, valid=valid, fell=fell, unreachable=unreachable)

    def check_landed(self, ids: np.ndarray) -> None:
        """Raise StillThrown if a pushed start among `ids`, (n,), still has more energy than a walk without a push."""
        pushed, settled = self._pushed[ids] != 0.0, self.settled
        speed = np.linalg.norm(self._batch.qvel[ids, :3], axis=1)
        height = self._batch.qpos[ids, 2] - settled.conditions.highest_ground
        energy, most = height + speed**2 / twice_gravity(settled), most_energy(settled, np.zeros(1))[0]
        for row in np.flatnonzero(pushed & (energy > most)):
            raise StillThrown(
                f"start {ids[row]} is still thrown by its push at the end: its root is {height[row]:.3g} mm above the"
                f" ground and moves at {speed[row]:.3g} mm/s; use a longer observation time or a weaker push"
            )

    def _step(self, orders: Orders) -> Shown:
        """Step the bodies over the substeps of the orders, and return the record by the names in `RECORDED`."""
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

    def _check_ground(self, sensors: np.ndarray, valid: np.ndarray, ids: np.ndarray) -> None:
        """Raise InputError if a foot crosses an edge of the ground before the fall."""
        conditions = self.settled.conditions
        feet = sensors[:, :, self._columns.foot].reshape(len(ids), -1, 6, 3)
        beyond = beyond_the_ground(conditions, feet).any(axis=2)
        beyond &= np.arange(sensors.shape[1]) < valid[:, None]
        if beyond.any():
            row, substep = np.argwhere(beyond)[0]
            x, y, _ = feet[row, substep].mean(axis=0).round().tolist()
            place = f"x = {x:g} mm, y = {y:g} mm"
            raise InputError(f"start {ids[row]} leaves the {conditions.ground} at {place}; use a shorter walk")

    def _error(self, error: Diverged, orders: Orders) -> SimulationError:
        """Return the user's error for a start that diverged while it carried out orders."""
        time = orders.plan.time[0] + (error.substep / self.settled.substeps - 1) * self.settled.stride.dt
        doing = f"walking at V = {orders.plan.velocity[0, error.start]:g}"
        return walk_error(error, doing, time)

    def _apply_push(self, orders: Orders) -> None:
        """Apply the forces of all pushes that act when the orders begin, and no others."""
        if self._pushes:
            self._batch.push[:] = 0.0
        stride, conditions = self.settled.stride, self.settled.conditions
        for push in self._pushes:
            if push.impulse.any():
                begin, first = push.begins(stride), orders.first // self.settled.substeps
                lasts = steps_pushed(conditions, stride)
                now = (begin <= first) & (first < begin + lasts)
                self._batch.push[:] += now[:, None] * (push.vector / (lasts * conditions.seconds(stride)))
                self._pushed += (begin == first) * np.abs(push.impulse)


class Senses:
    """Sensory state of starts; a foot stands if the ground carried it within the last `Conditions.contact_gap`."""

    def __init__(self, settled: Settled) -> None:
        """Begin with all feet standing."""
        self._compiled = settled.compiled
        self._unloaded = np.zeros(settled.starts.shape, dtype=int)  # substeps since the ground last carried a foot
        gap = settled.conditions.contact_gap / 1000.0 / settled.compiled.model.opt.timestep
        self._longest_gap = math.floor(gap * (1.0 + ROUNDING))  # substeps
        self._before = np.ones(settled.starts.shape, dtype=bool)
        self._load, self._torques = settled.load.copy(), settled.torques.copy()

    def restart(self, ids: np.ndarray, settled: Settled) -> None:
        """Put the starts `ids`, (n,), at rest again, with the loads and torques of `settled`."""
        self._unloaded[ids], self._before[ids] = 0, True
        self._load[ids], self._torques[ids] = settled.load, settled.torques

    def feel(self, ids: np.ndarray, sensors: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Update the sensory state of some starts by their next substeps.

        Args:
            ids: indices of the starts, (n,).
            sensors: `sensordata` of each substep, (n, substep, column).
            force: forces of the actuators, joints first, (n, substep, actuator).

        Returns:
            Whether each foot stands in each substep, and the normal force of the ground on it, without adhesion
            [g mm/s^2]; both are (n, substep, leg).
        """
        felt = self._unloaded, self._load, self._torques
        loads = self._compiled.carried(sensors, force)
        touch = sensors[..., self._compiled.columns.touch]
        return _feel(ids, touch, loads, force, self._longest_gap, felt), loads

    def standing(self, ids: np.ndarray | slice = np.s_[:]) -> np.ndarray:
        """Return whether each foot of the starts `ids` stands now, (n, leg); by default for all starts."""
        return self._unloaded[ids] <= self._longest_gap

    def sensed(self, ids: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> Sensed:
        """Return what some starts sense now; contacts are gained or lost relative to the previous call.

        Args:
            ids: indices of the starts, (n,).
            qpos: present positions, (n, position).
            qvel: present velocities, (n, velocity).
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
    """Compute `Senses.feel` and update `felt`: substeps without touch, loads, (start, leg), torques, (start, joint)."""
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


def _joined(values: list[np.ndarray]) -> np.ndarray:
    """Join arrays, (n, substep, ...), along the substeps."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)
