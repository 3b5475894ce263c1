"""The insect as a dm_env environment on dm_control: walk straight ahead at a commanded velocity.

An episode begins at a random start in S, settled as for a physical walk.  One step of the environment is one
step of the plan, with its substeps.  The controller runs along and its plan is observed whatever the actions
are: the targets of all joints, held for the step ('joints'), or offsets to the tips that the controller plans
('tips'), so that zeros are its own walk, bit for bit that of `measures.physical.physical_walk`.

Observations, all float64:

- joint_angles, joint_velocities: (leg * joint,) [rad], [rad/s], in the order of `ctrl`
- orientation: unit quaternion of the root, (w, x, y, z); the walk should go along the world's x
- velocity: of the root, ahead, to the left and up, seen from its heading [mm/s]
- angular_velocity: of the root, in its own frame [rad/s]
- clearance: height of the trunk's lowest point [mm]
- tips: in the root frame, (leg, axis) [mm]
- contact: (leg,) 1 where the ground carried the foot within the last `Numerics.contact_gap`
- margin: measured stability margin [mm], from the feet in contact and the insect's own centre of mass;
  `Lengths.no_foot_margin`, out of any foot's reach, where no foot is in contact
- command: velocity to walk at [mm/s]
- planned_stance: (leg,) 1 where the plan lets the leg stand
- planned_tips: in the root frame, (leg, axis) [mm], without offsets
- out_of_reach, with 'tips' only: (leg,) substeps of the last step in which the leg kept its last angles,
  because its planned tip with the offset could not be reached

The reward of a step is max(0, 1 - |v - c| / c) max(0, u), with the velocity v along the world's x after the
step, the command c and the upward component u of the body's vertical; it is 0 on a fall.  An episode ends on a
fall, when the trunk touches the ground, with discount 0, and after its duration with discount 1.  A simulation
that diverges raises dm_control's PhysicsError.  Contacts are those of the last substep, known once it is done.
"""

from abc import abstractmethod
from collections import OrderedDict
from typing import Literal

import numpy as np
from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_control.utils import rewards
from dm_env import specs

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.description import ROOT_QPOS, ROOT_QVEL
from hexmj.bodies.grounds import depth_in_ground
from hexmj.bodies.loading import compile_body
from hexmj.conditions import Conditions
from hexmj.controllers.asking import advanced, begin, tell
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, Plan, ReadingPlan, Sensed
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.physics.backend import Rolled
from hexmj.physics.fine_steps import SINK, FineSteps
from hexmj.physics.foot_path import TipTargets
from hexmj.physics.orders import hold
from hexmj.physics.sensing import sensed
from hexmj.physics.settling import settle
from hexmj.physics.standing import StandingFeet
from hexmj.stability import stability_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride, steps_within

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""

ONLY = np.array([0])
"""The index of the only insect."""

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that a step goes on from, the solver's warm start included."""


def observation_specs(joints: int) -> tuple[specs.Array, ...]:
    """The specs of what is observed of a body with so many joints."""
    return (
        specs.Array((joints,), float, "joint_angles"),
        specs.Array((joints,), float, "joint_velocities"),
        specs.Array((4,), float, "orientation"),
        specs.Array((3,), float, "velocity"),
        specs.Array((3,), float, "angular_velocity"),
        specs.Array((), float, "clearance"),
        specs.Array((6, 3), float, "tips"),
        specs.BoundedArray((6,), float, 0.0, 1.0, "contact"),
        specs.Array((), float, "margin"),
        specs.BoundedArray((), float, 0.0, np.inf, "command"),
        specs.BoundedArray((6,), float, 0.0, 1.0, "planned_stance"),
        specs.Array((6, 3), float, "planned_tips"),
    )


