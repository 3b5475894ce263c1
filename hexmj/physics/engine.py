"""MuJoCo's batch: many bodies side by side on a pool of threads. The only module that steps MuJoCo in bulk.

Another engine is another module with an `Engine` in it. While a batch steps, MuJoCo's warnings are not logged and its
clock is stopped: without the clock bodies walk 5 % faster (measured), to the same bits.
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
"""Arrays that determine how a body goes on."""

STATE_BITS = int(mujoco.mjtState.mjSTATE_QPOS | mujoco.mjtState.mjSTATE_QVEL | mujoco.mjtState.mjSTATE_WARMSTART)
"""The same as a set of MuJoCo's state elements, which it records in one array."""

MEMORY = 120_000
"""Memory of a body while it walks, as measured for the stick insect [bytes]."""

CLEAR = 0.01
"""Height of a trunk above flat ground from which it cannot touch it, in standing heights."""

INTERRUPTIBLE = 20_000
"""Steps of one body between two chances for Ctrl-C while bodies settle; a fifth of a second."""


@dataclass(frozen=True, eq=False)
class Rolled:
    """Record of some bodies over physics steps."""

    before: np.ndarray
    """(n, state) before the first step; `Engine.put` takes it."""
    feet: np.ndarray
    """(n, 1 + step, leg, 3) before the first and after each step, in the world [mm]."""
    sensors: np.ndarray
    """(n, step, column) at the beginning of each step."""
    force: np.ndarray
    """(n, step, actuator) at the beginning of each step [g mm^2/s^2]."""
    torque: np.ndarray
    """(n, step, joint) as it acts over each step, in which the speed changes and with it the damping [g mm^2/s^2]."""
    after: np.ndarray
    """(n, step, state) after each step; `Engine.put` takes it."""


class Engine(Protocol):
    """Independent bodies that step side by side."""

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Set the states of some bodies, (n, state)."""
        ...

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Step some bodies with these controls, (n, step, actuator).

        With `parts` above 1 each row of the controls is a part of a step, and the time constant of the contacts is two
        parts, the hardest possible.

        Raises:
            Diverged: the state of a body is no longer finite, or MuJoCo warns of it.
        """
        ...


class Diverged(Exception):
    """One body that diverged; `walk_error` makes the user's error of it."""

    def __init__(self, start: int, kinds: str, state: dict[str, np.ndarray], substep: int = 0) -> None:
        """`start` is its index, `kinds` names what happened, `state` is the last finite one."""
        super().__init__(start, kinds)
        self.start, self.kinds, self.state, self.substep = start, kinds, state, substep


def walk_error(error: Diverged, doing: str, time: float) -> SimulationError:
    """The error of a body that diverged while it was `doing` something, at a time [time units]."""
    message = f"start {error.start} diverged while {doing}, at {time:.4g} time units: {error.kinds}"
    return SimulationError(message, error.state)


