"""A single body that steps by itself, by MuJoCo's own step: for one insect a batch would only cost time."""

from copy import copy

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.physics.backend import AFTER, STATE, Diverged, Rolled
from hexmj.physics.callbacks import check_no_callbacks
from hexmj.physics.fine_steps import FineSteps, Shown, allowed_depth, strikes

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that a step goes on from, the time included."""

NEVER, ONCE = (np.full(mujoco.mjtWarning.mjNWARNING.value, count, np.int32).tobytes() for count in (0, 1))
"""How often MuJoCo has warned of each kind; to compare bytes takes less time."""


class Alone:
    """An `Engine` of one body, to the same bits as `physics.backend.MujocoBatch`; every `ids` is [0].

    Between two steps the first half of the next is done already, so that places are current.
    """

    def __init__(self, compiled: CompiledBody, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """A body as it is now, in a model and data of its own that others may look at and change."""
        self.model, self.data, self._compiled, self._allowed = model, data, compiled, allowed_depth(compiled)
        self.qpos, self.qvel = data.qpos[np.newaxis], data.qvel[np.newaxis]
        self.rotation = data.xmat[compiled.root].reshape(1, 3, 3)
        self.sensors = data.sensordata[np.newaxis]
        self._control, self._sensors, self._force = data.ctrl, data.sensordata, data.actuator_force
        self._foot = compiled.columns.foot
        self._warned, self._begun = data.warning.number, np.empty((1, mujoco.mj_stateSize(model, _STATE)))

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """See `backend.Engine.put`."""
        mujoco.mj_setState(self.model, self.data, states[0], _STATE)
        mujoco.mj_step1(self.model, self.data)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put the body where it stands at rest, (1, state), by its controls, (1, actuator)."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, states[0], AFTER)
        self._control[:] = control[0]
        mujoco.mj_step1(self.model, self.data)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """One step of the plan; see `fine_steps.FineSteps.take`, which is asked only where a foot strikes.

        Raises:
            InputError: a callback is set that changes the physics.
        """
        check_no_callbacks()
        substeps = control.shape[1]
        mujoco.mj_getState(self.model, self.data, self._begun[0], _STATE)
        feet, sensors, force = self._roll(control[0], self.model)
        if np.count_nonzero(strikes(self._compiled.depth(feet), substeps, self._allowed)):
            self.put(ids, self._begun)
            return FineSteps.of(self, substeps, self._compiled).take(ids, control)
        return {"sensors": sensors, "force": force}

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """See `backend.Engine.roll`; neither torques nor states are kept, since a plan's step is all that is taken at
        once."""
        before = np.empty_like(self._begun)
        mujoco.mj_getState(self.model, self.data, before[0], _STATE)
        if parts == 1:
            seen = self._roll(control[0], self.model)
        else:
            fine = copy(self.model)  # others may step with the model meanwhile
            fine.opt.timestep = self.model.opt.timestep / parts
            fine.pair_solref[:, 0] = 2 * fine.opt.timestep
            mujoco.mj_step1(fine, self.data)
            seen = self._roll(control[0], fine)
            mujoco.mj_step1(self.model, self.data)
        nothing = np.empty((1, control.shape[1], 0))
        return Rolled(before, *seen, torque=nothing, after=nothing)

    def _roll(self, control: np.ndarray, model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One step for each row of the controls, (step, actuator); feet, sensors and force as `Rolled` has them."""
        count, data, now, pulled, warned = len(control), self.data, self._sensors, self._force, self._warned
        sensors, force = np.empty((1, count + 1, len(now))), np.empty((1, count, len(pulled)))
        try:
            if warned.tobytes() == NEVER:
                warned.fill(1)  # MuJoCo writes to the terminal and to a file the first of a kind only
            for k in range(count):
                self._control[:] = control[k]
                (mujoco.mj_step if k else mujoco.mj_step2)(model, data)
                sensors[0, k], force[0, k] = now, pulled  # those of places as the step began
            mujoco.mj_step1(model, data)
        finally:
            if well := warned.tobytes() == ONCE:
                warned.fill(0)
            else:
                warned -= warned.min()  # 0 where MuJoCo has put the body back, as it does if it diverges
        sensors[0, count] = now
        if not well:  # what is not finite is seen as the next step begins
            raise self._diverged(control, model)
        return sensors[:, :, self._foot].reshape(1, count + 1, 6, 3), sensors[:, :count], force

    def _diverged(self, control: np.ndarray, model: mujoco.MjModel) -> Diverged:
        """What happened, with the state before and the controls since, (step, actuator)."""
        kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(self._warned)]
        before = mujoco.MjData(model)
        mujoco.mj_setState(model, before, self._begun[0], _STATE)
        state = {name: getattr(before, name).copy() for name in (*STATE, "xfrc_applied")}
        now = {"contact": model.pair_solref[:, 0].copy(), "timestep": np.array(model.opt.timestep), "ctrl": control}
        return Diverged(0, ", ".join(kinds) or "a state that is not finite", state | now)