def load(
    velocity: float = 0.3,
    *,
    actions: Literal["joints", "tips"] = "joints",
    controller: Controller = LDVS,
    conditions: Conditions | None = None,
    stride: Stride | None = None,
    duration: float = 200.0,
    seed: int = 0,
) -> control.Environment:
    """The environment; it can be given to `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        actions: 'joints', targets of all joints, (leg * joint,) [rad] within the joints' ranges; or 'tips',
            offsets to the planned tips, (leg * axis,) [mm]: forward, left, up.
        controller: plans the walk.
        conditions: of the walk.
        stride: of the plan; its time step is that of the environment.
        duration: of an episode [time units].
        seed: of the starts; the episodes take those of `draw_starts` one after the other.

    Raises:
        InputError: a value that makes no sense; here, or for an action in `step`.
    """
    conditions, stride = conditions or Conditions(), stride or Stride()
    if not 0 < velocity < 1:
        raise InputError(f"velocity = {velocity}; expected 0 < V < 1, a fraction of the protraction velocity V_p")
    if actions not in TASKS:
        raise InputError(f"actions = {actions!r}; valid names: {', '.join(TASKS)}")
    task = TASKS[actions](velocity, controller, conditions, stride, int(steps_within(duration, stride)), seed)
    compiled = compile_body(conditions, conditions.timestep(stride))
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, task, n_sub_steps=conditions.substeps(stride))


class InsectPhysics(mujoco.Physics):
    """The insect in dm_control, and what is measured on it."""

    touch: np.ndarray
    """(substep, leg) normal force of the ground on each foot in the last step, its mean over a substep in parts
    [g mm/s^2]."""
    compiled: CompiledBody
    """The insect and its conditions; set by `load`."""
    trunk: np.ndarray
    """(substep, part) contacts of each part of the trunk with the ground in the last step."""

    def _reload_from_data(self, data: wrapper.MjData) -> None:
        super()._reload_from_data(data)
        self._next: list[np.ndarray] = []

    def copy(self, share_model: bool = False) -> "InsectPhysics":
        """As planners need it; goes on the same way."""
        copied = super().copy(share_model)
        copied.compiled = self.compiled
        return copied

    def __getstate__(self) -> tuple[wrapper.MjData, CompiledBody]:
        return self.data, self.compiled

    def __setstate__(self, state: tuple[wrapper.MjData, CompiledBody]) -> None:
        data, self.compiled = state
        self._reload_from_data(data)

    def after_reset(self) -> None:
        """Make everything current; dm_control would leave out the actuators, which the first step then lacks."""
        self.forward()

    def set_control(self, control: np.ndarray) -> None:
        """Targets of the joints [rad]: (actuator,), or (substep, actuator), one row for each substep to come."""
        now, *self._next = np.atleast_2d(control)
        super().set_control(now)

    def step(self, nstep: int = 1) -> None:
        """Advance by `nstep` substeps; finely if a foot strikes the ground in them, see `fine_steps`."""
        rows = [self.data.ctrl.copy(), *self._next]
        control = np.array((rows + nstep * rows[-1:])[:nstep])
        compiled, conditions, columns = self.compiled, self.compiled.conditions, self.compiled.columns

        def depth_of(feet: np.ndarray) -> np.ndarray:
            return depth_in_ground(conditions.ground, conditions.body.lengths, feet, compiled.foot_radius)

        loop = FineSteps(self, nstep, depth_of, SINK * conditions.path.standing_height, columns.touch)
        sensors = loop.take(ONLY, control[np.newaxis])["sensors"][0]
        self.touch, self.trunk = sensors[:, columns.touch], sensors[:, columns.trunk]
        self.set_control(np.array(rows[nstep:] or rows[-1:]))

    def states(self, ids: np.ndarray) -> np.ndarray:
        """See `backend.Engine.states`."""
        return self.get_state(_STATE)[np.newaxis]

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        """See `backend.Engine.put`."""
        self.set_state(states[0], _STATE)

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int = 1) -> Rolled:
        """See `backend.Engine.roll`; of the states after each step nothing is kept, since there is one step only."""
        if parts == 1:
            return self._roll(control[0])
        model, usual, timestep = self.model, self.model.pair_solref.copy(), self.model.opt.timestep
        model.opt.timestep, model.pair_solref[:, 0] = timestep / parts, 2 * timestep / parts
        try:
            mujoco.mj_step1(model.ptr, self.data.ptr)
            rolled = self._roll(control[0])
        finally:
            model.opt.timestep, model.pair_solref[:] = timestep, usual
        mujoco.mj_step1(model.ptr, self.data.ptr)
        return rolled

    def _roll(self, control: np.ndarray) -> Rolled:
        """One step for each row of the controls, (step, actuator)."""
        feet, sensors = [self._feet()], np.empty((1, len(control), self.model.nsensordata))
        for now, row in zip(control, sensors[0], strict=True):
            super().set_control(now)
            super().step()
            row[:] = self.data.sensordata
            feet.append(self._feet())
        nothing = np.empty((1, len(control), 0))
        return Rolled(np.array(feet)[np.newaxis], sensors, nothing, nothing)

    def rotation(self) -> np.ndarray:
        """From the root frame to the world, (axis, axis)."""
        return self.data.xmat[self.compiled.root].reshape(3, 3)

    def velocity_from_heading(self) -> np.ndarray:
        """Velocity of the root ahead, to the left and up, (axis,) [mm/s]."""
        angle = np.arctan2(self.rotation()[1, 0], self.rotation()[0, 0])
        x, y, up = self.data.qvel[:3]
        return np.array([np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x, up])

    def clearance(self) -> np.ndarray:
        """Height of the trunk's lowest point over the ground [mm]."""
        corners, radii = self.compiled.trunk_corners
        return np.array((self.data.qpos[2] + corners @ self.rotation()[2] - radii).min())

    def tips(self) -> np.ndarray:
        """Tips in the root frame, (leg, axis) [mm]."""
        return (self._feet() - self.data.qpos[:3]) @ self.rotation()

    def margin(self, standing: np.ndarray) -> np.ndarray:
        """Stability margin on the feet that stand, (leg,), seen from the centre of mass [mm]."""
        if not standing.any():
            return np.array(self.compiled.body.lengths.no_foot_margin)
        centre = self.data.sensordata[self.compiled.columns.centre_of_mass]
        return stability_margin((self._feet() - centre)[:, :2], standing, threads=1)

    def _feet(self) -> np.ndarray:
        return self.data.sensordata[self.compiled.columns.foot].reshape(6, 3).copy()


