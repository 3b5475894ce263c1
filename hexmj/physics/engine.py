"""MuJoCo's batch: many bodies side by side on a pool of threads. No other module steps MuJoCo in bulk.

Any class that implements `Engine` can replace it. While a batch steps, MuJoCo's warnings are not logged and its clock
is stopped: without the clock bodies walk 5 % faster (measured), to the same bits.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock
from typing import Any, Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch
from numba import cfunc

from hexmj.bodies.compiled import CompiledBody
from hexmj.errors import SimulationError
from hexmj.jitted import jitted
from hexmj.rotations import lowest
from hexmj.threads import check_memory, thread_count

STATE = ("qpos", "qvel", "qacc_warmstart")
"""MuJoCo's arrays that make up the state of a body: they determine its further motion."""

STATE_BITS = int(mujoco.mjtState.mjSTATE_QPOS | mujoco.mjtState.mjSTATE_QVEL | mujoco.mjtState.mjSTATE_WARMSTART)
"""MuJoCo's flags for the arrays in `STATE`, which make it record them as one array."""

MEMORY = 120_000
"""Memory per body while it walks, measured for the stick insect [bytes]."""

CLEAR = 0.01
"""Height of the trunk above flat ground, in standing heights, above which contacts are not computed."""

INTERRUPTIBLE = 20_000
"""Maximum number of steps, summed over bodies, between two chances for Ctrl-C during settling; they take 0.2 s."""


@dataclass(frozen=True, eq=False)
class Rolled:
    """Record of n bodies over physics steps."""

    before: np.ndarray
    """(n, state) states before the first step, as `Engine.put` takes them."""
    feet: np.ndarray
    """(n, 1 + step, leg, 3) feet in the world before the first step and after each step [mm]."""
    sensors: np.ndarray
    """(n, step, column) `sensordata` at the beginning of each step."""
    force: np.ndarray
    """(n, step, actuator) forces of the actuators at the beginning of each step [g mm^2/s^2]."""
    torque: np.ndarray
    """(n, step, joint) torques that act over each step, with the damping of the speed at its end [g mm^2/s^2]."""
    after: np.ndarray
    """(n, step, state) states after each step, as `Engine.put` takes them."""


class Engine(Protocol):
    """Interface of an engine, which steps independent bodies side by side."""

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Set the states, (n, state), of the bodies with the indices `ids`, (n,)."""
        ...

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Step the bodies `ids`, (n,), with some controls, (n, step, actuator), and return their record.

        With `parts` above 1 a physics step is divided: each row of the controls is for one part. Contacts are then as
        hard as possible, with a time constant of two parts.

        Raises:
            Diverged: the state of a body is not finite, or MuJoCo warns that a body diverges.
        """
        ...


class Diverged(Exception):
    """Raised if a body diverged; `walk_error` converts it into the user's error."""

    def __init__(self, start: int, kinds: str, state: dict[str, np.ndarray], substep: int = 0) -> None:
        """`start` is the body's index, `kinds` describes the failure, `state` is the last finite state."""
        super().__init__(start, kinds)
        self.start, self.kinds, self.state, self.substep = start, kinds, state, substep


def walk_error(error: Diverged, doing: str, time: float) -> SimulationError:
    """Return the user's error for a body that diverged while `doing`, such as "settling", at a time [time units]."""
    message = f"start {error.start} diverged while {doing}, at {time:.4g} time units: {error.kinds}"
    return SimulationError(message, error.state)


