"""Many insects as one Gymnasium vector environment, on MuJoCo's batch.

The walk of an insect depends neither on the number of insects nor on threads: with the seed s, insect i walks as the
single environment with the seed s + i.
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
    """Insects, each in an episode of its own."""

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
            autoreset_mode: when the next episode of an insect begins: 'NextStep', 'SameStep' or 'Disabled'.
            threads: threads that step the insects, by default one per core.
            render_mode: 'rgb_array' for `render`.
            task: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: a value is out of its range.
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
        self._np_random: Any = [None] * self.num_envs  # a generator and a seed for each insect
        self._np_random_seed: Any = [None] * self.num_envs
        self._ended = np.zeros(self.num_envs, dtype=bool)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]  # as Gymnasium's own vector environments
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes of all insects, or of those in `options["reset_mask"]`, (insect,) of bool.

        Args:
            seed: s for the seed s + i of insect i, one seed for each insect, or None to draw the next starts.
            options: the mask.

        Raises:
            InputError: seeds or mask do not fit, or the mask leaves out insects that must be reset.
            SimulationError: a start does not settle; reset all insects then.
        """
        which = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if which.shape != (self.num_envs,) or which.dtype != bool or not which.any():
            raise InputError(f"reset_mask = {which!r:.80}; expected {self.num_envs} booleans, at least one True")
        if not (self._walkers.begun or which.all()):
            raise InputError("reset_mask leaves out insects, but none has begun or a step or a reset failed; reset all")
        seeds: Any = [None] * self.num_envs if seed is None else seed
        if isinstance(seeds, Integral):
            seeds = [seeds + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise InputError(f"seed has {len(seeds)} values; expected one for each of {self.num_envs} insects")
        seeds = [None if one is None else whole("seed", one, 0) for one in seeds]
        for i in np.flatnonzero(which).tolist():
            if seeds[i] is not None or self._np_random[i] is None:
                self._np_random[i], self._np_random_seed[i] = seeding.np_random(seeds[i])
        self._begin(which)
        return self._observations(), {}

    def step(self, actions: np.ndarray) -> tuple[Observations, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take one step of all insects; `autoreset_mode` decides when insects whose episode has ended begin again.

        In the mode 'SameStep', `final_obs` has the last observations of episodes that ended. In the mode 'Disabled',
        an insect keeps its state, without rewards, until it is reset.

        Raises:
            InputError: an action is out of bounds.
            SimulationError: the simulation diverged, or a start does not settle; reset all insects then.
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
        """Return a frame of every insect, (height, width, 3), with `render_mode`."""
        return tuple(self._frames.draw(qpos) for qpos in self._bodies.qpos) if self._frames else None

    def _begin(self, which: np.ndarray) -> None:
        ids = np.flatnonzero(which)
        self._walkers.begin(ids, np.concatenate([draw_start(self._np_random[i], self.task) for i in ids.tolist()]))
        self._ended = self._ended & ~which

    def _observations(self) -> Observations:
        return self._walkers.observer.named(self._walkers.observations())

    def _final(self, ended: np.ndarray) -> dict[str, Any]:
        """Return the last observations of episodes that ended, as Gymnasium's `infos`."""
        last, observations = self._walkers.observations(), np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = self._walkers.observer.named(last[i])
        return {"final_obs": observations, "_final_obs": ended, "final_info": {}, "_final_info": ended}
