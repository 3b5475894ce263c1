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
fall, when the trunk touches the ground, with discount 0; with discount 1 after its duration, or where a foot comes to
the end of a step, gap or hurdle.  A simulation that diverges raises dm_control's PhysicsError.  Contacts are those of
the last substep, known once it is done.
"""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Literal

import numpy as np
from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_control.utils import rewards
from dm_env import specs

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.description import ROOT_QPOS, ROOT_QVEL
from hexmj.bodies.grounds import beyond_the_ground
from hexmj.bodies.loading import compile_body
from hexmj.checks import given, numbers, typed
from hexmj.conditions import Conditions
from hexmj.controllers.asking import begin, tell
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, ReadingPlan, check_controller_type
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.physics.backend import AFTER, Rolled
from hexmj.physics.fine_steps import FineSteps, Shown
from hexmj.physics.orders import OrdersFromPlan
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import settle
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
    conditions, stride = given("conditions", conditions, Conditions), given("stride", stride, Stride)
    if not 0 < (velocity := typed("velocity", velocity, float)) < 1:
        raise InputError(f"velocity = {velocity}; expected 0 < V < 1, a fraction of the protraction velocity V_p")
    typed("actions", actions, Literal["joints", "tips"])
    check_controller_type(controller)
    whole = float(steps_within(typed("duration", duration, float), stride) * stride.dt)
    task = TASKS[actions](velocity, controller, conditions, stride, whole, seed)
    compiled = compile_body(conditions, conditions.timestep(stride))
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, task, n_sub_steps=conditions.substeps(stride))


class InsectPhysics(mujoco.Physics):
    """The insect in dm_control, and what is measured on it."""

    compiled: CompiledBody
    """The insect and its conditions; set by `load`."""
    shown: Shown
    """What the last step has shown of it, the only one: sensors, torques and depth, each (1, substep, ...)."""

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
        self.shown = FineSteps.of(self, nstep, self.compiled).take(ONLY, control[np.newaxis])
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
        feet, sensors, force = [self._feet()], [], []
        for now in control:
            super().set_control(now)
            super().step()
            sensors.append(self.data.sensordata.copy())
            force.append(self.data.actuator_force.copy())
            feet.append(self._feet())
        seen = (np.array(values)[np.newaxis] for values in (feet, sensors, force))
        return Rolled(*seen, after=np.empty((1, len(control), 0)))

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


@dataclass(eq=False)
class Walking(control.Task):
    """Walk straight ahead; subclasses say what an action means.  The arguments are those of `load`."""

    velocity: float
    controller: Controller
    conditions: Conditions
    stride: Stride
    duration: float
    seed: int

    def __post_init__(self) -> None:
        """Draw the first starts."""
        self._starts, self._episodes = draw_starts(16, self.seed, self.stride), 0
        self._command = self.velocity * self.conditions.time.vp

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        if self._episodes == len(self._starts):
            self._starts = draw_starts(2 * self._episodes, self.seed, self.stride)
        start = self._starts[[self._episodes]]
        self._episodes += 1
        settled = settle(start, self.conditions, self.stride, threads=1)
        mujoco.mj_setState(physics.model.ptr, physics.data.ptr, settled.state[0], AFTER)
        physics.set_control(settled.ctrl[0])
        plan = begin(self.controller, start, self.velocity, self.stride, threads=1)
        self._orders, self._senses = OrdersFromPlan(settled, plan, self.duration), Senses(settled)
        self._reading = plan if isinstance(plan, ReadingPlan) else None
        self._planned_stance, self._out_of_reach = np.ones(6), np.zeros(6)
        self._fell = False

    def before_step(self, action: np.ndarray, physics: InsectPhysics) -> None:
        """Advance the plan by one step and tell the joints where to go."""
        spec, action = self.action_spec(physics), numbers("action", action)
        if action.shape != spec.shape:
            raise InputError(f"an action has the shape {action.shape}; expected {spec.shape}")
        within = (action >= spec.minimum - ROUNDING) & (action <= spec.maximum + ROUNDING)
        if not within.all():
            i = int(np.argmin(within))
            name, least, most = spec.name.split()[i], spec.minimum[i], spec.maximum[i]
            raise InputError(f"the action's {name} = {action[i]}; expected {least:.4g} to {most:.4g}")
        if self._reading:
            here = physics.position()[np.newaxis], physics.velocity()[np.newaxis]
            tell(self._reading, self._senses.sensed(ONLY, *here))
        if orders := self._orders.ahead(ONLY, steps=1, offset=self.tip_offsets(action)):
            self._planned_stance = orders.plan.stance[0, 0].astype(float)
            self._out_of_reach = orders.missed[0].sum(axis=0).astype(float)
            control = orders.control[0]
            joints = control[:, physics.compiled.columns.ctrl]
            joints[:] = self.joint_targets(action, joints)
            physics.set_control(control)

    def tip_offsets(self, action: np.ndarray) -> np.ndarray | None:
        """What feet do beside the plan, (leg, axis) [mm]."""

    def joint_targets(self, action: np.ndarray, planned: np.ndarray) -> np.ndarray:
        """What the joints do, from what they would do by the plan and the offsets, (substep, joint) [rad]."""
        return planned

    def after_step(self, physics: InsectPhysics) -> None:
        """Note which feet stand, whether the trunk has touched the ground, and whether that ends here."""
        columns, sensors = physics.compiled.columns, physics.shown["sensors"]
        self._senses.feel(ONLY, sensors, physics.shown["force"][:, :, columns.ctrl])
        self._fell = bool((sensors[:, :, columns.trunk] > 0).any())
        feet, conditions = sensors[0, :, columns.foot].reshape(-1, 6, 3), self.conditions
        self._at_the_end = bool(beyond_the_ground(conditions.ground, conditions.body.lengths, feet).any())

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        return OrderedDict((spec.name, spec) for spec in observation_specs(physics.compiled.joints))

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        qpos, qvel = physics.position(), physics.velocity()
        standing = self._senses.standing(ONLY)[0]
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
            planned_tips=self._orders.tips[0].copy(),
        )

    def get_reward(self, physics: InsectPhysics) -> float:
        """max(0, 1 - |v - c| / c) max(0, u), and 0 on a fall."""
        v, c, upright = float(physics.data.qvel[0]), self._command, float(physics.rotation()[2, 2])
        at_speed = rewards.tolerance(v, bounds=(c, c), margin=c, sigmoid="linear", value_at_margin=0.0)
        return 0.0 if self._fell else at_speed * max(0.0, upright)

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Discount 0 on a fall, 1 when the time or the ground is over, nothing before."""
        if self._fell:
            return 0.0
        return 1.0 if self._at_the_end or not self._orders.steps_ahead() else None