class MujocoBatch:
    """An `Engine` that steps many copies of one compiled body in MuJoCo's batch."""

    qpos: np.ndarray
    """(start, position) current positions."""
    qvel: np.ndarray
    """(start, velocity) current velocities."""
    push: np.ndarray
    """(start, 2) force on the root, ahead and to the left in the world [g mm/s^2]; 0 unless the caller sets it."""

    def __init__(self, compiled: CompiledBody, count: int, threads: int | None) -> None:
        """Create `count` bodies, which `threads` threads step, by default one per core."""
        check_memory(f"{count} starts in one physical walk", MEMORY * count)
        self._model, self._root = compiled.model, compiled.root
        model = compiled.model
        self._batch = Batch(model, count, thread_count(threads))
        self._timestep, self._contact = self._batch.expand("opt.timestep"), self._batch.expand("pair_solref")
        self._disabled, self._corners = self._batch.expand("opt.disableflags"), compiled.trunk_corners
        flat = compiled.conditions.ground == "flat"
        self._clear = CLEAR * compiled.conditions.body.standing_height if flat else np.inf
        self._state = [self._batch.bind(name) for name in STATE]
        self._ends = np.cumsum([values.shape[1] for values in self._state])[:-1]
        self.qpos, self.qvel = self._state[:2]
        self.push = self._batch.bind("xfrc_applied")[:, compiled.root, :2]
        self.sensors, self._foot = self._batch.bind("sensordata"), compiled.columns.foot
        self.force = self._batch.bind("actuator_force")
        servos, speeds = compiled.columns.ctrl, compiled.columns.qvel.start + model.nq
        self._joints = speeds, servos.start, -model.actuator_biasprm[servos, 2], compiled.torque_limits

    def reset(self) -> None:
        """Put all bodies into their initial state, including bodies that diverged."""
        self._batch.warning[:] = 0
        with stepping():
            self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)

    def states(self, ids: np.ndarray) -> np.ndarray:
        """Return the states of the bodies `ids`, (n, state), as `put` takes them."""
        return np.concatenate([values[ids] for values in self._state], axis=1)

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Set the states of bodies, see `Engine.put`."""
        for values, current in zip(np.split(states, self._ends, axis=1), self._state, strict=True):
            current[ids] = values

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrices from root frames to the world, (start, axis, axis), as of the last update of positions."""
        return self._batch.bind("xmat")[:, self._root].reshape(-1, 3, 3)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put the bodies `ids` into states of rest, (n, state), and update their positions.

        `control`, (n, actuator), is for engines that need the joint targets in advance; this engine does not.
        """
        self._batch.warning[ids] = 0
        self.put(ids, states)
        with stepping():
            self._update(ids)

    def rest(self, control: np.ndarray, steps: int) -> None:
        """Step all bodies with constant controls, (start, actuator), and update their sensors and forces.

        Raises:
            Diverged: see `Engine.roll`.
        """
        ids = np.arange(len(control))
        before = self.states(ids)
        self._batch.bind("ctrl")[:] = control
        with stepping():
            while steps > (at_once := max(1, INTERRUPTIBLE // len(ids))):
                self._batch.step(nstep=at_once)
                steps -= at_once
            self._batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_ACC)
        self._check(ids, before)

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Step bodies and return their record, see `Engine.roll`."""
        model, before = self._model, self.states(ids)
        if parts > 1:
            timestep = model.opt.timestep / parts
            self._timestep[ids], self._contact[ids, :, 0] = timestep, 2 * timestep
        record = (STATE_BITS, "sensordata", "actuator_force")
        try:
            with stepping():
                seen = self._batch.rollout(control.shape[1], control, record=record, ids=ids)
                self._check(ids, before)
                self._update(ids)  # positions of the feet after the last step
        finally:
            if parts > 1:
                self._timestep[ids], self._contact[ids] = model.opt.timestep, model.pair_solref
        feet = [sensors[:, :, self._foot] for sensors in (seen["sensordata"], self.sensors[ids, None])]
        places = np.concatenate(feet, axis=1).reshape(len(ids), 1 + control.shape[1], 6, 3)
        torque = _acting(before, seen[STATE_BITS], seen["actuator_force"], *self._joints)
        return Rolled(before, places, seen["sensordata"], seen["actuator_force"], torque, seen[STATE_BITS])

    def named(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """Return the arrays of one body's state, (state,), by the names in `STATE`."""
        return dict(zip(STATE, np.split(state, self._ends), strict=True))

    def _update(self, ids: np.ndarray) -> None:
        """Update positions, but contacts only of trunks near the ground: contacts take two fifths of the time."""
        flags = self._model.opt.disableflags
        above = ids[_lowest(ids, self.qpos, *self._corners) > self._clear]
        self._disabled[above] = flags | mujoco.mjtDisableBit.mjDSBL_CONTACT.value
        try:
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        finally:
            self._disabled[above] = flags

    def _check(self, ids: np.ndarray, before: np.ndarray) -> None:
        """Raise `Diverged` for the first body that diverged; `before`, (n, state), holds the last finite states."""
        warned = self._batch.warning
        i = _first_broken(ids, warned, self.qpos)
        if i < len(ids):
            kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned[ids[i], :, 1])]
            raise Diverged(int(ids[i]), ", ".join(kinds) or "a state that is not finite", self.named(before[i]))


