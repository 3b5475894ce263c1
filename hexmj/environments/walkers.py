"""Insects that take actions, each in an episode of its own; every interface of this package is built on `Walkers`.

Insects that begin together are the starts of one plan. A plan without sensory feedback is asked for many steps at once;
a plan with sensory feedback receives the state of the legs before each step. An insect is independent of all others:
its walk depends neither on their number nor on the insects that began with it.
"""

from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple, Union

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import WITH_ENDS, beyond_the_ground
from hexmj.bodies.kinematics import standing_tips
from hexmj.controllers.planning import advanced, begin
from hexmj.controllers.protocol import FeedbackPlan, Plan
from hexmj.environments.observing import Observer, Places, Planned, judge, order
from hexmj.environments.task import Task, action_bounds
from hexmj.errors import InputError
from hexmj.physics.engine import STATE, STATE_BITS, Diverged, MujocoBatch, Rolled, walk_error
from hexmj.physics.foot_path import TipTargets, check_made_for, hold
from hexmj.physics.rollout import Senses
from hexmj.physics.settle import Settling
from hexmj.physics.substeps import FineSteps, Shown, allowed_depth, strikes

AHEAD = 128
"""Steps planned at once without sensory feedback."""

Bodies = Union["Alone", MujocoBatch]
"""Engine of the insects, which shows their places and puts them into a state."""

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""The whole state before a step, with the time."""


class Acted(NamedTuple):
    """The result of a step, each (n,)."""

    reward: np.ndarray
    """0 for insects that did not walk."""
    terminated: np.ndarray
    """Whether the insect fell."""
    truncated: np.ndarray
    """Whether its time or the ground ended."""


@dataclass(eq=False)
class Together:
    """Insects that began together, and their plan."""

    ids: np.ndarray
    """(n,) insects that still walk."""
    rows: np.ndarray
    """(n,) their rows among the plan's starts."""
    plan: Plan
    """The plan of all that began."""
    targets: TipTargets
    """The tip targets of all that began."""
    ahead: int = 0
    """Planned steps that are not walked yet."""


