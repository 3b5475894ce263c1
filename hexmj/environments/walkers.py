"""Insects that take actions, each in its own episode; every interface of this package is built on `Walkers`.

Insects that begin at the same step form a group, whose starts are those of one plan. A plan without sensory feedback
plans many steps at once. A plan with sensory feedback receives the sensed legs before each step. The walk of an insect
depends neither on the number of insects nor on its group.
"""

import math
from copy import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import beyond_the_ground, blocks
from hexmj.controllers.planning import advanced
from hexmj.controllers.planning import begin as begin_plan
from hexmj.controllers.protocol import FeedbackPlan, Plan
from hexmj.environments.task import Task, action_bounds, end_step, next_targets, observation_shapes, write_observations
from hexmj.errors import InputError
from hexmj.physics.engine import STATE, STATE_BITS, Diverged, MujocoBatch, Rolled, walk_error
from hexmj.physics.foot_path import TipTargets, check_made_for, hold
from hexmj.physics.rollout import Senses
from hexmj.physics.settle import Settling
from hexmj.physics.substeps import FineSteps, Shown, allowed_depth, strikes
from hexmj.timing import steps_within

STEPS_AHEAD = 128
"""Number of steps that a plan without sensory feedback plans at once."""

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""MuJoCo's state elements that `Alone` stores before a step: all that determine the step, and the time."""


Acted = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Result of a step for every insect, (insect,) each: the reward, 0 for insects whose episode was already over; whether
the insect fell; and whether the step reached the time limit or the end of the ground without a fall."""


@dataclass(eq=False)
class Group:
    """Insects whose episodes began at the same step, and their plan."""

    ids: np.ndarray
    """(n,) indices of the insects of the group that still walk."""
    rows: np.ndarray
    """(n,) rows of these insects among the plan's starts."""
    plan: Plan
    """Plan of all insects of the group, also of those whose episodes have ended."""
    targets: TipTargets
    """Tip targets of all insects of the group, also of those whose episodes have ended."""
    ahead: int = 0
    """Number of planned steps that the group has not walked yet."""


