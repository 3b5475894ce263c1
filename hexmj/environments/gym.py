"""One insect as a Gymnasium environment: `hexmj/StickInsect-v0` and `hexmj/StickInsectTips-v0`.

What an episode is stands in `task`.  Actions are normalised: 0 is the usual one, posture home or no offset, -1 and 1
are the ends of the joints' ranges or the largest offsets.
"""

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
from hexmj.checks import typed
from hexmj.environments.frames import Frames
from hexmj.environments.single_body import Alone
from hexmj.environments.task import Task, action_names, checked_actions, drawn, observation_bounds, task_of
from hexmj.environments.walkers import Walkers

RENDER_MODES = [None, "rgb_array"]
"""How it can be drawn."""


class StickInsect(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """One insect that walks in an episode of its own."""

    metadata = {"render_modes": RENDER_MODES[1:], "render_fps": 800}  # noqa: RUF012  # Gymnasium reads it of the class

    def __init__(self, *, render_mode: str | None = None, **task: Any) -> None:
        """Its settings are those of `task.Task`.

        Args:
            render_mode: 'rgb_array' for `render`.
            task: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: a value that makes no sense.
        """
        self.task = task_of(task)
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
        """Begin an episode.  With a seed it takes the first of `hexmj.draw_starts` by that seed, then its next ones."""
        checked_options(options)
        super().reset(seed=seed)
        self._walkers.begin(np.arange(1), drawn(self.np_random, self.task))
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """One step of the plan, with its substeps.

        Raises:
            InputError: an action out of bounds, or the episode is over.
            SimulationError: a simulation that diverged.
        """
        if self._walkers.over:
            raise InputError("a step after the episode's end; expected a reset")
        acted = self._walkers.act(checked_actions(action, self._shape)[np.newaxis])
        return self._observation(), float(acted.reward[0]), bool(acted.terminated[0]), bool(acted.truncated[0]), {}

    def render(self) -> np.ndarray | None:
        """A frame, (height, width, 3), if it was asked for by `render_mode`."""
        return self._frames.draw(self.data.qpos) if self._frames else None

    def close(self) -> None:
        """Free the GL, if one was chosen."""
        if self._frames:
            self._frames.close()

    def __reduce__(self) -> Any:
        """Refuse copies and pickles, which would not share the memory that MuJoCo steps."""
        raise InputError("an environment can be neither copied nor pickled; expected another gymnasium.make")

    def _observation(self) -> dict[str, np.ndarray]:
        return self._walkers.observer.named(self._walkers.observations()[0])


def compiled_for(task: Task) -> CompiledBody:
    """The body of a task, without what is only to look at."""
    return compile_body(task.conditions, task.conditions.timestep(task.stride), looks=False)


def spaces_of(compiled: CompiledBody, task: Task) -> tuple[Any, spaces.Box]:
    """Of one insect's observations and actions."""
    bounds = observation_bounds(compiled, task)
    observed: dict[str, Any] = {name: spaces.Box(low, high, dtype=np.float64) for name, (low, high) in bounds.items()}
    return spaces.Dict(observed), spaces.Box(-1.0, 1.0, (len(action_names(compiled, task)),), np.float32)


def metadata_of(task: Task) -> dict[str, Any]:
    """What Gymnasium wants to know; frames are drawn in real time if one is drawn after each step."""
    fps = max(1, round(1.0 / task.conditions.seconds(task.stride)))
    return {"render_modes": RENDER_MODES[1:], "render_fps": fps}


def checked_mode(render_mode: str | None) -> str | None:
    """A way to be drawn.

    Raises:
        InputError: no such way.
    """
    if render_mode not in RENDER_MODES:
        raise InputError(f"render_mode = {render_mode!r:.80}; valid names: rgb_array, or None")
    return render_mode


def checked_options(options: Any, *valid: str) -> dict[str, Any]:
    """The options of a reset, {} for none.

    Raises:
        InputError: no such option.
    """
    options = typed("options", options, dict | None) or {}
    for name in options:
        if name not in valid:
            raise InputError(f"option {name!r:.80}; valid names: {', '.join(valid) or 'none'}")
    return options