class JointTargets(Walking):
    """An action gives the targets of all joints, held for the step."""

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounded by the joints' ranges [rad]; the actuators' names are joined by tabs."""
        compiled = physics.compiled
        low, high = physics.model.actuator_ctrlrange[compiled.columns.ctrl].T
        return specs.BoundedArray((compiled.joints,), float, low, high, name="\t".join(compiled.body.joints))

    def joint_targets(self, action: np.ndarray, planned: np.ndarray) -> np.ndarray:
        """The action itself, throughout."""
        return action


class TipOffsets(Walking):
    """An action gives offsets to the tips that the controller plans."""

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounded by `Lengths.largest_tip_offset` [mm]; the names are joined by tabs."""
        names = "\t".join(f"{leg}_{axis}" for leg in LEGS for axis in ("forward", "left", "up"))
        bound = np.full(3 * len(LEGS), physics.compiled.body.lengths.largest_tip_offset)
        return specs.BoundedArray(bound.shape, float, -bound, bound, name=names)

    def tip_offsets(self, action: np.ndarray) -> np.ndarray:
        """The action itself; a leg whose tip is out of reach keeps its last angles."""
        return action.reshape(6, 3)

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        most = float(self.conditions.substeps(self.stride))
        spec = specs.BoundedArray((6,), float, 0.0, most, "out_of_reach")
        return super().observation_spec(physics) | {"out_of_reach": spec}

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        return super().get_observation(physics) | {"out_of_reach": self._out_of_reach}


TASKS: dict[str, type[Walking]] = {"joints": JointTargets, "tips": TipOffsets}
"""Kinds of actions by their names."""
