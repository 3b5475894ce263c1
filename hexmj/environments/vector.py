"""Many insects as one Gymnasium vector environment, on MuJoCo's batch.

What an insect does depends neither on how many there are nor on threads: insect i, begun with the seed s, does what the
single environment does that is begun with s + i.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexmj.errors import InputError, without_extra

try:
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError:
    raise without_extra("gym", "gymnasium") from None

from hexmj.checks import whole
from hexmj.environments.frames import Frames
from hexmj.environments.gym import checked_mode, checked_options, compiled_for, metadata_of, spaces_of
from hexmj.environments.task import action_names, checked_actions, drawn, task_of
from hexmj.environments.walkers import Walkers
from hexmj.physics.backend import MujocoBatch
from hexmj.physics.fine_steps import FineSteps

MOST = 10**6
"""Most insects in one environment; they take tens of gigabytes."""

Observations = dict[str, np.ndarray]


class StickInsects(VectorEnv[Observations, np.ndarray, np.ndarray]):
    """Some insects, each in an episode of its own."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        """Its settings are those of `task.Task`.

        Args:
            num_envs: number of insects.
            autoreset_mode: when the next episode of an insect begins: 'NextStep', 'SameStep' or 'Disabled'.
            threads: step them, one per core unless given.
            render_mode: 'rgb_array' for `render`.
            task: velocity, actions, controller, conditions, stride, duration.

        Raises:
            InputError: a value that makes no sense.
        """
        self.task, self.num_envs = task_of(task), whole("num_envs", num_envs, 1, MOST)
        self._compiled = compiled = compiled_for(self.task)
        self.render_mode = checked_mode(render_mode)
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = metadata_of(self.task) | {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space, self.single_action_space = spaces_of(compiled, self.task)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._bodies = MujocoBatch(compiled, self.num_envs, threads)
        take = FineSteps.of(self._bodies, self.task.substeps, compiled).take
        self._walkers = Walkers(self.task, compiled, self._bodies, take, self.num_envs, threads)
        self._rngs: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._frames = Frames(self.task.conditions) if render_mode else None

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]  # as Gymnasium's own vector environments
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin episodes of all insects, or of those that `options["reset_mask"]`, (insect,) of bool, says.

        Args:
            seed: s for s + i of insect i, one for each, or none to go on drawing.
            options: the mask.

        Raises:
            InputError: seeds or a mask that make no sense, or no such option.
            SimulationError: a start that does not settle; all must be reset then.
        """
        which = _mask(checked_options(options, "reset_mask").get("reset_mask"), self.num_envs)
        if not (self._walkers.begun or which.all()):
            raise InputError(
                "a reset_mask leaves out insects that have never begun, or whose last step or reset failed;"
                " expected a reset of all"
            )
        self._seed(_seeds(seed, self.num_envs), which)
        self._begin(which)
        return self._observations(), {}

    def step(self, actions: np.ndarray) -> tuple[Observations, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of all insects; `autoreset_mode` says what becomes of those whose episode is over.

        In the mode 'SameStep' the last observations of episodes that ended are in `final_obs`; in the mode 'Disabled'
        an insect stays as it is from then on, without rewards, until it is reset.

        Raises:
            InputError: actions out of bounds.
            SimulationError: a simulation that diverged, or a start that does not settle; all must be reset then.
        """
        actions = checked_actions(actions, (self.num_envs, len(action_names(self._compiled, self.task))))
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
        """A frame of every insect, (height, width, 3), if they were asked for by `render_mode`."""
        return tuple(self._frames.draw(qpos) for qpos in self._bodies.qpos) if self._frames else None

    def close_extras(self, **kwargs: Any) -> None:
        """Free the GL, if one was chosen."""
        if self._frames:
            self._frames.close()

    def __reduce__(self) -> Any:
        """Refuse copies and pickles, which would not share the memory that MuJoCo steps."""
        raise InputError("an environment can be neither copied nor pickled; expected another gymnasium.make_vec")

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The insects' generators."""
        return tuple(self._rngs)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The insects' seeds."""
        return tuple(self._seeds)

    def _seed(self, seeds: list[int | None], which: np.ndarray) -> None:
        """Make new generators of some insects where there is a seed, or nothing yet."""
        if not self._rngs:
            self._rngs, self._seeds = ([*one] for one in zip(*(seeding.np_random(seed) for seed in seeds), strict=True))
            return
        for i in np.flatnonzero(which).tolist():
            if seeds[i] is not None:
                self._rngs[i], self._seeds[i] = seeding.np_random(seeds[i])

    def _begin(self, which: np.ndarray) -> None:
        ids = np.flatnonzero(which)
        self._walkers.begin(ids, np.concatenate([drawn(self._rngs[i], self.task) for i in ids.tolist()]))
        self._ended = self._ended & ~which

    def _observations(self) -> Observations:
        return self._walkers.observer.named(self._walkers.observations())

    def _final(self, ended: np.ndarray) -> dict[str, Any]:
        """The last observations of those whose episode is over."""
        last, observations, infos = self._walkers.observations(), np.full(self.num_envs, None, dtype=object), {}
        for i in np.flatnonzero(ended).tolist():
            observations[i] = self._walkers.observer.named(last[i].copy())
            infos = self._add_info(infos, {"final_info": {}}, i)
        return infos | {"final_obs": observations, "_final_obs": ended}


def _mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(one.value for one in AutoresetMode)
        raise InputError(f"autoreset_mode = {mode!r:.80}; valid names: {names}") from None


def _seeds(seed: Any, count: int) -> list[int | None]:
    """A seed for each insect."""
    if seed is None:
        return [None] * count
    if np.ndim(seed) or (isinstance(seed, Sequence) and not isinstance(seed, str)):
        if len(seed) != count:
            raise InputError(f"{len(seed)} seeds; expected one for each of {count} insects")
        return [None if one is None else whole("seed", one, 0) for one in seed]
    return [whole("seed", seed, 0) + i for i in range(count)]


def _mask(mask: Any, count: int) -> np.ndarray:
    """Which insects begin, (insect,)."""
    if mask is None:
        return np.ones(count, dtype=bool)
    if not isinstance(mask, np.ndarray) or mask.shape != (count,) or mask.dtype != bool or not mask.any():
        raise InputError(f"reset_mask = {mask!r:.80}; expected an array of {count} booleans, one of them True at least")
    return mask.copy()
