"""The insect as a dm_env environment on dm_control: walk straight ahead at a commanded velocity.

An episode begins at a random start in S, settled as for a physical walk.  One step of the environment is one
step of the network, with its substeps.  The network runs along and its plan is observed whatever the actions
are: the targets of all joints, held for the step ('joints'), or offsets to the tips that the network plans
('tips'), so that zeros are the pure network's walk, bit for bit that of `physical_walks.physical_walk`.

Observations, all float64:

- joint_angles, joint_velocities: (leg * joint,) [rad], [rad/s], in the order of `ctrl`
- orientation: unit quaternion of the root, (w, x, y, z); the walk should go along the world's x
- velocity: of the root, ahead, to the left and up, seen from its heading [mm/s]
- angular_velocity: of the root, in its own frame [rad/s]
- clearance: height of the trunk's lowest point [mm]
- tips: in the root frame, (leg, axis) [mm]
- contact: (leg,) 1 where the ground carried the foot within the last `Body.contact_gap`
- margin: measured stability margin [mm], from the feet in contact and the insect's own centre of mass;
  `NO_FOOT`, out of any foot's reach, where no foot is in contact
- command: velocity to walk at [mm/s]
- planned_stance: (leg,) 1 where the network lets the leg stand
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

from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun, steps_within
from hexmj.parameters import LDVS, Model, Network
from hexmj.physics import insect
from hexmj.physics.body import Body
from hexmj.physics.ground import depth_in_ground
from hexmj.physics.kinematics import tips_to_joints
from hexmj.physics.settling import settle
from hexmj.physics.strikes import FINER, FINEST, in_whole_steps, strikes
from hexmj.physics.targets import TipTargets
from hexmj.stability import stability_margin

LARGEST_OFFSET = 5.0
"""Greatest offset of a tip in each direction [mm]."""

NO_FOOT = -100.0
"""Stands for a stability margin of -inf [mm]; a foot in contact gives more, since no leg reaches so far."""

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that a step goes on from, the solver's warm start included."""

OBSERVATIONS = (
    specs.Array((18,), float, "joint_angles"),
    specs.Array((18,), float, "joint_velocities"),
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
    model: Model = LDVS,
    body: Body | None = None,
    network: Network | None = None,
    duration: float = 200.0,
    seed: int = 0,
) -> control.Environment:
    """The environment; it can be given to `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        actions: 'joints', targets of all joints, (leg * joint,) [rad] within the joints' ranges; or 'tips',
            offsets to the planned tips, (leg * axis,) [mm]: forward, left, up.
        model: coupling weights.
        body: conditions of the walk.
        network: constants of the plan; its time step is that of the environment.
        duration: of an episode [time units of the network].
        seed: of the starts; the episodes take those of `draw_starts` one after the other.

    Raises:
        InputError: a value that makes no sense; here, or for an action in `step`.
    """
    body, network = body or Body(), network or Network()
    if not 0 < velocity < 1:
        raise InputError(f"velocity = {velocity}; expected 0 < V < 1, a fraction of the protraction velocity V_p")
    if body.feedback:
        raise InputError("feedback = True; expected False, since here it is the actions that close the loop")
    if actions not in TASKS:
        raise InputError(f"actions = {actions!r}; valid names: {', '.join(TASKS)}")
    task = TASKS[actions](velocity, model, body, network, int(steps_within(duration, network)), seed)
    substeps = body.substeps(network)
    compiled = insect.load(body.seconds(network) / substeps, body)
    return control.Environment(InsectPhysics.from_model(wrapper.MjModel(compiled)), task, n_sub_steps=substeps)


