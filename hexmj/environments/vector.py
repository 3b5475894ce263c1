"""Many insects as one Gymnasium vector environment, stepped in parallel by MuJoCo's batch.

The walk of an insect depends neither on the number of insects nor on threads. After a reset with the seed s, insect i
walks as the insect of `gym.StickInsect` after a reset with the seed s + i.
"""

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np

from hexmj.errors import InputError, without_extra

try:
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError:
    raise without_extra("gym", "gymnasium") from None

from hexmj.environments.gym import Insects
from hexmj.environments.task import checked_actions, draw_start
from hexmj.environments.walkers import Walkers
from hexmj.physics.engine import MujocoBatch
from hexmj.validate import choice, whole

Observations = dict[str, np.ndarray]


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
        self.num_envs = whole("num_envs", num_envs, 1)
        mode: Any = getattr(autoreset_mode, "value", autoreset_mode)
        self.autoreset_mode = AutoresetMode(choice("autoreset_mode", mode, [m.value for m in AutoresetMode]))
        self.metadata |= {"autoreset_mode": self.autoreset_mode}
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._bodies = MujocoBatch(self._compiled, self.num_envs, threads)
        self._walkers = Walkers(self.task, self._compiled, self._bodies, self.num_envs, threads)
        self._np_random: Any = [None] * self.num_envs  # random generator of each insect
        self._np_random_seed: Any = [None] * self.num_envs
        self._ended = np.zeros(self.num_envs, dtype=bool)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]  # Gymnasium's own vector environments do so too
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes of all insects, or of the insects for which `options["reset_mask"]` is True.

        Args:
            seed: a number s gives insect i the seed s + i; a list has one seed per insect; None draws the next starts.
            options: may contain 'reset_mask', booleans of shape (insect,).

        Raises:
            InputError: seeds or mask have a wrong length, or the mask leaves out insects that must be reset.
            SimulationError: an insect does not come to rest at its start; all insects must be reset then.
        """
        which = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if which.shape != (self.num_envs,) or which.dtype != bool or not which.any():
            raise InputError(f"reset_mask = {which!r:.80}; expected {self.num_envs} booleans, at least one True")
        if not (self._walkers.begun or which.all()):
            raise InputError("reset_mask leaves out insects; the first reset, and one after an error, must include all")
        seeds: Any = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, Integral):
            seeds = [seeds + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise InputError(f"seed has {len(seeds)} values; expected {self.num_envs}, one per insect")
        seeds = [None if one is None else whole("seed", one, 0) for one in seeds]
        for i in np.flatnonzero(which).tolist():
            if seeds[i] is not None or self._np_random[i] is None:
                self._np_random[i], self._np_random_seed[i] = seeding.np_random(seeds[i])
        self._begin(which)
        return self._observations(), {}

    def step(self, actions: np.ndarray) -> tuple[Observations, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take one step of all insects; `autoreset_mode` decides when an insect begins its next episode.

        In the mode 'SameStep', `infos["final_obs"]` has the last observations of the episodes that this step ended. In
        the mode 'Disabled', an insect whose episode has ended keeps its state, with reward 0, until it is reset.

        Raises:
            InputError: an action is out of bounds.
            SimulationError: a simulation diverged, or a start did not settle; all insects must be reset then.
        """
        actions = checked_actions(actions, self.action_space.shape)
        acted, before = self._walkers.act(actions), self._ended
        ended, infos = acted.terminated | acted.truncated, {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and ended.any():
            infos = self._final(ended)
            self._begin(ended)
        elif self.autoreset_mode is AutoresetMode.NEXT_STEP:
            self._ended = ended
            if before.any():
                self._begin(before)
        return self._observations(), acted.reward, acted.terminated, acted.truncated, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return an image of every insect, (height, width, 3) of uint8, or None without a `render_mode`."""
        return tuple(self._frames.draw(qpos) for qpos in self._bodies.qpos) if self._frames else None

    def _begin(self, which: np.ndarray) -> None:
        ids = np.flatnonzero(which)
        self._walkers.begin(ids, np.concatenate([draw_start(self._np_random[i], self.task) for i in ids.tolist()]))
        self._ended = self._ended & ~which

    def _observations(self) -> Observations:
        return self._walkers.observer.named(self._walkers.observations())

    def _final(self, ended: np.ndarray) -> dict[str, Any]:
        """Return the last observations of the insects whose episodes ended, in the layout of Gymnasium's `infos`."""
        last, observations = self._walkers.observations(), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = self._walkers.observer.named(last[i])
        return {"final_obs": observations, "_final_obs": ended, "final_info": {}, "_final_info": ended}