class Walking(control.Task):
    """Walk straight ahead; subclasses say what an action means."""

    def __init__(
        self, velocity: float, controller: Controller, conditions: Conditions, stride: Stride, steps: int, seed: int
    ) -> None:
        """The arguments are those of `load`, but for the `steps` of an episode."""
        self._velocity, self._controller, self._conditions, self._stride = velocity, controller, conditions, stride
        self._command = velocity * conditions.time.vp
        self._steps, self._seed = steps, seed
        self._starts, self._episodes = draw_starts(16, seed, stride), 0
        self._plan: Plan

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        if self._episodes == len(self._starts):
            self._starts = draw_starts(2 * self._episodes, self._seed, self._stride)
        start = self._starts[[self._episodes]]
        self._episodes += 1
        settled = settle(start, self._conditions, self._stride, threads=1)
        model = physics.model
        physics.data.qpos[:], physics.data.qvel[:], physics.data.qacc_warmstart[:] = np.split(
            settled.state[0], np.cumsum([model.nq, model.nv])
        )
        physics.set_control(settled.ctrl[0])
        self._plan = begin(self._controller, start, self._velocity, self._stride, threads=1)
        self._targets = TipTargets(start, self._conditions, self._stride)
        geometry, height = self._stride.geometry, self._conditions.path.standing_height
        self._planned_stance = np.ones(6)
        self._planned_tips = np.stack([start[0] + geometry.origin, geometry.y, np.full(6, -height)], axis=-1)
        self._standing = StandingFeet(1, self._conditions, physics.timestep())
        self._load, self._torques = settled.load, settled.torques
        self._contact = np.ones((1, 6), dtype=bool)
        self._fell = False

    def before_step(self, action: np.ndarray, physics: InsectPhysics) -> None:
        """Advance the plan by one step and tell the joints where to go."""
        spec, action = self.action_spec(physics), np.asarray(action, dtype=float)
        if action.shape != spec.shape:
            raise InputError(f"an action has the shape {action.shape}; expected {spec.shape}")
        within = (action >= spec.minimum - ROUNDING) & (action <= spec.maximum + ROUNDING)
        if not within.all():
            i = int(np.argmin(within))
            raise InputError(
                f"the action's {spec.name.split()[i]} = {action[i]};"
                f" expected {spec.minimum[i]:.4g} to {spec.maximum[i]:.4g}"
            )
        if isinstance(self._plan, ReadingPlan):
            tell(self._plan, self._sensed(physics))
        ahead = advanced(self._plan, 1)
        tips = self._targets.follow(ahead, np.zeros(1, dtype=int))[0]
        self._planned_stance, self._planned_tips = ahead.stance[0, 0].astype(float), tips[-1]
        targets = np.atleast_2d(self.joint_targets(action, tips, physics))
        if physics.compiled.conditions.contact.grasp:
            held = np.broadcast_to(self._planned_stance, (len(targets), len(LEGS)))
            targets = np.concatenate([targets, held], axis=1)
        physics.set_control(targets)

    @abstractmethod
    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """Targets (actuator,) or (substep, actuator) [rad], from the planned tips, (substep, leg, axis) [mm]."""

    def after_step(self, physics: InsectPhysics) -> None:
        """Note which feet stand and whether the trunk has touched the ground."""
        self._standing.after(physics.touch[np.newaxis] > 0, ONLY)
        self._load, self._torques = physics.touch[-1:], physics.data.actuator_force[np.newaxis].copy()
        self._fell = bool((physics.trunk > 0).any())

    def _sensed(self, physics: InsectPhysics) -> Sensed:
        """What the insect knows of itself."""
        before, self._contact = self._contact, self._standing.now(ONLY)
        qpos, qvel = physics.position()[np.newaxis], physics.velocity()[np.newaxis]
        torques = self._torques[:, physics.compiled.columns.ctrl]
        return sensed(ONLY, qpos, qvel, self._contact, before, self._load, torques, physics.compiled)

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        return OrderedDict((spec.name, spec) for spec in observation_specs(physics.compiled.joints))

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        qpos, qvel = physics.position(), physics.velocity()
        standing = self._standing.now(ONLY)[0]
        return OrderedDict(
            joint_angles=qpos[physics.compiled.columns.qpos],
            joint_velocities=qvel[physics.compiled.columns.qvel],
            orientation=qpos[3:ROOT_QPOS],
            velocity=physics.velocity_from_heading(),
            angular_velocity=qvel[3:ROOT_QVEL],
            clearance=physics.clearance(),
            tips=physics.tips(),
            contact=standing.astype(float),
            margin=physics.margin(standing),
            command=np.array(self._command),
            planned_stance=self._planned_stance,
            planned_tips=self._planned_tips,
        )

    def get_reward(self, physics: InsectPhysics) -> float:
        """max(0, 1 - |v - c| / c) max(0, u), and 0 on a fall."""
        v, c, upright = float(physics.data.qvel[0]), self._command, float(physics.rotation()[2, 2])
        at_speed = rewards.tolerance(v, bounds=(c, c), margin=c, sigmoid="linear", value_at_margin=0.0)
        return 0.0 if self._fell else at_speed * max(0.0, upright)

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Discount 0 on a fall, 1 when the time is over, nothing before."""
        if self._fell:
            return 0.0
        return 1.0 if self._plan.done >= self._steps else None


class JointTargets(Walking):
    """An action gives the targets of all joints, held for the step."""

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounded by the joints' ranges [rad]; the actuators' names are joined by tabs."""
        compiled = physics.compiled
        low, high = physics.model.actuator_ctrlrange[compiled.columns.ctrl].T
        return specs.BoundedArray((compiled.joints,), float, low, high, name="\t".join(compiled.body.joints))

    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """The action itself."""
        return action


