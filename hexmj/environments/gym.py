"""One insect as a Gymnasium environment: `hexmj/StickInsect-v0` and `hexmj/StickInsectTips-v0`.

`task` describes episodes, observations and rewards. Actions are normalised: 0 is the usual action, home posture or no
offset; -1 and 1 are the ends of the joints' ranges or the largest offsets.
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

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.environments.task import Task, action_names, checked_actions, draw_start, observation_bounds
from hexmj.environments.walkers import Alone, Walkers
from hexmj.rendering import gl

RENDER_MODES = [None, "rgb_array"]
"""Valid render modes."""

SIZE = 480, 640
"""Height and width of a frame [pixels]."""


class StickInsect(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """One insect that walks in an episode of its own."""

    metadata = {"render_modes": RENDER_MODES[1:], "render_fps": 800}  # noqa: RUF012  # Gymnasium reads the class

    def __init__(self, *, render_mode: str | None = None, **task: Any) -> None:
        """Make the environment of a `task.Task`.

        Args:
            render_mode: 'rgb_array' for `render`.
            task: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: a value is out of its range.
        """
        self.task = Task(**task)
        compiled, self.render_mode = compiled_for(self.task), checked_mode(render_mode)
        self.metadata = metadata_of(self.task)
        self.observation_space, self.action_space = spaces_of(compiled, self.task)
        self._shape = (len(action_names(compiled, self.task)),)
        self._body = Alone(compiled, compiled.model, mujoco.MjData(compiled.model))
        self.model, self.data = self._body.model, self._body.data
        self._walkers = Walkers(self.task, compiled, self._body, self._body.take, count=1, threads=1)
        self._frames = Frames(self.task.conditions) if render_mode else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode. With a seed, it takes the first of `hexmj.draw_starts` with that seed, then the next ones.

        Args:
            seed: seed of the starts.
            options: no effect.

        Raises:
            SimulationError: the start does not settle.
        """
        super().reset(seed=seed)
        self._walkers.begin(np.arange(1), draw_start(self.np_random, self.task))
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Take one step of the plan, with its substeps.

        Raises:
            InputError: the action is out of bounds, or the episode has ended.
            SimulationError: the simulation diverged.
        """
        if self._walkers.over:
            raise InputError("the episode has ended; reset it first")
        acted = self._walkers.act(checked_actions(action, self._shape)[np.newaxis])
        return self._observation(), float(acted.reward[0]), bool(acted.terminated[0]), bool(acted.truncated[0]), {}

    def render(self) -> np.ndarray | None:
        """Return a frame, (height, width, 3), with `render_mode`."""
        return self._frames.draw(self.data.qpos) if self._frames else None

    def close(self) -> None:
        """Free the renderer."""
        if self._frames:
            self._frames.close()

    def __reduce__(self) -> Any:
        """Refuse copies, which would not share the memory that MuJoCo steps."""
        raise InputError("an environment cannot be copied or pickled; make another one")

    def _observation(self) -> dict[str, np.ndarray]:
        return self._walkers.observer.named(self._walkers.observations()[0])


class Frames:
    """Draws a body from the first camera of its description; the stick insect's follows it."""

    def __init__(self, conditions: Conditions) -> None:
        """Compile the body; the renderer begins with the first frame."""
        self._cameras, self._renderer = conditions.body.cameras[:1], None
        self._model = compile_body(conditions).model
        self._model.vis.global_.offheight, self._model.vis.global_.offwidth = SIZE

    def draw(self, qpos: np.ndarray) -> np.ndarray:
        """Draw the body at some `qpos`, (height, width, 3) of uint8."""
        if self._renderer is None:
            self._data, self._renderer = mujoco.MjData(self._model), gl.renderer(self._model, *SIZE)
            atexit.register(self.close)  # before OpenGL ends
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, *self._cameras)
        return self._renderer.render()

    def close(self) -> None:
        """Free the renderer; it may be called again."""
        if self._renderer:
            self._renderer.close()
            atexit.unregister(self.close)
        self._renderer = None


def compiled_for(task: Task) -> CompiledBody:
    """Return the body of a task, without visual parts."""
    return compile_body(task.conditions, task.conditions.timestep(task.stride), looks=False)


def spaces_of(compiled: CompiledBody, task: Task) -> tuple[Any, spaces.Box]:
    """Return the spaces of one insect's observations and actions."""
    bounds = observation_bounds(compiled, task)
    observed: dict[str, Any] = {name: spaces.Box(low, high, dtype=np.float64) for name, (low, high) in bounds.items()}
    return spaces.Dict(observed), spaces.Box(-1.0, 1.0, (len(action_names(compiled, task)),), np.float32)


def metadata_of(task: Task) -> dict[str, Any]:
    """Return Gymnasium's metadata; one frame after each step gives a film in real time."""
    fps = max(1, round(1.0 / task.conditions.seconds(task.stride)))
    return {"render_modes": RENDER_MODES[1:], "render_fps": fps}


def checked_mode(render_mode: str | None) -> str | None:
    """Return a valid render mode.

    Raises:
        InputError: the mode does not exist.
    """
    if render_mode not in RENDER_MODES:
        raise InputError(f"render_mode = {render_mode!r:.80}; valid names: rgb_array, or None")
    return render_mode