class Walkers:
    """Insects that take actions, each in its own episode."""

    def __init__(
        self,
        task: Task,
        compiled: CompiledBody,
        bodies: "Alone | MujocoBatch",
        count: int = 1,
        threads: int | None = 1,
        normalised: bool = True,
    ) -> None:
        """Prepare insects.

        Args:
            task: the task of all insects.
            compiled: their compiled body.
            bodies: engine that steps them.
            count: number of insects.
            threads: number of threads that settle insects at their starts; None is one per core.
            normalised: whether actions lie in -1 ... 1, see `act`.
        """
        self._task, self._compiled, self.bodies, self._threads = task, compiled, bodies, threads
        self._settling = Settling(task.conditions, task.stride, threads)
        self._substeps, self._command = task.substeps, task.command
        self._last = int(steps_within(task.duration, task.stride))
        self._take = bodies.take if isinstance(bodies, Alone) else FineSteps.of(bodies, task.substeps, compiled).take
        self.begun = False
        """Whether all insects have begun, and no step or reset has failed since."""
        self.walking = np.zeros(count, dtype=bool)
        """(insect,) whether the episode of the insect is not over."""
        self._ids, self._done, self._groups = np.arange(0), np.zeros(count, dtype=int), list[Group]()
        tips, stance = np.empty((count, STEPS_AHEAD, task.substeps, 6, 3)), np.empty((count, STEPS_AHEAD, 6), bool)
        self._ahead = tips, stance, np.zeros(count, dtype=int)  # tips, stance, index of the next step
        self._joints = np.empty((count, 6, compiled.joints // 6))  # last targets
        self.state = bodies.qpos, bodies.qvel, bodies.rotation, bodies.sensors
        """Positions, velocities, rotations from the root frames to the world, (insect, axis, axis), and sensors of all
        insects; only sensors of MuJoCo's position stage are current."""
        self.planned = np.ones((count, 6)), np.empty((count, 6, 3)), np.zeros((count, 6))
        """Planned stance, 1 or 0, (insect, leg), planned tips without offsets in the root frame, (insect, leg, axis)
        [mm], and number of substeps of the last step in which the tip was out of reach, (insect, leg)."""
        columns, no_foot, end = compiled.columns, compiled.body.lengths.no_foot_margin, 0
        self._layout = compiled.joints, columns.foot.start, columns.centre_of_mass.start, task.command, no_foot
        self._observed = dict[str, tuple[slice, tuple[int, ...]]]()  # columns and shape of each observation
        for name, shape in observation_shapes(compiled, task).items():
            self._observed[name] = slice(end, end := end + math.prod(shape)), shape
        self._numbers, self._trunk = end, (columns.trunk.start, columns.trunk.stop)
        low, default, high = action_bounds(compiled, task)
        scale = (default, default - low, high - default) if normalised else (0 * low, *np.ones((2, len(low))))
        self._scale = *scale, np.array(low), np.array(high)

    @property
    def over(self) -> bool:
        """Whether a reset is needed: no insect has begun, all episodes are over, or a step or a reset failed."""
        return not self.begun or len(self._ids) == 0

    def begin(self, ids: np.ndarray, starts: np.ndarray) -> None:
        """Begin episodes of the insects `ids`, (n,), at starts, (n, leg) [mm]. The first call must begin all insects.

        Raises:
            SimulationError: an insect does not come to rest at its start.
        """
        task, self.begun = self._task, False  # remains False if a start does not settle
        settled = self._settling.at(starts, ids)
        plan = begin_plan(task.controller, starts, task.velocity, task.stride, threads=self._threads)
        check_made_for(plan, task.conditions)
        self._leave(ids)
        targets = TipTargets(settled.starts, task.conditions, task.stride)
        self._groups.append(Group(ids, np.arange(len(ids)), plan, targets))
        self.bodies.stand(ids, settled.state, settled.ctrl)
        if len(ids) == len(self.walking):
            self._senses = Senses(settled)
        else:
            self._senses.restart(ids, settled)
        self._joints[ids] = settled.ctrl[:, self._compiled.columns.ctrl].reshape(len(ids), 6, -1)
        for planned, now in zip(self.planned, (1.0, settled.tips, 0.0), strict=True):
            planned[ids] = now
        self._done[ids], self.walking[ids] = 0, True
        self._ids, self.begun = np.flatnonzero(self.walking), True

    def act(self, actions: np.ndarray) -> Acted:
        """Take one step of all insects whose episodes are not over.

        Args:
            actions: actions of all insects, (insect, number): joint targets [rad] or tip offsets [mm]; if normalised, 0
                is the default, -1 the smallest and 1 the largest action.

        Raises:
            InputError: no episode has begun, a step or reset has failed, an action is NaN, or a plan is invalid.
            SimulationError: the simulation of an insect diverged.
        """
        if not self.begun:
            raise InputError("no episode is running, or a step or a reset failed; reset all insects first")
        count, ids = len(self.walking), self._ids
        actions = np.asarray(actions, dtype=float).reshape(count, len(self._scale[0]))
        if np.isnan(actions).any():
            raise InputError("an action is NaN")
        acted = np.zeros(count), np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        if len(ids) == 0:
            return acted
        self.begun = False  # remains False if the step fails, because only some insects may have taken it
        try:
            shown = self._take(ids, self._control(ids, actions))
        except Diverged as error:
            time = float(self._done[error.start] * self._task.stride.dt)
            raise walk_error(error, "acting", time) from None
        self._senses.feel(ids, shown["sensors"], shown["force"])
        self._judge(ids, shown, acted)
        self.begun = True
        return acted

    def observations(self, insects: int | slice = np.s_[:]) -> dict[str, np.ndarray]:
        """Return the observations of all insects, or of some of them, by name."""
        flat, corners = np.empty((len(self.walking), self._numbers)), self._compiled.trunk_corners
        write_observations(self.state, self._senses.standing(), self.planned, corners, self._layout, flat)
        flat = flat[insects]
        return {
            name: flat[..., at].reshape(*flat.shape[:-1], *shape) if len(shape) > 1 else flat[..., at]
            for name, (at, shape) in self._observed.items()
        }

    def _control(self, ids: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return the controls of the next step, (n, substep, actuator), for the n insects that walk."""
        for group in self._groups:
            self._plan(group)
        tips, substeps, (stance, _, missed) = self._task.actions == "tips", self._substeps, self.planned
        control = next_targets(actions, ids, self._scale, self._ahead, self.planned, tips)
        if tips:
            joints, reachable = self._compiled.inverse(control.reshape(len(ids), substeps, 6, 3))
            if np.count_nonzero(reachable) < reachable.size:
                missed[ids] = substeps - reachable.sum(axis=1)
                hold(joints.swapaxes(0, 1), self._joints[ids])
            self._joints[ids] = joints[:, -1]
            control = joints.reshape(len(ids), substeps, -1)
        if self._task.conditions.grasp:
            control = np.concatenate([control, stance[ids, np.newaxis].repeat(substeps, axis=1)], axis=2)
        return control

    def _judge(self, ids: np.ndarray, shown: Shown, acted: Acted) -> None:
        """Write the result of a step to `acted`, from its record, (n, substep, ...), and end episodes that are over."""
        (_, fell, over), conditions, time = acted, self._task.conditions, (self._done, self._last)
        ended = end_step(ids, shown["sensors"], self.state, self._trunk, self._command, time, acted)
        if blocks(conditions):
            feet = self.bodies.sensors[ids, self._compiled.columns.foot].reshape(-1, 6, 3)
            over[ids] |= beyond_the_ground(conditions, feet).any(axis=1) & ~fell[ids]
            ended |= bool(over.any())
        if ended:
            self._leave(np.flatnonzero(fell | over))

    def _leave(self, ids: np.ndarray) -> None:
        """End the episodes of the insects `ids`, (n,)."""
        self.walking[ids] = False
        self._ids = np.flatnonzero(self.walking)
        for group in self._groups:
            still = self.walking[group.ids]
            group.ids, group.rows = group.ids[still], group.rows[still]
        self._groups = [group for group in self._groups if len(group.ids)]

    def _plan(self, group: Group) -> None:
        """Count one planned step of a group as walked; before that, plan further steps if none is left."""
        if group.ahead == 0:
            ids, steps = group.ids, min(STEPS_AHEAD, self._last - group.plan.done)
            if isinstance(group.plan, FeedbackPlan):
                sensed = self._senses.sensed(ids, self.bodies.qpos[ids], self.bodies.qvel[ids])
                group.plan.sense(replace(sensed, ids=group.rows.copy()))
                steps = 1
            walk = advanced(group.plan, steps)
            tips, stance, following = self._ahead
            tips[ids, :steps] = group.targets.follow(walk, group.rows).reshape(len(ids), steps, -1, 6, 3)
            stance[ids, :steps] = walk.stance[:, group.rows].swapaxes(0, 1)
            following[ids], group.ahead = 0, steps
        group.ahead -= 1


class Alone:
    """An `Engine` of one body, which walks bit for bit as in `physics.engine.MujocoBatch`. `ids` must always be [0].

    Each step ends with MuJoCo's mj_step1, the first half of the next step, so that positions of feet are current.
    """

    def __init__(self, compiled: CompiledBody, data: mujoco.MjData) -> None:
        """Wrap data of the compiled model, which the caller may read and change between steps."""
        self.model, self.data, self._foot = compiled.model, data, compiled.columns.foot
        self._compiled, self._allowed = compiled, allowed_depth(compiled)
        self.qpos, self.qvel = data.qpos[np.newaxis], data.qvel[np.newaxis]
        self.rotation = data.xmat[compiled.root].reshape(1, 3, 3)
        self.sensors = data.sensordata[np.newaxis]
        self._control, self._sensors, self._force = data.ctrl, data.sensordata, data.actuator_force
        self._warned, self._size = data.warning.number, mujoco.mj_stateSize(self.model, _STATE)

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """Set the state of the body, `states` (1, state), see `engine.Engine.put`."""
        mujoco.mj_setState(self.model, self.data, states[0], _STATE)
        mujoco.mj_step1(self.model, self.data)

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Reset the body to a settled state, `states` (1, state), with its controls, (1, actuator)."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, states[0], STATE_BITS)
        self._control[:] = control[0]
        mujoco.mj_step1(self.model, self.data)

    def take(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """Take one step of the plan; for speed, use the slower `FineSteps.take` only if a foot strikes the ground."""
        rolled = self.roll(ids, control, 1)
        if not np.count_nonzero(strikes(self._compiled.depth(rolled.feet), control.shape[1], self._allowed)):
            return {"sensors": rolled.sensors, "force": rolled.force}
        self.put(ids, rolled.before)
        return FineSteps.of(self, control.shape[1], self._compiled).take(ids, control)

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int) -> Rolled:
        """Take substeps, see `engine.Engine.roll`; the record has neither torques nor states."""
        model, data, count, now, pull = self.model, self.data, control.shape[1], self._sensors, self._force
        before, nothing = np.empty((1, self._size)), np.empty((1, count, 0))
        sensors, force = np.empty((1, count + 1, len(now))), np.empty((1, count, len(pull)))
        mujoco.mj_getState(model, data, before[0], _STATE)
        if parts > 1:
            model = copy(model)  # another thread may use the model
            model.opt.timestep /= parts
            model.pair_solref[:, 0] = 2 * model.opt.timestep
            mujoco.mj_step1(model, data)
        for k in range(count):
            self._control[:] = control[0, k]
            (mujoco.mj_step if k else mujoco.mj_step2)(model, data)
            sensors[0, k], force[0, k] = now, pull  # positions are those before the substep
        mujoco.mj_step1(self.model, data)
        if np.count_nonzero(self._warned):
            kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(self._warned)]
            mujoco.mj_setState(self.model, data, before[0], _STATE)
            raise Diverged(0, ", ".join(kinds), {name: getattr(data, name).copy() for name in STATE})
        sensors[0, count] = now
        feet = sensors[:, :, self._foot].reshape(1, count + 1, 6, 3)
        return Rolled(before, feet, sensors[:, :count], force, torque=nothing, after=nothing)