class TipOffsets(Walking):
    """An action gives offsets to the tips that the controller plans."""

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounded by `Lengths.largest_tip_offset` [mm]; the names are joined by tabs."""
        names = "\t".join(f"{leg}_{axis}" for leg in LEGS for axis in ("forward", "left", "up"))
        bound = np.full(3 * len(LEGS), physics.compiled.body.lengths.largest_tip_offset)
        return specs.BoundedArray(bound.shape, float, -bound, bound, name=names)

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start; nothing is out of reach yet."""
        super().initialize_episode(physics)
        self._out_of_reach = np.zeros(6)

    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """The angles that put the tips there; a leg whose tip is out of reach keeps its last ones."""
        joints, reachable = physics.compiled.inverse(tips + action.reshape(6, 3))
        self._out_of_reach = (~reachable).sum(axis=0).astype(float)
        hold(joints, physics.control()[physics.compiled.columns.ctrl].reshape(len(LEGS), -1))
        return joints.reshape(len(tips), -1)

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        most = float(self._conditions.substeps(self._stride))
        spec = specs.BoundedArray((6,), float, 0.0, most, "out_of_reach")
        return super().observation_spec(physics) | {"out_of_reach": spec}

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        return super().get_observation(physics) | {"out_of_reach": self._out_of_reach}


TASKS: dict[str, type[Walking]] = {"joints": JointTargets, "tips": TipOffsets}
"""Kinds of actions by their names."""
