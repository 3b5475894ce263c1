"""The insect as a dm_env environment on dm_control; `task` describes episodes, observations and rewards.

Actions have units here: targets [rad] within the joints' ranges, or offsets [mm]: forward, left, up. A fall ends an
episode with discount 0; its time or the end of the ground ends it with discount 1. A simulation that diverges raises
dm_control's PhysicsError. Without a display, set MUJOCO_GL=egl before the import.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.mujoco import wrapper
from dm_control.rl import control
from dm_env import specs

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import check_home, compile_body
from hexmj.environments.observing import worth
from hexmj.environments.task import (
    Task,
    action_bounds,
    action_names,
    checked_actions,
    draw_start,
    observation_bounds,
)
from hexmj.environments.walkers import Acted, Alone, Walkers
from hexmj.physics.engine import Diverged
from hexmj.physics.substeps import Shown
from hexmj.validate import whole

ONLY = np.array([0])
"""Index of the only insect."""


def load(velocity: float = 0.3, *, seed: int = 0, **task: Any) -> control.Environment:
    """Return the environment, for example for `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        seed: seed of the starts; the episodes take the starts of `draw_starts` in order.
        task: actions, controller, conditions, stride, duration, see `task.Task`. The actions 'joints' are targets of
            all joints, (leg * joint,) [rad] within the joints' ranges; 'tips' are offsets to the planned tips,
            (leg * axis,) [mm]: forward, left, up.

    Raises:
        InputError: a value is out of its range; `step` raises it for an action.
    """
    settings = Task(velocity, **task)
    conditions, stride = settings.conditions, settings.stride
    compiled = compile_body(conditions, conditions.timestep(stride))
    check_home(compiled)
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, Walking(settings, seed), n_sub_steps=settings.substeps)


class InsectPhysics(mujoco.Physics):
    """The insect in dm_control."""

    compiled: CompiledBody
    """The compiled body; set by `load`."""
    shown: Shown
    """Sensors, torques and depth of the last step, each (1, substep, ...)."""

    rows: np.ndarray | None = None
    """Joint targets of the substeps to come, (substep, actuator) [rad]; by default those of `set_control`."""

    def _reload_from_data(self, data: wrapper.MjData) -> None:
        super()._reload_from_data(data)
        self._alone: Alone | None = None

    def copy(self, share_model: bool = False) -> "InsectPhysics":
        """Return a copy for planners, which continues in the same way."""
        copied = super().copy(share_model)
        copied.compiled = self.compiled
        return copied

    def after_reset(self) -> None:
        """Compute everything; dm_control leaves out the actuators, which the first step needs."""
        self.forward()

    def step(self, nstep: int = 1) -> None:
        """Advance by `nstep` substeps, which are divided if a foot strikes the ground, see `substeps`."""
        rows = self.data.ctrl[np.newaxis].repeat(nstep, axis=0) if self.rows is None else self.rows
        self.rows = None
        try:
            self.shown = self.alone.take(ONLY, rows[np.newaxis])
        except Diverged as error:
            raise control.PhysicsError(f"the simulation diverged: {error.kinds}") from None

    @property
    def alone(self) -> Alone:
        """The engine that takes the steps; a new one after dm_control has replaced the data."""
        if self._alone is None:
            self._alone = Alone(self.compiled, self.model.ptr, self.data.ptr)
        return self._alone


@dataclass(eq=False)
class Walking(control.Task):
    """Walk straight ahead.

    Starts are drawn from `_random`, which wrappers of dm_control may replace.
    """

    task: Task
    seed: int

    def __post_init__(self) -> None:
        """Make the generator of the starts."""
        self._random = np.random.default_rng(whole("seed", self.seed, 0))

    @property
    def random(self) -> np.random.Generator:
        """Generator of the starts; dm_control's wrapper `action_noise` uses it too."""
        return self._random

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Settle the next start."""
        self._walkers = Walkers(self.task, physics.compiled, physics.alone, count=1, threads=1)
        self._acted, self._spec = Acted(*np.zeros((3, 1))), self.action_spec(physics)
        self._walkers.begin(ONLY, draw_start(self._random, self.task))

    def before_step(self, action: np.ndarray, physics: InsectPhysics) -> None:
        """Advance the plan by one step and set the joint targets."""
        self._walkers.check_begun()
        spec = self._spec
        action = checked_actions(action, spec.shape, spec.minimum, spec.maximum)
        self._look(physics)
        physics.rows = self._walkers.control(action[np.newaxis])[0]

    def after_step(self, physics: InsectPhysics) -> None:
        """Compute reward and end of the step."""
        self._acted = self._walkers.judge(physics.shown)

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Return the bounds of an action; tabs separate the names of its numbers."""
        low, _, high = action_bounds(physics.compiled, self.task)
        names = "\t".join(action_names(physics.compiled, self.task))
        return specs.BoundedArray(low.shape, float, low, high, names)

    def observation_spec(self, physics: InsectPhysics) -> dict[str, specs.BoundedArray]:
        """Return the specs of all observations by name."""
        bounds = observation_bounds(physics.compiled, self.task)
        return {name: specs.BoundedArray(low.shape, float, low, high, name) for name, (low, high) in bounds.items()}

    def get_observation(self, physics: InsectPhysics) -> dict[str, np.ndarray]:
        """Return the observations in the order of their specs."""
        self._look(physics)
        return self._walkers.observer.named(self._walkers.observations()[0])

    def get_reward(self, physics: InsectPhysics) -> float:
        """Return the reward, see `task`."""
        body = physics.alone
        return 0.0 if self._acted.terminated else worth(body.qvel[0], body.rotation[0], self.task.command)

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Return discount 0 on a fall, 1 at the end of time or ground, and None before."""
        if self._acted.terminated:
            return 0.0
        return 1.0 if self._acted.truncated else None

    def _look(self, physics: InsectPhysics) -> None:
        if physics.alone is not self._walkers.bodies:
            self._walkers.look(physics.alone)
