"""MuJoCo's batch: many bodies side by side on a pool of threads.  The only module that steps MuJoCo in bulk.

Another engine is another module with an `Engine` in it.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch

from hexmj.bodies.compiled import CompiledBody
from hexmj.jitted import jitted
from hexmj.physics.callbacks import batched
from hexmj.rotations import lowest
from hexmj.threads import thread_count

STATE = ("qpos", "qvel", "qacc_warmstart")
"""What a body goes on from."""

CLEAR = 0.01
"""How high a trunk is at least of which nothing touches flat ground, in standing heights."""

HEARD = 20_000
"""Steps of a body that are taken at rest before somebody who stops the program is heard; a fifth of a second."""

AFTER = int(mujoco.mjtState.mjSTATE_QPOS | mujoco.mjtState.mjSTATE_QVEL | mujoco.mjtState.mjSTATE_WARMSTART)
"""The same as MuJoCo records it, in one array."""


@dataclass(frozen=True, eq=False)
class Rolled:
    """What some bodies have shown over physics steps."""

    before: np.ndarray
    """(n, state) as they began; what `Engine.put` takes."""
    feet: np.ndarray
    """(n, 1 + step, leg, 3) before the first and after each step, in the world [mm]."""
    sensors: np.ndarray
    """(n, step, column) as each step begins."""
    force: np.ndarray
    """(n, step, actuator) as each step begins [g mm^2/s^2]."""
    torque: np.ndarray
    """(n, step, joint) as it acted over each step, in which the speed changes and with it the damping [g mm^2/s^2]."""
    after: np.ndarray
    """(n, step, state) after each step; what `Engine.put` takes."""


class Replayed(NamedTuple):
    """What replays some bodies from a moment on."""

    states: np.ndarray
    """(n, state)."""
    push: np.ndarray
    """(n,) force on the root to the left [g mm/s^2]."""


class Engine(Protocol):
    """Bodies that step side by side, none of which knows of another."""

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Put some bodies where they shall go on from, (n, state)."""
        ...

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Step some bodies with these controls, (n, step, actuator).

        With `parts` above 1 each row of the controls is a part of a step, and contacts are as hard as it allows: of
        two parts.

        Raises:
            Diverged: a body of which nothing can be made any more.
        """
        ...


class Diverged(Exception):
    """One body that diverged; `physics.divergence` makes a sentence of it."""

    def __init__(self, start: int, kinds: str, state: dict[str, np.ndarray], substep: int = 0) -> None:
        """`start` is its index, `kinds` names what happened, `state` replays it."""
        super().__init__(start, kinds)
        self.start, self.kinds, self.state, self.substep = start, kinds, state, substep


class MujocoBatch:
    """An `Engine`: MuJoCo's batch of one compiled body."""

    qpos: np.ndarray
    """(start, position), as they are now."""
    qvel: np.ndarray
    """(start, velocity), as they are now."""
    push: np.ndarray
    """(start,) force on the root to the left [g mm/s^2], 0 unless the caller sets it."""

    def __init__(self, compiled: CompiledBody, count: int, threads: int | None) -> None:
        """As many bodies; `threads` step them, one per core unless given."""
        self._model, self._root = compiled.model, compiled.root
        model = compiled.model
        self._batch = Batch(model, count, thread_count(threads))
        self._timestep, self._contact = self._batch.expand("opt.timestep"), self._batch.expand("pair_solref")
        self._disabled, self._corners = self._batch.expand("opt.disableflags"), compiled.trunk_corners
        flat = compiled.conditions.ground == "flat"
        self._clear = CLEAR * compiled.body.standing_height if flat else np.inf
        self._state = [self._batch.bind(name) for name in STATE]
        self._ends = np.cumsum([values.shape[1] for values in self._state])[:-1]
        self.qpos, self.qvel = self._state[:2]
        self.push = self._batch.bind("xfrc_applied")[:, compiled.root, 1]
        self.sensors, self._foot = self._batch.bind("sensordata"), compiled.columns.foot
        self.force = self._batch.bind("actuator_force")
        servos, speeds = compiled.columns.ctrl, compiled.columns.qvel.start + model.nq
        self._joints = speeds, servos.start, -model.actuator_biasprm[servos, 2], compiled.torque_limits

    def reset(self) -> None:
        """All bodies as they were at first; nothing remains of those that diverged."""
        self._batch.warning[:] = 0
        with batched():
            self._batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)

    def states(self, ids: np.ndarray) -> np.ndarray:
        """What some bodies go on from, (n, state)."""
        return _side_by_side(ids, tuple(self._state))

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """See `Engine.put`."""
        for values, now in zip(np.split(states, self._ends, axis=1), self._state, strict=True):
            now[ids] = values

    @property
    def rotation(self) -> np.ndarray:
        """From the root frames to the world, (start, axis, axis), where places are current."""
        return self._batch.bind("xmat")[:, self._root].reshape(-1, 3, 3)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put some bodies where they stand at rest, (n, state), by controls, (n, actuator); their places are current.

        Controls are those of the steps to come, so nothing is kept of these; of bodies that diverged nothing remains.
        """
        self._batch.warning[ids] = 0
        self.put(ids, states)
        with batched():
            self._look(ids)

    def rest(self, control: np.ndarray, steps: int) -> None:
        """Step all bodies with one control, (start, actuator), and make everything that they show current.

        Raises:
            Diverged: see `Engine.roll`.
            InputError: a callback is set that changes the physics.
        """
        ids = np.arange(len(control))
        before = self.replayed(ids)
        self._batch.bind("ctrl")[:] = control
        with batched():
            while steps > (some := max(1, HEARD // len(ids))):
                self._batch.step(nstep=some)
                steps -= some
            self._batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_ACC)
        self._check(ids, before, control[:, np.newaxis])

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """See `Engine.roll`; a warning of MuJoCo or a number that is not finite is a body that diverged."""
        model, before = self._model, self.replayed(ids)
        if parts > 1:
            timestep = model.opt.timestep / parts
            self._timestep[ids], self._contact[ids, :, 0] = timestep, 2 * timestep
        record = (AFTER, "sensordata", "actuator_force")
        try:
            with batched():
                seen = self._batch.rollout(control.shape[1], control, record=record, ids=ids)
                self._check(ids, before, control)
                self._look(ids)  # for the feet at the end
        finally:
            if parts > 1:
                self._timestep[ids], self._contact[ids] = model.opt.timestep, model.pair_solref
        feet = [sensors[:, :, self._foot] for sensors in (seen["sensordata"], self.sensors[ids, None])]
        places = np.concatenate(feet, axis=1).reshape(len(ids), 1 + control.shape[1], 6, 3)
        torque = _acting(before.states, seen[AFTER], seen["actuator_force"], *self._joints)
        return Rolled(before.states, places, seen["sensordata"], seen["actuator_force"], torque, seen[AFTER])

    def replayed(self, ids: np.ndarray) -> Replayed:
        """What replays some bodies from now on; MuJoCo takes back states and pushes of one that diverges."""
        return Replayed(self.states(ids), self.push[ids])

    def saved(self, before: Replayed, i: int, start: int, control: np.ndarray) -> dict[str, np.ndarray]:
        """What replays the i-th body of those, with its controls since, (step, actuator), time step and contacts."""
        model, applied = self._batch.get_model(start), np.zeros((self._model.nbody, 6))
        applied[self._root, 1] = before.push[i]
        state = dict(zip(STATE, np.split(before.states[i], self._ends), strict=True))
        now = {"contact": model.pair_solref[:, 0].copy(), "timestep": np.array(model.opt.timestep), "ctrl": control}
        return state | {"xfrc_applied": applied} | now

    def put_back(self, saved: dict[str, np.ndarray]) -> None:
        """Put the only body where it was saved."""
        for name, values in zip(STATE, self._state, strict=True):
            values[0] = saved[name]
        self._batch.bind("xfrc_applied")[0] = saved["xfrc_applied"]

    def _look(self, ids: np.ndarray) -> None:
        """Make current where some bodies are, and contacts of those whose trunk may touch the ground: to look for
        contacts takes two fifths of the time."""
        usual = self._model.opt.disableflags
        above = ids[_lowest(ids, self.qpos, *self._corners) > self._clear]
        self._disabled[above] = usual | mujoco.mjtDisableBit.mjDSBL_CONTACT.value
        try:
            self._batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS.value)
        finally:
            self._disabled[above] = usual

    def _check(self, ids: np.ndarray, before: Replayed, control: np.ndarray) -> None:
        """Raise `Diverged` with the first of some bodies that did, their states before, and the controls since."""
        warned = self._batch.warning
        i = _first_broken(ids, warned, self.qpos)
        if i == len(ids):
            return
        start = int(ids[i])
        kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned[start, :, 1])]
        state = self.saved(before, i, start, control[i])
        raise Diverged(start, ", ".join(kinds) or "a state that is not finite", state)


@jitted
def _side_by_side(ids: Any, values: Any) -> Any:
    """Rows of some arrays, each (start, number), one after the other, (n, number)."""
    columns = 0
    for of_one in values:
        columns += of_one.shape[1]
    rows, at = np.empty((len(ids), columns)), 0
    for of_one in values:
        for i, n in enumerate(ids):
            for j in range(of_one.shape[1]):
                rows[i, at + j] = of_one[n, j]
        at += of_one.shape[1]
    return rows


@jitted
def _acting(before: Any, after: Any, force: Any, speeds: int, servos: int, damping: Any, limits: Any) -> Any:
    """Torques of the joints over each step, (n, step, joint), of forces as it begins, and states before and after.

    The damping of a servo is integrated implicitly, but of one that pulls at its limit.

    Args:
        speeds: first column of the states that holds a joint's.
        servos: first column of the forces of a joint's.
        damping: of each servo, (joint,).
        limits: of each, (joint,).
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
    """Heights of the lowest points of some trunks, (n,) [mm]; corners (corner, axis) and radii (corner,) [mm]."""
    heights = np.empty(len(ids))
    for i, n in enumerate(ids):
        heights[i] = lowest(qpos[n], corners, radii)
    return heights


@jitted
def _first_broken(ids: Any, warned: Any, qpos: Any) -> int:
    """Index of the first of some bodies of which MuJoCo has warned, (start, kind, [last, count]), or whose state is not
    finite; `len(ids)` if none."""
    for i, n in enumerate(ids):
        for kind in range(warned.shape[1]):
            if warned[n, kind, 1] > 0:
                return i
        for value in qpos[n]:
            if not np.isfinite(value):
                return i
    return len(ids)
