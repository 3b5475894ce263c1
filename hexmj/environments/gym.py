"""One insect as a Gymnasium environment: `hexmj/StickInsect-v0` and `hexmj/StickInsectTips-v0`.

`task` describes episodes, observations and rewards. Actions are normalised to -1 ... 1. Joint targets: 0 is the home
posture, -1 and 1 are the ends of the joints' ranges. Tip offsets: 0 is no offset, -1 and 1 are the largest offsets.
"""

import atexit
from typing import Any

import mujoco
import numpy as np

from hexmj.errors import InputError, without_extra

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError:
    raise without_extra("gym", "gymnasium") from None

from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.environments.task import Task, action_names, checked_actions, draw_start, observation_bounds
from hexmj.environments.walkers import Alone, Walkers
from hexmj.rendering import gl

SIZE = 480, 640
"""Height and width of a frame [pixels]."""


class Insects:
    """Base class of the environments of one insect (`StickInsect`) and of many (`vector.StickInsects`)."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 800}  # noqa: RUF012  # Gymnasium reads the class attribute

    def prepare(self, render_mode: str | None, task: dict[str, Any]) -> tuple[Any, spaces.Box]:
        """Compile the body of a `task.Task`, and return the spaces of one insect's observations and actions.

        Raises:
            InputError: a field of the task is out of its range, or the render mode is unknown.
        """
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode = {render_mode!r:.80}; expected 'rgb_array' or None")
        self.task, self.render_mode = Task(**task), render_mode
        conditions, stride = self.task.conditions, self.task.stride
        self._compiled = compile_body(conditions, conditions.timestep(stride), looks=False)
        fps = max(1, round(1.0 / conditions.seconds(stride)))  # real time, with one frame after each step
        self.metadata = Insects.metadata | {"render_fps": fps}
        self._frames = Frames(conditions) if render_mode else None
        bounds = observation_bounds(self._compiled, self.task).items()
        observed: dict[str, Any] = {name: spaces.Box(low, high, dtype=np.float64) for name, (low, high) in bounds}
        numbers = len(action_names(self._compiled, self.task))
        return spaces.Dict(observed), spaces.Box(-1.0, 1.0, (numbers,), np.float32)

    def close(self, **kwargs: Any) -> None:
        """Free the renderer; keyword arguments have no effect."""
        if self._frames:
            self._frames.close()

    def __reduce__(self) -> Any:
        """Raise InputError: a copy or pickle would not refer to the memory in which MuJoCo steps the insect."""
        raise InputError("an environment cannot be copied or pickled; make a new one")


class StickInsect(Insects, gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
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
        body = Alone(self._compiled, self.model, self.data)
        self._walkers = Walkers(self.task, self._compiled, body, count=1, threads=1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode: after a seed at the first of `hexmj.draw_starts` with this seed, else at the next start.

        Args:
            seed: seed of the starts; None draws the next start.
            options: has no effect.

        Raises:
            SimulationError: the insect does not come to rest at the start.
        """
        super().reset(seed=seed)
        self._walkers.begin(np.arange(1), draw_start(self.np_random, self.task))
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Take one step of the plan, which is several substeps of the physics.

        Raises:
            InputError: the action is out of bounds, or the episode has ended.
            SimulationError: the simulation diverged.
        """
        if self._walkers.over:
            raise InputError("the episode has ended; call reset() first")
        acted = self._walkers.act(checked_actions(action, self.action_space.shape)[np.newaxis])
        return self._observation(), float(acted.reward[0]), bool(acted.terminated[0]), bool(acted.truncated[0]), {}

    def render(self) -> np.ndarray | None:
        """Return an image of the insect, (height, width, 3) of uint8, or None without a `render_mode`."""
        return self._frames.draw(self.data.qpos) if self._frames else None

    def _observation(self) -> dict[str, np.ndarray]:
        return self._walkers.observer.named(self._walkers.observations()[0])


class Frames:
    """Draws a body from the first camera of its description; the stick insect's first camera follows the insect."""

    def __init__(self, conditions: Conditions) -> None:
        """Compile the body; the first frame creates the renderer."""
        self._cameras, self._renderer = conditions.body.cameras[:1], None
        self._model = compile_body(conditions).model
        self._model.vis.global_.offheight, self._model.vis.global_.offwidth = SIZE

    def draw(self, qpos: np.ndarray) -> np.ndarray:
        """Return an image, (height, width, 3) of uint8, of the body at the positions `qpos`, (position,)."""
        if self._renderer is None:
            self._data, self._renderer = mujoco.MjData(self._model), gl.Renderer(self._model, *SIZE)
            atexit.register(self.close)  # frees the renderer before OpenGL ends
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, *self._cameras)
        return self._renderer.render()

    def close(self) -> None:
        """Free the renderer; further calls have no effect."""
        if self._renderer:
            self._renderer.close()
            atexit.unregister(self.close)
        self._renderer = None
