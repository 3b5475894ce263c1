"""Many insects as a vector environment of stable-baselines3, whose interface differs from Gymnasium's.

An agent observes the sensed numbers of `learned.felt_in` in single precision, so that `learned.WithOffsets` can make a
controller of its policy. The wrapper `HeldInsects` holds each action for many steps.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hexmj.errors import InputError, without_extra

try:
    from gymnasium import spaces
    from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
except ImportError:
    raise without_extra("rl", "stable-baselines3") from None

from hexmj.environments.learned import FELT, MOST, felt_in
from hexmj.environments.task import checked_actions
from hexmj.environments.vector import StickInsects
from hexmj.validate import whole

Moves = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function of actions, (n, number), and sensed numbers, (n, `FELT`), that returns tip offsets, (n, leg * axis)."""

Reward = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Function of the environment's reward, (n,), the sensed numbers after a step, (n, `FELT`), and the falls, (n,), that
returns the reward for learning, (n,)."""


class FeltInsects(VecEnv):
    """Insects whose actions are tip offsets; an insect's next episode begins in the step that ends its episode."""

    def __init__(self, num_envs: int, **task: Any) -> None:
        """Make `num_envs` insects; `task` has further arguments of `vector.StickInsects`, such as velocity."""
        self._insects = StickInsects(num_envs, actions="tips", autoreset_mode="SameStep", **task)
        felt = spaces.Box(-MOST, MOST, (FELT,), np.float32)
        super().__init__(num_envs, felt, self._insects.single_action_space)  # pyright: ignore[reportArgumentType]
        self._actions: Any = None

    def reset(self) -> np.ndarray:
        """Begin an episode of every insect, with the seeds set by the method `seed`, if any."""
        observed = self._insects.reset(seed=self._seeds)[0]
        self._reset_seeds()
        self._reset_options()
        return self._seen(observed)

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take one step of all insects with the stored actions.

        Raises:
            InputError: an action is out of bounds.
            SimulationError: the simulation of an insect diverged.
        """
        observed, reward, fell, over, last = self._insects.step(self._actions)
        done, infos = fell | over, [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            final = {name: values[np.newaxis] for name, values in last["final_obs"][i].items()}
            infos[i] = {"terminal_observation": self._seen(final)[0], "TimeLimit.truncated": bool(over[i])}
        return self._seen(observed), reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return an image of every insect, (height, width, 3), or None for each without a `render_mode`."""
        return self._insects.render() or [None] * self.num_envs

    def close(self) -> None:
        """Free the renderer."""
        self._insects.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the environment, once for each index; a space is that of a single insect."""
        owner = self if attr_name in ("action_space", "observation_space") else self._insects
        return [getattr(owner, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raise InputError: attributes cannot be changed."""
        raise InputError(f"{attr_name} cannot be set; make a new environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the whole environment; raise InputError if `indices` leave out insects."""
        if len(set(self._get_indices(indices))) < self.num_envs:
            raise InputError(f"indices = {indices!r:.80}; expected all insects, because they are one environment")
        return [getattr(self._insects, method_name)(*args, **kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return False for each index, because no wrapper holds a single insect."""
        return [False] * len(list(self._get_indices(indices)))

    def _seen(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        return felt_in(observations, self._insects.task.conditions.body).astype(np.float32)


class HeldInsects(VecEnvWrapper):
    """Wrapper in which an action is a few parameters of reflexes, held for many steps; reflexes act at each step.

    The observation is constant, because the agent learns only the parameters. The reward is the mean reward of the
    steps. An insect whose episode ends begins a new episode, and earns no rewards until the next action.
    """

    def __init__(self, insects: FeltInsects, numbers: int, steps: int, moves: Moves, reward: Reward) -> None:
        """Wrap insects.

        Args:
            insects: the environment to wrap.
            numbers: number of an action's parameters, each from -1 to 1.
            steps: number of steps for which an action is held.
            moves: the reflexes, a function of actions and sensed numbers.
            reward: function that computes the reward of each step.

        Raises:
            InputError: `numbers` or `steps` is less than 1.
        """
        self._shape = (whole("numbers", numbers, 1),)
        nothing = spaces.Box(0.0, 1.0, (1,), np.float32)
        super().__init__(insects, nothing, spaces.Box(-1.0, 1.0, self._shape, np.float32))
        self._steps = whole("steps", steps, 1)
        self._insects, self._moves, self._reward = insects, moves, reward
        self._constant = np.ones((self.num_envs, 1), np.float32)

    def reset(self) -> np.ndarray:
        """Begin an episode of every insect."""
        self._felt = self._insects.reset()
        return self._constant

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`.

        Raises:
            InputError: the shape of the actions is wrong, or a number is out of its bounds.
        """
        self._actions = checked_actions(actions, (self.num_envs, *self._shape))

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take all steps of the stored actions.

        Raises:
            SimulationError: the simulation of an insect diverged.
        """
        reward, done = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for _ in range(self._steps):
            self._insects.step_async(self._moves(self._actions, self._felt))
            self._felt, gained, ends, step_infos = self._insects.step_wait()
            fell = ends & ~np.array([info.get("TimeLimit.truncated", False) for info in step_infos])
            last = self._felt.copy()
            for i in np.flatnonzero(ends).tolist():
                last[i] = step_infos[i]["terminal_observation"]
            reward += ~done * self._reward(gained, last, fell)
            for i in np.flatnonzero(ends & ~done).tolist():
                infos[i] = step_infos[i] | {"terminal_observation": self._constant[i]}
            done |= ends
        return self._constant, (reward / self._steps).astype(np.float32), done, infos