class InsectPhysics(mujoco.Physics):
    """The insect in dm_control, and what is measured on it."""

    touch: np.ndarray
    """(substep, leg) normal force of the ground on each foot in the last step, its mean over a substep in parts
    [g mm/s^2]."""
    trunk: np.ndarray
    """(substep, part) contacts of each part of the trunk with the ground in the last step."""

    def _reload_from_data(self, data: wrapper.MjData) -> None:
        super()._reload_from_data(data)
        self._columns = insect.sensors(self.model.ptr)
        self._body, self._foot = insect.body_of(self.model.ptr), insect.dimensions(self.model.ptr).foot
        self._corners, self._radii = insect.trunk_corners(self.model.ptr)
        self._next: list[np.ndarray] = []

    def after_reset(self) -> None:
        """Make everything current; dm_control would leave out the actuators, which the first step then lacks."""
        self.forward()

    def set_control(self, control: np.ndarray) -> None:
        """Targets of the joints [rad]: (actuator,), or (substep, actuator), one row for each substep to come."""
        now, *self._next = np.atleast_2d(control)
        super().set_control(now)

    def step(self, nstep: int = 1) -> None:
        """Advance by `nstep` substeps; finely if a foot strikes the ground in them, see `strikes`."""
        rows = [self.data.ctrl.copy(), *self._next]
        before = self.get_state(_STATE)
        seen, depth = self._advance(control := np.array((rows + nstep * rows[-1:])[:nstep]))
        parts = 1
        while strikes(depth, parts * nstep, self._body.standing_height).any() and parts < FINEST:
            parts *= FINER
            self.set_state(before, _STATE)
            seen, depth = self._advance_finely(control, parts)
        self.touch, self.trunk = seen[:, self._columns.touch], seen[:, self._columns.trunk]
        self.set_control(np.array(rows[nstep:] or rows[-1:]))

    def _advance(self, control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the sensors held after a substep for each row, (row, column), and the feet's depths, (1 + row, leg)."""
        feet, seen = [self._feet()], np.empty((len(control), self.model.nsensordata))
        for now, row in zip(control, seen, strict=True):
            super().set_control(now)
            super().step()
            row[:] = self.data.sensordata
            feet.append(self._feet())
        return seen, depth_in_ground(self._body, np.array(feet), self._foot)

    def _advance_finely(self, control: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
        """The same with substeps in parts and harder contacts, from a state just put back; depths of every part."""
        model, usual, timestep = self.model, self.model.pair_solref.copy(), self.model.opt.timestep
        model.opt.timestep, model.pair_solref[:, 0] = timestep / parts, 2 * timestep / parts
        try:
            mujoco.mj_step1(model.ptr, self.data.ptr)
            seen, depth = self._advance(control.repeat(parts, axis=0))
        finally:
            model.opt.timestep, model.pair_solref[:] = timestep, usual
        mujoco.mj_step1(model.ptr, self.data.ptr)
        return in_whole_steps(seen, parts, self._columns.touch), depth

    def rotation(self) -> np.ndarray:
        """From the root frame to the world, (axis, axis)."""
        return self.named.data.xmat["mesothorax"].reshape(3, 3)

    def velocity_from_heading(self) -> np.ndarray:
        """Velocity of the root ahead, to the left and up, (axis,) [mm/s]."""
        heading = np.arctan2(self.rotation()[1, 0], self.rotation()[0, 0])
        x, y, up = self.data.qvel[:3]
        return np.array([np.cos(heading) * x + np.sin(heading) * y, np.cos(heading) * y - np.sin(heading) * x, up])

    def clearance(self) -> np.ndarray:
        """Height of the trunk's lowest point over the ground [mm]."""
        return np.array((self.data.qpos[2] + self._corners @ self.rotation()[2] - self._radii).min())

    def tips(self) -> np.ndarray:
        """Tips in the root frame, (leg, axis) [mm]."""
        return (self._feet() - self.data.qpos[:3]) @ self.rotation()

    def margin(self, standing: np.ndarray) -> np.ndarray:
        """Stability margin on the feet that stand, (leg,), seen from the centre of mass [mm]."""
        if not standing.any():
            return np.array(NO_FOOT)
        centre = self.data.sensordata[self._columns.centre_of_mass]
        return stability_margin((self._feet() - centre)[:, :2], standing, threads=1)

    def _feet(self) -> np.ndarray:
        return self.data.sensordata[self._columns.foot].reshape(6, 3).copy()


class Walking(control.Task):
    """Walk straight ahead; subclasses say what an action means."""

    def __init__(self, velocity: float, model: Model, body: Body, network: Network, steps: int, seed: int) -> None:
        """The arguments are those of `load`, but for the `steps` of an episode."""
        self._velocity, self._model, self._body, self._network = velocity, model, body, network
        self._command = velocity * body.vp
        self._steps, self._seed = steps, seed
        self._starts, self._episodes = draw_starts(16, seed, network), 0

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        if self._episodes == len(self._starts):
            self._starts = draw_starts(2 * self._episodes, self._seed, self._network)
        start = self._starts[[self._episodes]]
        self._episodes += 1
        settled = settle(start, self._body, self._network, threads=1)
        physics.data.qpos[:], physics.data.qvel[:] = settled.qpos[0], settled.qvel[0]
        physics.data.qacc_warmstart[:] = settled.warmstart[0]
        physics.set_control(settled.ctrl[0])
        self._plan = NetworkRun(start, self._model, self._velocity, network=self._network, threads=1)
        self._targets = TipTargets(start, self._body, self._network)
        origin, y = self._network.geometry.origin, self._network.geometry.y
        self._planned_stance = np.ones(6)
        self._planned_tips = np.stack([start[0] + origin, y, np.full(6, -self._body.standing_height)], axis=-1)
        self._unloaded = np.zeros(6, dtype=int)
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
        ahead = self._plan.advance(1)
        tips = self._targets.follow(ahead, np.zeros(1, dtype=int))[0]
        self._planned_stance, self._planned_tips = ahead.stance[0, 0].astype(float), tips[-1]
        physics.set_control(self.joint_targets(action, tips, physics))

    @abstractmethod
    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """Targets (actuator,) or (substep, actuator) [rad], from the planned tips, (substep, leg, axis) [mm]."""

    def after_step(self, physics: InsectPhysics) -> None:
        """Note which feet stand and whether the trunk has touched the ground."""
        for touch in physics.touch:
            self._unloaded = np.where(touch > 0, 0, self._unloaded + 1)
        self._fell = bool((physics.trunk > 0).any())

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        return OrderedDict((spec.name, spec) for spec in OBSERVATIONS)

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        qpos, qvel = physics.position(), physics.velocity()
        standing = self._unloaded <= self._body.contact_gap / 1000.0 / physics.timestep()
        return OrderedDict(
            joint_angles=qpos[insect.ROOT_QPOS :],
            joint_velocities=qvel[insect.ROOT_QVEL :],
            orientation=qpos[3 : insect.ROOT_QPOS],
            velocity=physics.velocity_from_heading(),
            angular_velocity=qvel[3 : insect.ROOT_QVEL],
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
        names = "\t".join(f"{leg}_{joint}" for leg in LEGS for joint in insect.JOINTS)
        return specs.BoundedArray((18,), float, *physics.model.actuator_ctrlrange.T, name=names)

    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """The action itself."""
        return action


class TipOffsets(Walking):
    """An action gives offsets to the tips that the network plans."""

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounded by `LARGEST_OFFSET` [mm]; the names are joined by tabs."""
        names = "\t".join(f"{leg}_{axis}" for leg in LEGS for axis in ("forward", "left", "up"))
        bound = np.full(18, LARGEST_OFFSET)
        return specs.BoundedArray((18,), float, -bound, bound, name=names)

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start; nothing is out of reach yet."""
        super().initialize_episode(physics)
        self._out_of_reach = np.zeros(6)

    def joint_targets(self, action: np.ndarray, tips: np.ndarray, physics: InsectPhysics) -> np.ndarray:
        """The angles that put the tips there; a leg whose tip is out of reach keeps its last ones."""
        joints, reachable = tips_to_joints(tips + action.reshape(6, 3), insect.dimensions(physics.model.ptr))
        self._out_of_reach = (~reachable).sum(axis=0).astype(float)
        last = physics.control().reshape(6, 3)
        for now in joints:
            now[...] = last = np.where(np.isnan(now), last, now)
        return joints.reshape(len(tips), -1)

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.Array]:
        """The specs of all observations by their names."""
        most = float(self._body.substeps(self._network))
        spec = specs.BoundedArray((6,), float, 0.0, most, "out_of_reach")
        return super().observation_spec(physics) | {"out_of_reach": spec}

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        return super().get_observation(physics) | {"out_of_reach": self._out_of_reach}


TASKS: dict[str, type[Walking]] = {"joints": JointTargets, "tips": TipOffsets}
"""Kinds of actions by their names."""
