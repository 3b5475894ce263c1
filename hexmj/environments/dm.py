"""The insect as a dm_env environment on dm_control; what an episode is stands in `task`.

Actions have units here: targets [rad] within the joints' ranges, or offsets [mm]: forward, left, up.  A fall ends an
episode with discount 0, its time or the end of the ground with discount 1.  A simulation that diverges raises
dm_control's PhysicsError.  Contacts are those of the last substep, known once it is done.
"""

import os
import warnings
from collections import OrderedDict
from dataclasses import dataclass

import glfw
import numpy as np

with warnings.catch_warnings():
    if "MUJOCO_GL" not in os.environ:  # without a screen GLFW only warns, and dm_control would never come to EGL
        warnings.simplefilter("error", glfw.GLFWError)
    from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_env import specs

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.loading import compile_body
from hexmj.checks import given, numbers
from hexmj.conditions import Conditions
from hexmj.controllers.asking import begin, tell
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, ReadingPlan
from hexmj.environments.task import (
    Actions,
    Seen,
    Task,
    action_bounds,
    action_names,
    at_the_end,
    clearance,
    fallen,
    margin,
    observation_bounds,
    own_observations,
    rewards,
    tips,
    velocity_from_heading,
)
from hexmj.errors import InputError
from hexmj.physics.backend import AFTER, Rolled
from hexmj.physics.fine_steps import FineSteps, Shown
from hexmj.physics.orders import OrdersFromPlan
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import settle
from hexmj.starts import check_draw
from hexmj.timing import Stride

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""

ONLY = np.array([0])
"""The index of the only insect."""

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that a step goes on from, the solver's warm start included."""


def load(
    velocity: float = 0.3,
    *,
    actions: Actions = "joints",
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
    task = Task(velocity, actions, controller, conditions, stride, duration)
    compiled = compile_body(conditions, conditions.timestep(stride))
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, KINDS[actions](task, seed), n_sub_steps=task.substeps)


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

    def seen(self) -> Seen:
        """The insect as it is now, the only one."""
        data, columns = self.data, self.compiled.columns
        return Seen(
            qpos=data.qpos[np.newaxis],
            qvel=data.qvel[np.newaxis],
            rotation=data.xmat[self.compiled.root].reshape(1, 3, 3),
            feet=self._feet()[np.newaxis],
            centre_of_mass=data.sensordata[np.newaxis, columns.centre_of_mass],
        )

    def velocity_from_heading(self) -> np.ndarray:
        """Velocity of the root ahead, to the left and up, (axis,) [mm/s]."""
        return velocity_from_heading(self.seen())[0]

    def clearance(self) -> np.ndarray:
        """Height of the trunk's lowest point over the ground [mm]."""
        return clearance(self.seen(), self.compiled)[0]

    def tips(self) -> np.ndarray:
        """Tips in the root frame, (leg, axis) [mm]."""
        return tips(self.seen())[0]

    def margin(self, standing: np.ndarray) -> np.ndarray:
        """Stability margin on the feet that stand, (leg,), seen from the centre of mass [mm]."""
        return margin(self.seen(), standing[np.newaxis], self.compiled)[0]

    def _feet(self) -> np.ndarray:
        return self.data.sensordata[self.compiled.columns.foot].reshape(6, 3).copy()


@dataclass(eq=False)
class Walking(control.Task):
    """Walk straight ahead; subclasses say what an action means.

    Starts are drawn from `_random`, which may be replaced by any of NumPy's generators, as wrappers of dm_control do.
    """

    task: Task
    seed: int

    def __post_init__(self) -> None:
        """Draw the starts of `draw_starts` by the seed."""
        self._random = np.random.default_rng(check_draw(1, self.seed)[1])

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        task, stride = self.task, self.task.stride
        start = self._random.uniform(stride.pep0, stride.aep0, (1, 6))
        settled = settle(start, task.conditions, stride, threads=1)
        mujoco.mj_setState(physics.model.ptr, physics.data.ptr, settled.state[0], AFTER)
        physics.set_control(settled.ctrl[0])
        plan = begin(task.controller, start, task.velocity, stride, threads=1)
        self._orders, self._senses = OrdersFromPlan(settled, plan, task.steps * stride.dt), Senses(settled)
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
        sensors, force = physics.shown["sensors"], physics.shown["force"]
        self._senses.feel(ONLY, sensors, force[:, :, physics.compiled.columns.ctrl])
        self._fell = bool(fallen(sensors, physics.compiled)[0])

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Bounds of an action; the names of its numbers are joined by tabs."""
        low, _, high = action_bounds(physics.compiled, self.task)
        return specs.BoundedArray(
            low.shape, float, low, high, name="\t".join(action_names(physics.compiled, self.task))
        )

    def observation_spec(self, physics: InsectPhysics) -> OrderedDict[str, specs.BoundedArray]:
        """The specs of all observations by their names."""
        bounds = observation_bounds(physics.compiled, self.task)
        return OrderedDict(
            (name, specs.BoundedArray(low.shape, float, low, high, name)) for name, (low, high) in bounds.items()
        )

    def get_observation(self, physics: InsectPhysics) -> OrderedDict[str, np.ndarray]:
        """The observations, in the order of their specs."""
        own = own_observations(physics.seen(), self._senses.standing(ONLY), physics.compiled)
        observed = {name: values[0].astype(float) for name, values in own.items()} | {
            "command": np.array([self.task.command]),
            "planned_stance": self._planned_stance,
            "planned_tips": self._orders.tips[0],
            "out_of_reach": self._out_of_reach,
        }
        bounds = observation_bounds(physics.compiled, self.task)
        return OrderedDict((name, np.clip(observed[name], low, high)) for name, (low, high) in bounds.items())

    def get_reward(self, physics: InsectPhysics) -> float:
        """See `task`."""
        return float(rewards(physics.seen(), np.array([self._fell]), self.task)[0])

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Discount 0 on a fall, 1 when the time or the ground is over, nothing before."""
        if self._fell:
            return 0.0
        return 1.0 if at_the_end(physics.seen(), self.task)[0] or not self._orders.steps_ahead() else None


class JointTargets(Walking):
    """An action gives the targets of all joints, held for the step."""

    def joint_targets(self, action: np.ndarray, planned: np.ndarray) -> np.ndarray:
        """The action itself, throughout."""
        return action


class TipOffsets(Walking):
    """An action gives offsets to the tips that the controller plans."""

    def tip_offsets(self, action: np.ndarray) -> np.ndarray:
        """The action itself; a leg whose tip is out of reach keeps its last angles."""
        return action.reshape(6, 3)


KINDS: dict[Actions, type[Walking]] = {"joints": JointTargets, "tips": TipOffsets}
"""Tasks by what an action means."""
