"""Many insects for stable-baselines3, whose vector environments are not Gymnasium's: a thin face of `vector`.

It observes what the insects feel (`learned.felt_in`), in single precision as its networks do, so that what is learned
walks as a controller by `learned.WithOffsets`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexmj.errors import without_extra

try:
    from gymnasium import spaces
    from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]
except ImportError:
    raise without_extra("rl", "stable-baselines3") from None

from hexmj.environments.learned import FELT, felt_in
from hexmj.environments.vector import StickInsects

MOST = 10.0
"""Greatest number that is felt, in usual sizes."""


class FeltInsects(VecEnv):
    """Insects whose actions are offsets to the tips; episodes begin anew in the step in which they end."""

    def __init__(self, num_envs: int, **task: Any) -> None:
        """Its settings are those of `vector.StickInsects`, but for the actions and when episodes begin."""
        self._insects = StickInsects(num_envs, actions="tips", autoreset_mode="SameStep", **task)
        felt = spaces.Box(-MOST, MOST, (FELT,), np.float32)
        super().__init__(num_envs, felt, self._insects.single_action_space)  # pyright: ignore[reportArgumentType]

    def reset(self) -> np.ndarray:
        """Begin all episodes, by the seeds of `seed` if there are some."""
        seeds, self._seeds = self._seeds, [None] * self.num_envs
        return _seen(self._insects.reset(seed=seeds)[0])

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions that `step_wait` will carry out."""
        self._actions = np.asarray(actions, dtype=float)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One step of all insects."""
        observed, reward, fell, over, last = self._insects.step(self._actions)
        done, infos = fell | over, [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            final = {name: values[np.newaxis] for name, values in last["final_obs"][i].items()}
            infos[i] = {"terminal_observation": _seen(final)[0], "TimeLimit.truncated": bool(over[i])}
        return _seen(observed), reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Nothing is kept open."""
        self._insects.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute that all insects share."""
        return [getattr(self._insects, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute, of all insects."""
        setattr(self._insects, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method, for all insects at once."""
        return [getattr(self._insects, method_name)(*args, **kwargs)] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No insect is wrapped by itself."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: int | Sequence[int] | None) -> list[int]:
        return list(self._get_indices(indices))


def _seen(observations: dict[str, np.ndarray]) -> np.ndarray:
    return np.clip(felt_in(observations), -MOST, MOST).astype(np.float32)