class Walkers:
    """Insects, each in an episode of its own."""

    def __init__(self, task: Task, compiled: CompiledBody, bodies: Bodies, count: int, threads: int | None) -> None:
        """Prepare `count` insects. `threads` settle them, by default one per core."""
        self._task, self._compiled, self._threads = task, compiled, threads
        self._settling = Settling(task.conditions, task.stride, threads)
        self._steps, self._substeps = task.steps, task.substeps
        self._count, self._ids = count, np.arange(0)
        self._walking, self._done = np.zeros(count, dtype=bool), np.zeros(count, dtype=int)
        self.begun = False
        """Whether steps may follow: all have begun, and no step or reset has failed since."""
        self._together: list[Together] = []
        tips, stance = np.empty((count, AHEAD, task.substeps, 6, 3)), np.empty((count, AHEAD, 6), bool)
        self._ahead = tips, stance, np.zeros(count, dtype=int)  # plans, and the index of the next step
        self._joints = np.empty((count, 6, compiled.joints // 6))
        self._planned = Planned(np.ones((count, 6)), np.empty((count, 6, 3)), np.zeros((count, 6)))
        low, self._usual, high = action_bounds(compiled, task)
        self._below, self._above = self._usual - low, high - self._usual
        self.observer = Observer(compiled, task)
        self.look(bodies)

    def look(self, bodies: Bodies) -> None:
        """Refer to the arrays of these bodies, which change with each step."""
        self.bodies, self.places = bodies, Places(bodies.qpos, bodies.qvel, bodies.rotation, bodies.sensors)
        self._passed = tuple(self.places), tuple(self._planned)  # compiled code receives plain tuples faster
        self._take = (
            bodies.take if isinstance(bodies, Alone) else FineSteps.of(bodies, self._substeps, self._compiled).take
        )

    def begin(self, ids: np.ndarray, starts: np.ndarray) -> None:
        """Begin episodes of some insects, (n,), at starts, (n, leg) [mm]; the first call is for all insects.

        Raises:
            SimulationError: a start does not settle.
        """
        task, self.begun = self._task, False  # stays if a start does not settle
        settled = self._settling.at(starts, ids)
        plan = begin(task.controller, starts, task.velocity, task.stride, threads=self._threads)
        check_made_for(plan, task.conditions)
        self._leave(ids)
        targets = TipTargets(settled.starts, task.conditions, task.stride)
        self._together.append(Together(ids, np.arange(len(ids)), plan, targets))
        self.bodies.stand(ids, settled.state, settled.ctrl)
        if len(ids) == self._count:
            self._senses = Senses(settled)
        else:
            self._senses.restart(ids, settled)
        self._joints[ids] = settled.ctrl[:, self._compiled.columns.ctrl].reshape(len(ids), 6, -1)
        standing = standing_tips(settled.starts, task.conditions.standing_height, task.stride)
        for shown, now in zip(self._planned, (1.0, standing, 0.0), strict=True):
            shown[ids] = now
        self._done[ids], self._walking[ids] = 0, True
        self._ids, self.begun = np.flatnonzero(self._walking), True

    def act(self, actions: np.ndarray) -> Acted:
        """Take one step of all insects that walk.

        Args:
            actions: of every insect, (insect, number): 0 is the usual action, -1 the least and 1 the greatest.

        Raises:
            InputError: no episode has begun, or a plan is invalid.
            SimulationError: the simulation of an insect diverged.
        """
        self.check_begun()
        if self.over:
            return self._nothing()
        actions = actions[self._ids]
        control = self.control(self._usual + actions * np.where(actions > 0, self._above, self._below))
        try:
            return self.judge(self._take(self._ids, control))
        except Diverged as error:
            time = float(self._done[error.start] * self._task.stride.dt)
            raise walk_error(error, "acting", time) from None

    def check_begun(self) -> None:
        """Raise InputError unless all insects have begun and no step or reset has failed since."""
        if not self.begun:
            raise InputError("no episode has begun, or a step or a reset failed; reset all insects first")

    @property
    def over(self) -> bool:
        """Whether all episodes that have begun are over."""
        return self.begun and len(self._ids) == 0

    def control(self, wanted: np.ndarray) -> np.ndarray:
        """Return the controls of the insects that walk for a step, (n, substep, actuator); `judge` ends the step.

        Args:
            wanted: values of their actions, (n, number) [rad] or [mm].
        """
        self.begun = False  # if the step fails, the other insects may have taken it or not
        for group in self._together:
            self._plan(group)
        ids, substeps, offset = self._ids, self._substeps, self._task.actions == "tips"
        tips = order(wanted, ids, self._ahead, self._passed[1], offset)
        if offset:
            joints, reachable = self._compiled.inverse(tips)
            if not reachable.all():
                self._planned.missed[ids] = substeps - reachable.sum(axis=1)
                hold(joints.swapaxes(0, 1), self._joints[ids])
            self._joints[ids] = joints[:, -1]
            control = joints.reshape(len(ids), substeps, -1)
        else:
            control = wanted[:, np.newaxis].repeat(substeps, axis=1)
        if self._task.conditions.grasp:
            stance = self._planned.stance[ids, np.newaxis]
            control = np.concatenate([control, stance.repeat(substeps, axis=1)], axis=2)
        return control

    def judge(self, shown: Shown) -> Acted:
        """Return the result of a step, from its sensors and forces, (n, substep, ...)."""
        ids, acted, columns = self._ids, self._nothing(), self._compiled.columns
        self._senses.feel(ids, shown["sensors"], shown["force"])
        trunk, time = (columns.trunk.start, columns.trunk.stop), (self._done, self._steps)
        ended = judge(self._passed[0], ids, shown["sensors"], trunk, self._task.command, time, tuple(acted))
        if self._task.conditions.ground in WITH_ENDS:
            feet = self.places.sensors[ids, columns.foot].reshape(-1, 6, 3)
            beyond = beyond_the_ground(self._task.conditions, feet).any(axis=1)
            acted.truncated[ids] |= beyond & ~acted.terminated[ids]
            ended |= bool(beyond.any())
        if ended:
            self._leave(np.flatnonzero(acted.terminated | acted.truncated))
        self.begun = True
        return acted

    def observations(self) -> np.ndarray:
        """Return the observations of all insects, (insect, number); `observer.named` names them."""
        places, planned = self._passed
        return self.observer.observe(places, self._senses.standing(), planned)

    def _leave(self, ids: np.ndarray) -> None:
        """End the episodes of some insects."""
        self._walking[ids] = False
        self._ids = np.flatnonzero(self._walking)
        for group in self._together:
            still = self._walking[group.ids]
            group.ids, group.rows = group.ids[still], group.rows[still]
        self._together = [group for group in self._together if len(group.ids)]

    def _plan(self, group: Together) -> None:
        """Plan the next steps of a group that has none left, and take one of them."""
        if group.ahead == 0:
            ids, steps = group.ids, min(AHEAD, self._steps - group.plan.done)
            if isinstance(group.plan, FeedbackPlan):
                sensed = self._senses.sensed(ids, self.places.qpos[ids], self.places.qvel[ids])
                group.plan.sense(replace(sensed, ids=group.rows.copy()))
                steps = 1
            walk = advanced(group.plan, steps)
            tips, stance, at = self._ahead
            tips[ids, :steps] = group.targets.follow(walk, group.rows).reshape(len(ids), steps, -1, 6, 3)
            stance[ids, :steps] = walk.stance[:, group.rows].swapaxes(0, 1)
            at[ids], group.ahead = 0, steps
        group.ahead -= 1

    def _nothing(self) -> Acted:
        """Return an empty result."""
        return Acted(np.zeros(self._count), *np.zeros((2, self._count), dtype=bool))


class Alone:
    """An `Engine` of one body, bit for bit as `physics.engine.MujocoBatch`; every `ids` is [0].

    Between two steps, the first half of the next step is done already, so that places are current.
    """

    def __init__(self, compiled: CompiledBody, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Wrap a model and its data, which may be read and changed from outside."""
        self.model, self.data, self._foot = model, data, compiled.columns.foot
        self._compiled, self._allowed = compiled, allowed_depth(compiled)
        self.qpos, self.qvel = data.qpos[np.newaxis], data.qvel[np.newaxis]
        self.rotation = data.xmat[compiled.root].reshape(1, 3, 3)
        self.sensors = data.sensordata[np.newaxis]
        self._control, self._sensors, self._force = data.ctrl, data.sensordata, data.actuator_force
        self._warned, self._size = data.warning.number, mujoco.mj_stateSize(model, _STATE)

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Put the body into a state, see `engine.Engine.put`."""
        mujoco.mj_setState(self.model, self.data, states[0], _STATE)
        mujoco.mj_step1(self.model, self.data)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put the body into a state at rest, (1, state), with its controls, (1, actuator)."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, states[0], STATE_BITS)
        self._control[:] = control[0]
        mujoco.mj_step1(self.model, self.data)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """Take one step of the plan; only if a foot strikes the ground, by `substeps.FineSteps.take`."""
        rolled = self.roll(ids, control, 1)
        if not np.count_nonzero(strikes(self._compiled.depth(rolled.feet), control.shape[1], self._allowed)):
            return {"sensors": rolled.sensors, "force": rolled.force}
        self.put(ids, rolled.before)
        return FineSteps.of(self, control.shape[1], self._compiled).take(ids, control)

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Take substeps, see `engine.Engine.roll`; neither torques nor states are stored."""
        model, data, count = self.model, self.data, control.shape[1]
        before, nothing = np.empty((1, self._size)), np.empty((1, count, 0))
        sensors = np.empty((1, count + 1, len(self._sensors)))
        force = np.empty((1, count, len(self._force)))
        mujoco.mj_getState(model, data, before[0], _STATE)
        if parts > 1:
            model = copy(model)  # another thread may step with the model
            model.opt.timestep /= parts
            model.pair_solref[:, 0] = 2 * model.opt.timestep
            mujoco.mj_step1(model, data)
        for k in range(count):
            self._control[:] = control[0, k]
            (mujoco.mj_step if k else mujoco.mj_step2)(model, data)
            sensors[0, k], force[0, k] = self._sensors, self._force  # places at the beginning of the step
        mujoco.mj_step1(self.model, data)
        if np.count_nonzero(self._warned):
            raise self._diverged(before[0])
        sensors[0, count] = self._sensors
        feet = sensors[:, :, self._foot].reshape(1, count + 1, 6, 3)
        return Rolled(before, feet, sensors[:, :count], force, torque=nothing, after=nothing)

    def _diverged(self, state: np.ndarray) -> Diverged:
        """Return the error, with the state before."""
        kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(self._warned)]
        before = mujoco.MjData(self.model)
        mujoco.mj_setState(self.model, before, state, _STATE)
        return Diverged(0, ", ".join(kinds), {name: getattr(before, name).copy() for name in STATE})