@cfunc("float64()")
def _stopped_clock() -> float:
    return 0.0


_lock, _users = Lock(), []  # the user's callbacks (clock, warning), once for each thread that steps


@contextmanager
def stepping() -> Iterator[None]:
    """Stop MuJoCo's clock and its log of warnings within the block; the last thread restores the user's callbacks."""
    with _lock:
        _users.append(_users[0] if _users else (mujoco.get_mjcb_time(), mujoco.get_mju_user_warning()))
        if len(_users) == 1:
            mujoco.set_mjcb_time(_stopped_clock.ctypes)
            mujoco.set_mju_user_warning(_users[0][1] or (lambda warning: None))
    try:
        yield
    finally:
        with _lock:
            clock, warning = _users.pop()
            if not _users:
                mujoco.set_mjcb_time(clock)
                mujoco.set_mju_user_warning(warning)


@jitted
def _acting(before: Any, after: Any, force: Any, speeds: int, servos: int, damping: Any, limits: Any) -> Any:
    """Return the torques that act on the joints over each step, (n, step, joint).

    MuJoCo integrates the damping of a servo implicitly (with the speed after the step), except at the torque limit.

    Args:
        before: states before the first step, (n, state).
        after: states after each step, (n, step, state).
        force: forces of the actuators at the beginning of each step, (n, step, actuator).
        speeds: column of the states with the speed of the first joint.
        servos: column of the forces with the servo of the first joint.
        damping: damping of each servo, (joint,).
        limits: torque limit of each servo, (joint,).
    """
    torque = np.empty((force.shape[0], force.shape[1], len(damping)))
    for n in range(torque.shape[0]):
        for step in range(torque.shape[1]):
            was = after[n, step - 1] if step else before[n]
            for joint in range(len(damping)):
                pull, at = force[n, step, servos + joint], speeds + joint
                slowed = damping[joint] * (after[n, step, at] - was[at])
                torque[n, step, joint] = pull if abs(pull) >= limits[joint] else pull - slowed
    return torque


@jitted
def _lowest(ids: Any, qpos: Any, corners: Any, radii: Any) -> Any:
    """Return the height of the lowest point of each trunk, (n,) [mm], from `CompiledBody.trunk_corners`."""
    heights = np.empty(len(ids))
    for i, n in enumerate(ids):
        heights[i] = lowest(qpos[n], corners, radii)
    return heights


@jitted
def _first_broken(ids: Any, warned: Any, qpos: Any) -> int:
    """Return the index in `ids` of the first body with a warning, (start, kind, [last, count]), or with positions that
    are not finite; `len(ids)` if there is none."""
    for i, n in enumerate(ids):
        for kind in range(warned.shape[1]):
            if warned[n, kind, 1] > 0:
                return i
        for value in qpos[n]:
            if not np.isfinite(value):
                return i
    return len(ids)
