"""Many insects as a vector environment of stable-baselines3, whose interface differs from Gymnasium's.

An agent observes the sensed numbers of `learned.felt_in` in single precision, so that `learned.WithOffsets` can make a
controller of its policy.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexmj.errors import without_extra

try:
    from gymnasium import spaces
    from stable_baselines3.common.vec_env import VecEnv
except ImportError:
    raise without_extra("rl", "stable-baselines3") from None

from hexmj.environments.gym import StickInsects
from hexmj.environments.learned import FELT, MOST, felt_in


class FeltInsects(VecEnv):
    """Insects whose actions are tip offsets; an insect's next episode begins in the step that ends its episode."""

    def __init__(self, num_envs: int, **task: Any) -> None:
        """Make `num_envs` insects; `task` has further arguments of `gym.StickInsects`, such as velocity."""
        self.insects = StickInsects(num_envs, actions="tips", autoreset_mode="SameStep", **task)
        felt = spaces.Box(-MOST, MOST, (FELT,), np.float32)
        super().__init__(num_envs, felt, self.insects.single_action_space)  # pyright: ignore[reportArgumentType]

    def reset(self) -> np.ndarray:
        """Begin an episode of every insect, with the seeds set by the method `seed`, if any."""
        observed = self.insects.reset(seed=self._seeds)[0]
        self._reset_seeds()
        return self._seen(observed)

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take one step of all insects with the stored actions.

        Raises:
            InputError: an action is NaN.
            SimulationError: the simulation of an insect diverged.
        """
        observed, reward, fell, over, last = self.insects.step(self._actions)
        done, infos = fell | over, [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            final = {name: values[np.newaxis] for name, values in last["final_obs"][i].items()}
            infos[i] = {"terminal_observation": self._seen(final)[0], "TimeLimit.truncated": bool(over[i])}
        return self._seen(observed), reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return an image of every insect, (height, width, 3), or None for each without a `render_mode`."""
        return self.insects.render() or [None] * self.num_envs

    def close(self) -> None:
        """Free the renderer."""
        self.insects.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the Gymnasium environment `insects`, once for each index."""
        return [getattr(self.insects, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the Gymnasium environment, which all insects share."""
        setattr(self.insects, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the Gymnasium environment once, for all insects."""
        return [getattr(self.insects, method_name)(*args, **kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return False for each index, because no wrapper holds a single insect."""
        return [False for _ in self._get_indices(indices)]

    def _seen(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        return felt_in(observations, self.insects.task.conditions.body).astype(np.float32)