class MujocoBatch:
    """An `Engine`: MuJoCo's batch of one compiled body."""

    qpos: np.ndarray
    """(start, position), current."""
    qvel: np.ndarray
    """(start, velocity), current."""
    push: np.ndarray
    """(start,) force on the root to the left [g mm/s^2], 0 unless the caller sets it."""

    def __init__(self, compiled: CompiledBody, count: int, threads: int | None) -> None:
        """Make `count` bodies, stepped by `threads`, one per core unless given."""
        check_memory(f"{count} starts that walk at once in physics", MEMORY * count)
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
        self.push = self._batch.bind("xfrc_applied")[:, compiled.root, 1]
        self.sensors, self._foot = self._batch.bind("sensordata"), compiled.columns.foot
        self.force = self._batch.bind("actuator_force")
        servos, speeds = compiled.columns.ctrl, compiled.columns.qvel.start + model.nq
        self._joints = speeds, servos.start, -model.actuator_biasprm[servos, 2], compiled.torque_limits

    def reset(self) -> None:
        """Put all bodies into their initial state, those that diverged too."""
        self._batch.warning[:] = 0
        with stepping():
            self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)

    def states(self, ids: np.ndarray) -> np.ndarray:
        """The states of some bodies, (n, state); `put` takes them."""
        return np.concatenate([values[ids] for values in self._state], axis=1)

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """See `Engine.put`."""
        for values, current in zip(np.split(states, self._ends, axis=1), self._state, strict=True):
            current[ids] = values

    @property
    def rotation(self) -> np.ndarray:
        """From the root frames to the world, (start, axis, axis), if positions are up to date."""
        return self._batch.bind("xmat")[:, self._root].reshape(-1, 3, 3)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put some bodies into states of rest, (n, state), and update their positions.

        Controls, (n, actuator), are those of the steps to come, so this engine does not need them.
        """
        self._batch.warning[ids] = 0
        self.put(ids, states)
        with stepping():
            self._update(ids)

    def rest(self, control: np.ndarray, steps: int) -> None:
        """Step all bodies with one control, (start, actuator), and update everything that they show.

        Raises:
            Diverged: see `Engine.roll`.
        """
        ids = np.arange(len(control))
        before = self.states(ids)
        self._batch.bind("ctrl")[:] = control
        with stepping():
            while steps > (some := max(1, INTERRUPTIBLE // len(ids))):
                self._batch.step(nstep=some)
                steps -= some
            self._batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_ACC)
        self._check(ids, before)

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """See `Engine.roll`."""
        model, before = self._model, self.states(ids)
        if parts > 1:
            timestep = model.opt.timestep / parts
            self._timestep[ids], self._contact[ids, :, 0] = timestep, 2 * timestep
        record = (STATE_BITS, "sensordata", "actuator_force")
        try:
            with stepping():
                seen = self._batch.rollout(control.shape[1], control, record=record, ids=ids)
                self._check(ids, before)
                self._update(ids)  # for the feet at the end
        finally:
            if parts > 1:
                self._timestep[ids], self._contact[ids] = model.opt.timestep, model.pair_solref
        feet = [sensors[:, :, self._foot] for sensors in (seen["sensordata"], self.sensors[ids, None])]
        places = np.concatenate(feet, axis=1).reshape(len(ids), 1 + control.shape[1], 6, 3)
        torque = _acting(before, seen[STATE_BITS], seen["actuator_force"], *self._joints)
        return Rolled(before, places, seen["sensordata"], seen["actuator_force"], torque, seen[STATE_BITS])

    def named(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """The parts of a body's state, (state,), by the names in `STATE`."""
        return dict(zip(STATE, np.split(state, self._ends), strict=True))

    def _update(self, ids: np.ndarray) -> None:
        """Update positions, and contacts of trunks that may touch the ground: contacts take two fifths of the time."""
        usual = self._model.opt.disableflags
        above = ids[_lowest(ids, self.qpos, *self._corners) > self._clear]
        self._disabled[above] = usual | mujoco.mjtDisableBit.mjDSBL_CONTACT.value
        try:
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        finally:
            self._disabled[above] = usual

    def _check(self, ids: np.ndarray, before: np.ndarray) -> None:
        """Raise `Diverged` for the first body that did, with its state before, of (n, state)."""
        warned = self._batch.warning
        i = _first_broken(ids, warned, self.qpos)
        if i < len(ids):
            kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned[ids[i], :, 1])]
            raise Diverged(int(ids[i]), ", ".join(kinds) or "a state that is not finite", self.named(before[i]))


@cfunc("float64()")
def _stopped_clock() -> float:
    return 0.0


_lock, _users = Lock(), []  # the user's clock and warning callbacks, once for each thread that steps


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
    """Torques of the joints over each step, (n, step, joint), from the forces at its beginning and the states.

    The damping of a servo is integrated implicitly, except at the limit of its torque.

    Args:
        before: states before the first step, (n, state).
        after: states after each step, (n, step, state).
        force: of the actuators at the beginning of each step, (n, step, actuator).
        speeds: first column of the states that holds a joint's speed.
        servos: first column of the forces that holds a joint's servo.
        damping: of each servo, (joint,).
        limits: of each servo, (joint,).
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
    """Heights of the lowest points of some trunks, (n,) [mm], from `CompiledBody.trunk_corners`."""
    heights = np.empty(len(ids))
    for i, n in enumerate(ids):
        heights[i] = lowest(qpos[n], corners, radii)
    return heights


@jitted
def _first_broken(ids: Any, warned: Any, qpos: Any) -> int:
    """Index of the first body with a warning, (start, kind, [last, count]), or a state that is not finite; `len(ids)`
    if there is none."""
    for i, n in enumerate(ids):
        for kind in range(warned.shape[1]):
            if warned[n, kind, 1] > 0:
                return i
        for value in qpos[n]:
            if not np.isfinite(value):
                return i
    return len(ids)
