"""The insect as a dm_env environment on dm_control; `task` describes episodes, observations and rewards.

Actions are not normalised: joint targets [rad], or tip offsets forward, left and up [mm]. A fall ends an episode with
discount 0. Reaching the time limit or the end of the ground ends it with discount 1. Without a display, set
MUJOCO_GL=egl before the import.
"""

from typing import Any

import numpy as np

from hexmj.errors import InputError

try:
    import dm_env
    from dm_control import mujoco
    from dm_control.mujoco import wrapper
    from dm_control.rl import control
    from dm_env import specs
except ModuleNotFoundError:
    raise InputError("dm_control, which needs Python below 3.13, is not installed: use environments.gym") from None

from hexmj.bodies.mjcf import compile_body
from hexmj.environments.task import Task, action_bounds, draw_start, observation_shapes
from hexmj.environments.walkers import Alone, Walkers
from hexmj.validate import whole


def load(velocity: float = 0.3, *, seed: int = 0, **task: Any) -> "Insect":
    """Return the environment, for example for `dm_control.viewer.launch`.

    Args:
        velocity: commanded V_r, 0 < V < 1, as a fraction of V_p.
        seed: seed of the starts; successive episodes begin at successive starts of `draw_starts` with this seed.
        task: actions, controller, conditions, stride, duration, see `task.Task`. With actions='joints', an action has
            the targets of all joints, (leg * joint,) [rad], within the joints' ranges. With actions='tips', it has the
            offsets to the planned tips forward, left and up, (leg * axis,) [mm].

    Raises:
        InputError: an argument is out of its range.
    """
    return Insect(Task(velocity, **task), whole("seed", seed, 0))


class Insect(control.Environment):
    """The environment of one insect; dm_control's tools and wrappers find its `physics` and its random generator."""

    def __init__(self, settings: Task, seed: int) -> None:
        """Compile the body of a task; starts are drawn from a generator with the seed."""
        conditions, stride = settings.conditions, settings.stride
        compiled = compile_body(conditions, conditions.timestep(stride))
        physics = mujoco.Physics.from_model(wrapper.MjModel(compiled.model))
        super().__init__(physics, self, n_sub_steps=settings.substeps)  # wrappers read `task.random` and `task._random`
        self.random = self._random = np.random.default_rng(seed)
        self.settings, self.compiled = settings, compiled
        self._walkers = Walkers(settings, compiled, Alone(compiled, physics.data.ptr), normalised=False)

    def reset(self) -> dm_env.TimeStep:
        """Begin an episode at the next start.

        Raises:
            SimulationError: the insect does not come to rest at the start.
        """
        self._walkers.begin(np.arange(1), draw_start(self._random, self.settings))
        return dm_env.restart(self._walkers.observations(0))

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Take one step of the plan, which is several substeps of the physics; after an episode, begin the next.

        Raises:
            InputError: the action is NaN.
            SimulationError: the simulation diverged.
        """
        if self._walkers.over:
            return self.reset()
        reward, fell, over = (values.item() for values in self._walkers.act(action))
        seen = self._walkers.observations(0)
        if fell:
            return dm_env.termination(reward, seen)
        return dm_env.truncation(reward, seen) if over else dm_env.transition(reward, seen)

    def action_spec(self) -> specs.BoundedArray:
        """Return the bounds of an action."""
        low, _, high = action_bounds(self.compiled, self.settings)
        return specs.BoundedArray(low.shape, float, low, high, self.settings.actions)

    def observation_spec(self) -> dict[str, specs.Array]:
        """Return the shape of every observation, by name."""
        shapes = observation_shapes(self.compiled, self.settings)
        return {name: specs.Array(shape, float, name) for name, shape in shapes.items()}
