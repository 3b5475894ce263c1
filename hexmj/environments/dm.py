"""The insect as a dm_env environment on dm_control; `task` describes episodes, observations and rewards.

Actions are not normalised: joint targets [rad], or tip offsets forward, left and up [mm]. A fall ends an episode with
discount 0. Reaching the time limit or the end of the ground ends it with discount 1. A simulation that diverges raises
dm_control's PhysicsError. Without a display, set MUJOCO_GL=egl before the import.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.errors import InputError

try:
    from dm_control import mujoco
    from dm_control.mujoco import wrapper
    from dm_control.rl import control
    from dm_env import specs
except ModuleNotFoundError:
    raise InputError("dm_control, which needs Python below 3.13, is not installed: use environments.gym") from None

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import check_home, compile_body
from hexmj.environments.observing import step_reward
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
"""Indices of the insects, (1,): a dm_env environment has one insect."""


def load(velocity: float = 0.3, *, seed: int = 0, **task: Any) -> control.Environment:
    """Return the environment, for example for `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        seed: seed of the starts; successive episodes begin at successive starts of `draw_starts` with this seed.
        task: actions, controller, conditions, stride, duration, see `task.Task`. With actions='joints', an action has
            the targets of all joints, (leg * joint,) [rad], within the joints' ranges. With actions='tips', it has the
            offsets to the planned tips forward, left and up, (leg * axis,) [mm].

    Raises:
        InputError: an argument is out of its range. The environment's `step` raises it if an action is out of bounds.
    """
    settings = Task(velocity, **task)
    conditions, stride = settings.conditions, settings.stride
    compiled = compile_body(conditions, conditions.timestep(stride))
    check_home(compiled)
    physics = InsectPhysics.from_model(wrapper.MjModel(compiled.model))
    physics.compiled = compiled
    return control.Environment(physics, Walking(settings, seed), n_sub_steps=settings.substeps)


class InsectPhysics(mujoco.Physics):
    """dm_control's physics of the insect; it steps with `walkers.Alone`."""

    compiled: CompiledBody
    """The compiled body, which `load` sets."""
    shown: Shown
    """Record of the last step, such as sensors and forces, each (1, substep, ...)."""

    rows: np.ndarray | None = None
    """Controls of the next substeps, (substep, actuator) [rad]; None repeats the control set by `set_control`."""

    def _reload_from_data(self, data: wrapper.MjData) -> None:
        super()._reload_from_data(data)
        self._alone: Alone | None = None

    def copy(self, share_model: bool = False) -> "InsectPhysics":
        """Return an independent copy, for example for planning; equal actions move both to equal states."""
        copied = super().copy(share_model)
        copied.compiled = self.compiled
        return copied

    def after_reset(self) -> None:
        """Compute all quantities of the state; dm_control omits the actuator forces, which the first step needs."""
        self.forward()

    def step(self, nstep: int = 1) -> None:
        """Advance by `nstep` substeps; if a foot strikes the ground, repeat them with shorter ones, see `substeps`."""
        rows = self.data.ctrl[np.newaxis].repeat(nstep, axis=0) if self.rows is None else self.rows
        self.rows = None
        try:
            self.shown = self.alone.take(ONLY, rows[np.newaxis])
        except Diverged as error:
            raise control.PhysicsError(f"the simulation diverged: {error.kinds}") from None

    @property
    def alone(self) -> Alone:
        """Engine that takes the steps; it is made again whenever dm_control replaces MuJoCo's data."""
        if self._alone is None:
            self._alone = Alone(self.compiled, self.model.ptr, self.data.ptr)
        return self._alone


@dataclass(eq=False)
class Walking(control.Task):
    """dm_control's task of walking straight ahead.

    Starts are drawn from `_random`, a generator that wrappers of dm_control may replace.
    """

    task: Task
    seed: int

    def __post_init__(self) -> None:
        """Make the random generator of the starts."""
        self._random = np.random.default_rng(whole("seed", self.seed, 0))

    @property
    def random(self) -> np.random.Generator:
        """Random generator of the starts; dm_control's wrapper `action_noise` uses it too."""
        return self._random

    def initialize_episode(self, physics: InsectPhysics) -> None:
        """Draw the next start and let the insect settle there."""
        self._walkers = Walkers(self.task, physics.compiled, physics.alone, count=1, threads=1)
        self._acted, self._spec = Acted(*np.zeros((3, 1))), self.action_spec(physics)
        self._walkers.begin(ONLY, draw_start(self._random, self.task))

    def before_step(self, action: np.ndarray, physics: InsectPhysics) -> None:
        """Advance the plan by one step and set the controls of its substeps."""
        self._walkers.check_begun()
        spec = self._spec
        action = checked_actions(action, spec.shape, spec.minimum, spec.maximum)
        self._bind(physics)
        physics.rows = self._walkers.control(action[np.newaxis])[0]

    def after_step(self, physics: InsectPhysics) -> None:
        """Determine whether the step ended the episode, by a fall, the time limit or the end of the ground."""
        self._acted = self._walkers.judge(physics.shown)

    def action_spec(self, physics: InsectPhysics) -> specs.BoundedArray:
        """Return the bounds of an action; the name of the spec lists the names of all numbers, separated by tabs."""
        low, _, high = action_bounds(physics.compiled, self.task)
        names = "\t".join(action_names(physics.compiled, self.task))
        return specs.BoundedArray(low.shape, float, low, high, names)

    def observation_spec(self, physics: InsectPhysics) -> dict[str, specs.BoundedArray]:
        """Return the bounds and shape of every observation, by name."""
        bounds = observation_bounds(physics.compiled, self.task)
        return {name: specs.BoundedArray(low.shape, float, low, high, name) for name, (low, high) in bounds.items()}

    def get_observation(self, physics: InsectPhysics) -> dict[str, np.ndarray]:
        """Return the observations by name, in the order of `observation_spec`."""
        self._bind(physics)
        return self._walkers.observer.named(self._walkers.observations()[0])

    def get_reward(self, physics: InsectPhysics) -> float:
        """Return the reward of the last step, see `task`; 0 if the insect fell."""
        body = physics.alone
        return 0.0 if self._acted.terminated else step_reward(body.qvel[0], body.rotation[0], self.task.command)

    def get_termination(self, physics: InsectPhysics) -> float | None:
        """Return the discount: 0 after a fall, 1 at the time limit or the end of the ground, None within an episode."""
        if self._acted.terminated:
            return 0.0
        return 1.0 if self._acted.truncated else None

    def _bind(self, physics: InsectPhysics) -> None:
        if physics.alone is not self._walkers.bodies:
            self._walkers.bind(physics.alone)
