"""Many insects for stable-baselines3, whose vector environments are not Gymnasium's: a thin face of `vector`.

It observes what the insects feel (`learned.felt_in`), in single precision as its networks do, so that what is learned
walks as a controller by `learned.WithOffsets`.  `HeldInsects` are the same for actions that last.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hexmj.errors import InputError, without_extra

try:
    from gymnasium import spaces
    from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper  # pyright: ignore[reportMissingImports]
except ImportError:
    raise without_extra("rl", "stable-baselines3") from None

from hexmj import checks
from hexmj.environments.compiled_passes import ROUNDING
from hexmj.environments.learned import FELT, MOST, felt_in
from hexmj.environments.task import checked_actions
from hexmj.environments.vector import StickInsects

MANY = 10**6
"""Most numbers of an action, and most steps of one."""

Moves = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Offsets of the tips, (n, leg * axis), of actions, (n, number), and what is felt, (n, `FELT`)."""

Reward = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Of the environment's reward, what is felt as a step ends and who fell in it, each (n, ...): the reward to learn by,
(n,)."""


class FeltInsects(VecEnv):
    """Insects whose actions are offsets to the tips; episodes begin anew in the step in which they end."""

    def __init__(self, num_envs: int, **task: Any) -> None:
        """Its settings are those of `vector.StickInsects`, but for the actions and when episodes begin.

        Raises:
            InputError: a value that makes no sense.
        """
        if settled := sorted({"actions", "autoreset_mode"} & task.keys()):
            raise InputError(f"{settled[0]} = {task[settled[0]]!r:.80}; expected none: it is settled here")
        self._insects = StickInsects(num_envs, actions="tips", autoreset_mode="SameStep", **task)
        felt = spaces.Box(-MOST, MOST, (FELT,), np.float32)
        super().__init__(num_envs, felt, self._insects.single_action_space)  # pyright: ignore[reportArgumentType]
        self._actions: Any = None

    def reset(self) -> np.ndarray:
        """Begin all episodes, by the seeds of `seed` if there are some.

        Raises:
            InputError: options have been set.
        """
        options = self._options
        self._reset_options()
        if any(options):
            raise InputError(f"options = {options!r:.80}; expected none")
        observed = self._insects.reset(seed=self._seeds)[0]
        self._reset_seeds()
        return self._seen(observed)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions that `step_wait` will carry out."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One step of all insects, with the actions that were taken for it.

        Raises:
            InputError: none were, or some are out of bounds.
            SimulationError: an insect that diverged.
        """
        actions, self._actions = self._actions, None
        observed, reward, fell, over, last = self._insects.step(actions)
        done, infos = fell | over, [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            final = {name: values[np.newaxis] for name, values in last["final_obs"][i].items()}
            infos[i] = {"terminal_observation": self._seen(final)[0], "TimeLimit.truncated": bool(over[i])}
        return self._seen(observed), reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A frame of every insect, (height, width, 3), if they were asked for by `render_mode`."""
        return self._insects.render() or [None] * self.num_envs

    def close(self) -> None:
        """Free the GL, if one was chosen."""
        self._insects.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute that all insects share; spaces are those of one of them."""
        of = self if attr_name in ("action_space", "observation_space") else self._insects
        return [getattr(of, attr_name)] * len(self._some(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: all that an insect is made with is settled.

        Raises:
            InputError: always.
        """
        raise InputError(f"{attr_name} = {value!r:.80} cannot be set; expected new insects that are made with it")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method, for all insects at once.

        Raises:
            InputError: for some of them.
        """
        return [getattr(self._insects, method_name)(*args, **kwargs)] * self._all(indices)

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No insect is wrapped by itself."""
        return [False] * len(self._some(indices))

    def _seen(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        return felt_in(observations, self._insects.task.conditions.body).astype(np.float32)

    def _some(self, indices: Any) -> list[int]:
        n = self.num_envs
        some = [indices] if np.isscalar(indices) else self._get_indices(indices)
        return [checks.whole("index", one, -n, n - 1) % n for one in some]

    def _all(self, indices: Any) -> int:
        if {*self._some(indices)} != {*range(self.num_envs)}:
            raise InputError(
                f"indices = {indices!r:.80}; expected all {self.num_envs} insects, which are one environment"
            )
        return self.num_envs


class HeldInsects(VecEnvWrapper):
    """Insects whose actions are few numbers for reflexes, held for many steps while the reflexes go on at each.

    Nothing is observed but a constant: what is learned are the numbers themselves.  The reward is the mean of the
    steps'; an insect whose episode ends goes on with a fresh one, unrewarded until the next action.
    """

    def __init__(self, insects: FeltInsects, numbers: int, steps: int, moves: Moves, reward: Reward) -> None:
        """Actions of so many numbers, -1 to 1, each held for so many steps.

        Raises:
            InputError: no numbers or steps, no insects of stable-baselines3's kind, or what is no function.
        """
        checks.typed("insects", insects, VecEnv)
        for name, function in {"moves": moves, "reward": reward}.items():
            checks.typed(name, function, Callable)
        self._shape = (checks.whole("numbers", numbers, 1, MANY),)
        nothing = spaces.Box(0.0, 1.0, (1,), np.float32)
        super().__init__(insects, nothing, spaces.Box(-1.0, 1.0, self._shape, np.float32))
        self._steps = checks.whole("steps", steps, 1, MANY)
        self._insects, self._moves, self._reward = insects, moves, reward
        self._actions = self._felt = None
        self._constant = np.ones((self.num_envs, 1), np.float32)

    def reset(self) -> np.ndarray:
        """Begin all episodes."""
        self._felt = self._insects.reset()
        return self._constant

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions that `step_wait` will carry out.

        Raises:
            InputError: something else, or numbers beyond -1 to 1.
        """
        actions = checked_actions(actions, (self.num_envs, *self._shape))
        if not (within := np.abs(actions) <= 1.0 + ROUNDING).all():
            raise InputError(f"an action has {actions[~within][0]}; expected -1 to 1")
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """All steps of one action.

        Raises:
            InputError: there is none, no episode has begun, or rewards that are no finite numbers.
            SimulationError: an insect that diverged.
        """
        actions, self._actions = self._actions, None
        if self._felt is None or actions is None:
            raise InputError("a step before the first reset, or without an action; expected a reset, then an action")
        reward, done = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for _ in range(self._steps):
            self._insects.step_async(self._moves(actions, self._felt))
            self._felt, gained, ends, told = self._insects.step_wait()
            fell = ends & ~np.array([info.get("TimeLimit.truncated", False) for info in told])
            last = self._felt.copy()
            for i in np.flatnonzero(ends).tolist():
                last[i] = told[i]["terminal_observation"]
            reward += ~done * self._rewarded(gained, last, fell)
            for i in np.flatnonzero(ends & ~done).tolist():
                infos[i] = told[i] | {"terminal_observation": self._constant[i]}
            done |= ends
        return self._constant, (reward / self._steps).astype(np.float32), done, infos

    def _rewarded(self, gained: np.ndarray, last: np.ndarray, fell: np.ndarray) -> np.ndarray:
        reward = checks.numbers("reward", self._reward(gained, last, fell))
        if reward.shape != (self.num_envs,) or not np.isfinite(reward).all():
            raise InputError(f"reward = {checks.short(reward)}; expected {self.num_envs} finite numbers")
        return reward
