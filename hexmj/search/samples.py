"""The starts on which candidates of a search are judged, and what each of them costs."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.checks import check_types, numbers
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, OutOfReach, Refused, SimulationError
from hexmj.labels import check_labels
from hexmj.measures.kinematic import first_loss
from hexmj.progress import Progress, part_of
from hexmj.search.network_forms import NetworkForm
from hexmj.search.problems import Problem
from hexmj.starts import check_draw, draw_starts
from hexmj.stats import wilson_intervals
from hexmj.threads import thread_count
from hexmj.timing import observation_duration, steps_within
from hexmj.variants import varied

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settling import Settled

REFUSED = 1.0
"""Cost of a candidate that its controller refuses, at once or to walk, whose tips no leg reaches, or of which a start's
simulation fails: as if every start lost stability."""


@dataclass(frozen=True)
class Sample:
    """Starts of a problem: common random numbers, the same for every candidate that is judged on them.

    They are the first starts of a seed, as `kinematic.flss` and `flss_over_range` draw them.
    """

    problem: Problem
    n_starts: int
    seed: int

    def __post_init__(self) -> None:
        check_types(self)
        check_draw(self.n_starts, self.seed)

    @cached_property
    def variants(self) -> "dict[str, Sample]":
        """The same starts of each of the problem's variants, by their names."""
        several = self.problem.over != "usual"
        return {name: replace(self, problem=one) if several else self for name, one in self.problem.variants.items()}

    @cached_property
    def starts(self) -> np.ndarray:
        """(start, leg) tips at time 0 [mm]."""
        return draw_starts(self.n_starts, self.seed, self.problem.stride)

    @cached_property
    def velocity(self) -> np.ndarray:
        """(start,) V_r of each start, a fraction of V_p."""
        return np.random.default_rng([self.seed, 1]).uniform(self.problem.low, self.problem.high, self.n_starts)

    @cached_property
    def _at_rest(self) -> "list[Settled]":
        """The starts at rest in MuJoCo, once they have settled."""
        return []

    def settle(self, threads: int | None = None) -> None:
        """Let the starts of all variants come to rest, once for all walks, if candidates walk in physics.

        Raises:
            InputError, SimulationError: a start that does not, see `physics.settling.settle`.
        """
        whose = f"of the {self.n_starts} starts of seed {self.seed}"
        for one in self.variants.values():
            try:
                if one.problem.conditions:
                    one._settled(one.problem.conditions, threads)
            except OutOfReach as error:
                raise InputError(f"{whose}, {error}") from None
            except SimulationError as error:
                raise SimulationError(f"{whose}, {error}", error.state, error.file_name) from None

    def _settled(self, conditions: Conditions, threads: int | None) -> "Settled":
        from hexmj.physics.settling import settle

        if not self._at_rest:
            self._at_rest.append(settle(self.starts, conditions, self.problem.stride, threads))
        return self._at_rest[0]

    def costs(self, vectors: np.ndarray, threads: int | None = None) -> np.ndarray:
        """G of each candidate, (candidate,), from (candidate, parameter): a function of vectors, nothing else.

        Raises:
            InputError: no such vectors.
        """
        check_labels(vectors, self.problem.form.names, "vectors")
        vectors = numbers("vectors", vectors)
        if vectors.shape[1:] != (len(self.problem.form.names),):
            raise InputError(f"vectors of the shape {vectors.shape}; expected (candidate, parameter)")
        return self._together([one._costs(vectors, threads) for one in self.variants.values()])

    def _together(self, values: Any) -> np.ndarray:
        """Of all variants, (variant, ...), what is minimised, (...)."""
        return np.mean(values, axis=0) if self.problem.over == "mean" else np.max(values, axis=0)

    def _costs(self, vectors: np.ndarray, threads: int | None) -> np.ndarray:
        """G of each candidate, (candidate,), of this one variant."""
        if self.problem.conditions:
            self._settled(self.problem.conditions, threads)  # a start that cannot stand is no candidate's fault

        def cost(vector: np.ndarray, threads: int | None) -> float:
            try:
                candidate = self.problem.controller(vector)
            except (InputError, ValueError):
                return REFUSED
            except Exception as error:
                raise InputError(
                    f"{self.problem.form!r:.80} makes no controller of {vector}: {error!r:.200}"
                ) from error
            try:
                return self._cost(candidate, threads)
            except (OutOfReach, Refused, SimulationError):
                return REFUSED
            except InputError as error:
                raise InputError(f"with {self._told(vector)}: {error}") from None

        # A user's plans may share a module's arrays, and hold the interpreter's lock anyway.
        if self.problem.conditions or len(vectors) == 1 or not isinstance(self.problem.form, NetworkForm):
            return np.array([cost(vector, threads) for vector in vectors])
        with ThreadPoolExecutor(thread_count(threads)) as pool:
            return np.array(list(pool.map(cost, vectors, [1] * len(vectors))))

    def _cost(self, candidate: Controller, threads: int | None) -> float:
        """FLSS; where ties are broken, with one start more that counts for the part of the time lost on average."""
        times, (ends,) = self._times(candidate, [self.problem.observation_time], threads)
        lost = (times <= ends).sum().item()
        if self.problem.ties == "equal":
            return lost / self.n_starts
        return (lost + np.mean(1.0 - np.minimum(times / ends, 1.0)).item()) / (self.n_starts + 1)

    def lost(self, cost: float) -> int | None:
        """How many of the starts were lost, or fell, at a cost; unknown of a mean over variants."""
        if self.problem.over == "mean":
            return None
        if self.problem.ties == "equal":
            return round(cost * self.n_starts)
        return min(int(cost * (self.n_starts + 1) + 1e-9), self.n_starts)  # less than one start more for the time

    def _told(self, vector: np.ndarray) -> str:
        """The parameters of a candidate, (parameter,), as a sentence names them."""
        return ", ".join(f"{name} = {value:g}" for name, value in zip(self.problem.form.names, vector, strict=True))

    def check_walks(self, best: np.ndarray, stage: str, threads: int | None = None) -> None:
        """Refuse the best candidate of a stage, (parameter,), that costs 1 since it does not walk.

        Raises:
            InputError: its controller refuses to walk, or its tips no leg reaches in physics.
            SimulationError: a start's simulation fails.
        """
        for one in self.variants.values():
            who = f"the best candidate of the {stage}, with {self._told(best)},"
            who += f" does not walk from its {self.n_starts} starts"
            try:
                one._times(one.problem.controller(best), [one.problem.observation_time], threads)
            except InputError as error:
                raise InputError(f"{who}: {error}") from None
            except SimulationError as error:
                raise SimulationError(f"{who}: {error}", error.state, error.file_name) from None

    def verdict(
        self, controllers: Mapping[str, Controller], threads: int | None = None, progress: Progress | None = None
    ) -> "xr.Dataset":
        """FLSS of controllers over (controller, observation time) with its 95 % Wilson interval, on these starts.

        The interval of a mean over variants is that of the mean count, rounded, and too wide rather than too narrow: as
        if all lost stability together.

        Raises:
            InputError: one of them does not walk, and which.
        """
        import xarray as xr

        observation_times, told = (
            self.problem.observation_times,
            part_of(progress, 1.0 / len(controllers) / len(self.variants)),
        )

        def losses(variant: str, name: str, controller: Controller) -> np.ndarray:
            """Number of starts that lose stability, or fall, within each observation time, (observation time,)."""
            try:
                times, ends = self.variants[variant]._times(varied(controller, variant), observation_times, threads)
            except InputError as error:
                raise InputError(f"the verdict on {name}: {error}") from None
            if told:
                told(1.0)
            return (times <= ends).sum(axis=1)

        lost = self._together([[losses(one, *which) for which in controllers.items()] for one in self.variants])
        low, high = wilson_intervals(np.rint(lost), self.n_starts)
        over, unit = ("controller", "observation_time"), {"units": "1"}
        return xr.Dataset(
            {
                "flss": (over, lost / self.n_starts, unit | {"long_name": "frequency of the loss of static stability"}),
                "flss_low": (over, low, unit | {"long_name": "lower end of the 95 % Wilson interval"}),
                "flss_high": (over, high, unit | {"long_name": "upper end of the 95 % Wilson interval"}),
            },
            coords={
                "controller": list(controllers),
                "observation_time": [str(observation_time) for observation_time in observation_times],
            },
        )

    def _times(
        self, controller: Controller, observation_times: list[str | float], threads: int | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """When each start loses stability, or falls, (start,), and the ends of its observation times, (observation time, start), both
        [time units]; an end is a millionth of a step late, so that what happens in its step is within."""
        p, dt = self.problem, self.problem.stride.dt
        times = [
            observation_duration(observation_time, self.velocity, p.stride, p.acceleration)
            for observation_time in observation_times
        ]
        ends = np.array([steps_within(time, p.stride) for time in times]) * dt
        longest = ends.max(axis=0)
        if p.conditions:
            lost = self._falls(controller, float(longest.max()), p.conditions, threads)
        else:
            lost = first_loss(
                self.starts, controller, self.velocity, longest,
                stride=p.stride, acceleration=p.acceleration, threads=threads,
            )  # fmt: skip
        return lost, ends + 1e-6 * dt

    def _falls(self, controller: Controller, time: float, conditions: Conditions, threads: int | None) -> np.ndarray:
        """When each start falls in a physical walk, (start,) [time units]."""
        from hexmj.measures.physical import physical_outcomes

        settled, acceleration = self._settled(conditions, threads), self.problem.acceleration
        return physical_outcomes(
            settled, controller, self.velocity, time, acceleration=acceleration, threads=threads
        ).fall
