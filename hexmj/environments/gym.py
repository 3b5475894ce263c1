"""The insect for Gymnasium: one (`hexmj/StickInsect-v0`, `hexmj/StickInsectTips-v0`), or many in a vector environment.

`task` describes episodes, observations and rewards. Actions are normalised to -1 ... 1. Joint targets: 0 is the home
posture, -1 and 1 are the ends of the joints' ranges. Tip offsets: 0 is no offset, -1 and 1 are the largest offsets.

MuJoCo's batch steps many insects in parallel. The walk of an insect depends neither on the number of insects nor on
threads. After a reset with the seed s, insect i walks as the single insect after a reset with the seed s + i.
"""

import atexit
from collections.abc import Sequence
from numbers import Integral
from typing import Any

import mujoco
import numpy as np

from hexmj.errors import InputError, without_extra

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError:
    raise without_extra("gym", "gymnasium") from None

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import compile_body
from hexmj.environments.task import Task, action_bounds, draw_start, observation_shapes
from hexmj.environments.walkers import Alone, Walkers
from hexmj.physics.engine import MujocoBatch
from hexmj.rendering import gl
from hexmj.validate import choice

SIZE = 480, 640
"""Height and width of a frame [pixels]."""

Observations = dict[str, np.ndarray]


class Insects:
    """Base class of the environments of one insect and of many."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 800}  # noqa: RUF012  # Gymnasium reads the class attribute

    def prepare(self, render_mode: str | None, task: dict[str, Any]) -> tuple[Any, spaces.Box]:
        """Compile the body of a `task.Task`, and return the spaces of one insect's observations and actions.

        Raises:
            InputError: a field of the task is out of its range, or the render mode is unknown.
        """
        self.task, self.render_mode = Task(**task), render_mode and choice("render_mode", render_mode, ["rgb_array"])
        conditions, stride = self.task.conditions, self.task.stride
        self._compiled = compile_body(conditions, conditions.timestep(stride), looks=bool(render_mode))
        fps = max(1, round(1.0 / conditions.seconds(stride)))  # real time, with one frame after each step
        self.metadata = Insects.metadata | {"render_fps": fps}
        self._frames = Frames(self._compiled) if render_mode else None
        shapes = observation_shapes(self._compiled, self.task).items()
        observed: Any = {name: spaces.Box(-np.inf, np.inf, shape, np.float64) for name, shape in shapes}
        numbers = len(action_bounds(self._compiled, self.task)[0])
        return spaces.Dict(observed), spaces.Box(-1.0, 1.0, (numbers,), np.float32)

    def close(self, **kwargs: Any) -> None:
        """Free the renderer; keyword arguments have no effect."""
        if self._frames:
            self._frames.renderer.close()

    def __reduce__(self) -> Any:
        """Raise InputError: a copy or pickle would not refer to the memory in which MuJoCo steps the insect."""
        raise InputError("an environment cannot be copied or pickled; make a new one")


class StickInsect(Insects, gymnasium.Env[Observations, np.ndarray]):
    """Gymnasium environment of one insect."""

    def __init__(self, *, render_mode: str | None = None, **task: Any) -> None:
        """Make the environment of a `task.Task`.

        Args:
            render_mode: 'rgb_array' if `render` should return frames, else None.
            task: fields of `task.Task`: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: an argument is out of its range.
        """
        self.observation_space, self.action_space = self.prepare(render_mode, task)
        self.model = self._compiled.model
        self.data = mujoco.MjData(self.model)
        self._walkers = Walkers(self.task, self._compiled, Alone(self._compiled, self.data))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode: after a seed at the first of `hexmj.draw_starts` with this seed, else at the next start.

        Args:
            seed: seed of the starts; None draws the next start.
            options: has no effect.

        Raises:
            SimulationError: the insect does not come to rest at the start.
        """
        super().reset(seed=seed)
        self._walkers.begin(np.arange(1), draw_start(self.np_random, self.task))
        return self._walkers.observations(0), {}

    def step(self, action: np.ndarray) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Take one step of the plan, which is several substeps of the physics.

        Raises:
            InputError: the action is NaN, or no episode is running.
            SimulationError: the simulation diverged.
        """
        if self._walkers.over:
            raise InputError("no episode is running; call reset() first")
        reward, fell, over = (values.item() for values in self._walkers.act(action))
        return self._walkers.observations(0), reward, fell, over, {}

    def render(self) -> np.ndarray | None:
        """Return an image of the insect, (height, width, 3) of uint8, or None without a `render_mode`."""
        return self._frames.draw(self.data.qpos) if self._frames else None


class StickInsects(Insects, VectorEnv[Observations, np.ndarray, np.ndarray]):
    """Gymnasium vector environment of insects; each walks in its own episode."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        """Make the environment of a `task.Task`.

        Args:
            num_envs: number of insects.
            autoreset_mode: when an insect begins its next episode: 'NextStep', 'SameStep' or 'Disabled' (at `reset`).
            threads: number of threads that step the insects; by default one per core.
            render_mode: 'rgb_array' if `render` should return frames, else None.
            task: fields of `task.Task`: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: an argument is out of its range.
        """
        self.single_observation_space, self.single_action_space = self.prepare(render_mode, task)
        self.num_envs, self.autoreset_mode = num_envs, AutoresetMode(autoreset_mode)
        self.metadata |= {"autoreset_mode": self.autoreset_mode}
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        bodies = MujocoBatch(self._compiled, num_envs, threads)
        self._walkers = Walkers(self.task, self._compiled, bodies, num_envs, threads)
        self._np_random: Any = [None] * num_envs  # random generator of each insect
        self._np_random_seed: Any = [None] * num_envs
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]  # Gymnasium's own vector environments do so too
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes of all insects, or of the insects for which `options["reset_mask"]` is True.

        Args:
            seed: a number s gives insect i the seed s + i; a list has one seed per insect; None draws the next starts.
            options: may contain 'reset_mask', booleans of shape (insect,).

        Raises:
            InputError: the mask leaves out insects that must be reset.
            SimulationError: an insect does not come to rest at its start; all insects must be reset then.
        """
        which = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if not (self._walkers.begun or which.all()):
            raise InputError("reset_mask leaves out insects; the first reset, and one after an error, must include all")
        seeds: Any = [seed] * self.num_envs if seed is None else seed
        if isinstance(seeds, Integral):
            seeds = [int(seeds) + i for i in range(self.num_envs)]
        for i in np.flatnonzero(which).tolist():
            if seeds[i] is not None or self._np_random[i] is None:
                self._np_random[i], self._np_random_seed[i] = seeding.np_random(seeds[i])
        self._begin(which)
        return self._walkers.observations(), {}

    def step(self, actions: np.ndarray) -> tuple[Observations, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take one step of all insects; `autoreset_mode` decides when an insect begins its next episode.

        In the mode 'SameStep', `infos["final_obs"]` has the last observations of the episodes that this step ended. In
        the mode 'Disabled', an insect whose episode has ended keeps its state, with reward 0, until it is reset.

        Raises:
            InputError: an action is NaN.
            SimulationError: a simulation diverged, or a start did not settle; all insects must be reset then.
        """
        reward, fell, over = self._walkers.act(actions)
        ended, before, infos = fell | over, self._ended, {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and ended.any():
            infos = self._final(ended)
            self._begin(ended)
        elif self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._ended = ended
            if before.any():
                self._begin(before)
        return self._walkers.observations(), reward, fell, over, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return an image of every insect, (height, width, 3) of uint8, or None without a `render_mode`."""
        return tuple(self._frames.draw(qpos) for qpos in self._walkers.bodies.qpos) if self._frames else None

    def _begin(self, which: np.ndarray) -> None:
        ids = np.flatnonzero(which)
        self._walkers.begin(ids, np.concatenate([draw_start(self._np_random[i], self.task) for i in ids.tolist()]))
        self._ended = self._ended & ~which

    def _final(self, ended: np.ndarray) -> dict[str, Any]:
        """Return the last observations of the insects whose episodes ended, in the layout of Gymnasium's `infos`."""
        last, observations = self._walkers.observations(), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = {name: values[i] for name, values in last.items()}
        return {"final_obs": observations, "_final_obs": ended, "final_info": {}, "_final_info": ended}


class Frames:
    """Draws a body from the first camera of its description; the stick insect's first camera follows the insect."""

    def __init__(self, compiled: CompiledBody) -> None:
        """Create the renderer."""
        self._model, self._cameras = compiled.model, compiled.body.cameras[:1]
        self._model.vis.global_.offheight, self._model.vis.global_.offwidth = SIZE
        self._data, self.renderer = mujoco.MjData(self._model), gl.Renderer(self._model, *SIZE)
        atexit.register(self.renderer.close)  # before OpenGL ends

    def draw(self, qpos: np.ndarray) -> np.ndarray:
        """Return an image, (height, width, 3) of uint8, of the body at the positions `qpos`, (position,)."""
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self.renderer.update_scene(self._data, *self._cameras)
        return self.renderer.render()
