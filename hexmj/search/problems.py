"""What is minimised (paper, Section 3): Problem 1, a fixed velocity, and Problem 2, velocities drawn from a range."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, OutOfReach, Refused, SimulationError
from hexmj.measures.kinematic import first_loss
from hexmj.measures.tables import columns, observed
from hexmj.plain import plain
from hexmj.progress import Progress, part_of
from hexmj.search.algorithms import Domain
from hexmj.search.forms import Form, NetworkForm
from hexmj.starts import draw_starts
from hexmj.stats import wilson_intervals
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride, observation_duration, steps_within
from hexmj.validate import choice, number
from hexmj.variants import variants, varied

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settle import Settled

REFUSED = 1.0
"""Cost of a candidate that its controller refuses, whose targets no leg reaches, or of which a simulation fails: as if
every start lost stability."""

Over = Literal["usual", "mean", "worst"]
Ties = Literal["equal", "later"]


@dataclass(frozen=True)
class Problem:
    """A cost function G: FLSS of controllers of a form, I_N^t of Eq. 9 or J_N^t of Eq. 10."""

    form: Form
    """Which parameters are free."""
    low: float
    """Least velocity of the range W, a fraction of V_p; Problem 1 if it is also the greatest."""
    high: float
    """Greatest velocity of the range W, a fraction of V_p."""
    observation_time: str | float = "walk"
    """'walk', 'start' or a number of time units."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""
    conditions: Conditions | None = None
    """Conditions of physical walks, whose falls are minimised; None minimises losses of kinematic stability."""
    feedback: bool = False
    """Candidates use sensory feedback, in physical walks."""
    over: Over = "usual"
    """Minimise the FLSS as given (usual), or its mean or worst over variants of constants and rules that the paper does
    not print (in physical walks without AEP0 11). A variant that the problem has anyway gets the default instead."""
    ties: Ties = "equal"
    """If two candidates lose equally many starts, they cost the same (equal), or later losses cost less (later), which
    shows a way if all starts lose stability."""

    def __post_init__(self) -> None:
        choice("over", self.over, get_args(Over))
        choice("ties", self.ties, get_args(Ties))
        if self.low > self.high:
            raise InputError(f"velocity range {self.low} to {self.high}; expected the least velocity first")
        observed(sorted({self.low, self.high}), self.observation_time, self.stride, self.acceleration)
        if self.feedback and not self.conditions:
            raise InputError("feedback = True needs physical walks; the problem has no conditions")
        if self.conditions:
            check_ground(self.conditions)
        if self.over != "usual" and not isinstance(self.form, NetworkForm):
            raise InputError(f"over = {self.over!r} needs a form of the 1998 network")

    @property
    def observation_times(self) -> list[str | float]:
        """The observation time of the cost, and the named ones."""
        named = [name for name in OBSERVATION_TIMES if self.low > 0 or name != "walk"]
        return list(dict.fromkeys([self.observation_time, *named]))

    def domain(self, reach: float, begin: Controller | None = None) -> Domain:
        """Return the box of the first population, with the vector of `begin` if that is given.

        At a reach of 1 the greater magnitude of a parameter's ends is its unit.
        """
        number("domain", reach, 1e-6, 1e6)
        vector, unit = self.form.vector(begin) if begin else self.form.begin, np.abs(self.form.box(1.0)).max(axis=0)
        return Domain(*self.form.box(reach), self.form.binary, vector, unit)

    def controller(self, vector: np.ndarray) -> Controller:
        """Return the controller of a candidate, (parameter,)."""
        controller = self.form.controller(vector)
        return SensoryFeedback(controller) if self.feedback else controller

    def refusal(self, vector: np.ndarray) -> str:
        """Return why no controller can be made of a candidate, (parameter,); an empty text if one can."""
        try:
            self.controller(vector)
        except ValueError as error:
            return f"{type(error).__name__}: {error}"
        return ""

    @property
    def minimised(self) -> str:
        """The cost in words."""
        lost = "that fell" if self.conditions else "lost"
        later = f"(starts {lost} + mean part of the time lost) / (starts + 1)"
        cost = later if self.ties == "later" else "FLSS"
        names = {"usual": cost, "mean": f"mean over variants of {cost}", "worst": f"greatest {cost} of all variants"}
        return names[self.over]

    def settings(self) -> dict[str, Any]:
        """Return the problem as plain data."""
        names = "form", "low", "high", "observation_time", "feedback", "over", "ties"
        own = {name: plain(getattr(self, name)) for name in names}
        own |= {"stride": asdict(self.stride), "acceleration": self.acceleration and asdict(self.acceleration)}
        return own | {"conditions": self.conditions and self.conditions.settings()}


@dataclass(frozen=True)
class Sample:
    """The starts on which all candidates are judged: the first of a seed, as `flss` and `flss_over_range` draw them."""

    problem: Problem
    n_starts: int
    seed: int

    @cached_property
    def variants(self) -> "dict[str, Sample]":
        """The same starts for each of the problem's variants, over which `over` is taken, by name."""
        problem = self.problem
        if problem.over == "usual":
            return {"usual": self}

        def under(name: str) -> Sample:
            form, stride = varied(problem.form, name), varied(problem.stride, name)
            return replace(self, problem=replace(problem, form=form, stride=stride, over="usual"))

        return {name: under(name) for name in variants(physical=problem.conditions is not None)}

    @cached_property
    def starts(self) -> np.ndarray:
        """(start, leg) tips at time 0 [mm]."""
        return draw_starts(self.n_starts, self.seed, self.problem.stride)

    @cached_property
    def velocity(self) -> np.ndarray:
        """(start,) V_r of each start, a fraction of V_p."""
        return np.random.default_rng([self.seed, 1]).uniform(self.problem.low, self.problem.high, self.n_starts)

    @cached_property
    def _settled(self) -> "list[Settled]":
        return []

    def settle(self, threads: int | None = None) -> None:
        """Let the starts of all variants come to rest if candidates walk physically, or raise SimulationError."""
        from hexmj.physics.settle import settle

        for one in self.variants.values():
            if one.problem.conditions and not one._settled:
                one._settled.append(settle(one.starts, one.problem.conditions, one.problem.stride, threads))

    def costs(self, vectors: np.ndarray, threads: int | None = None) -> np.ndarray:
        """Return G of each candidate, (candidate,), from (candidate, parameter)."""
        self.settle(threads)
        return self._combined([[one._cost(vector, threads) for vector in vectors] for one in self.variants.values()])

    def _combined(self, values: Any) -> np.ndarray:
        """Combine values of all variants, (variant, ...), into the one that is minimised, (...)."""
        return np.mean(values, axis=0) if self.problem.over == "mean" else np.max(values, axis=0)

    def _cost(self, vector: np.ndarray, threads: int | None) -> float:
        """Return FLSS; if ties are broken, the mean part of the time lost counts as one more start."""
        if self.problem.refusal(vector):
            return REFUSED
        try:
            times, (ends,) = self._times(self.problem.controller(vector), [self.problem.observation_time], threads)
        except (OutOfReach, Refused, SimulationError):
            return REFUSED
        lost = (times <= ends).sum().item()
        if self.problem.ties == "equal":
            return lost / self.n_starts
        return (lost + np.mean(1.0 - np.minimum(times / ends, 1.0)).item()) / (self.n_starts + 1)

    def lost(self, cost: float) -> int | None:
        """Return how many starts were lost, or fell, at a cost; None for a mean over variants."""
        if self.problem.over == "mean":
            return None
        if self.problem.ties == "equal":
            return round(cost * self.n_starts)
        return min(int(cost * (self.n_starts + 1) + 1e-9), self.n_starts)  # less than one start more for the time

    def check_walks(self, vector: np.ndarray, threads: int | None = None) -> None:
        """Raise the InputError or SimulationError of a candidate, (parameter,), that does not walk."""
        self.settle(threads)
        for one in self.variants.values():
            one._times(one.problem.controller(vector), [one.problem.observation_time], threads)

    def verdict(
        self, controllers: Mapping[str, Controller], threads: int | None = None, progress: Progress | None = None
    ) -> "xr.Dataset":
        """Return FLSS of controllers over (controller, observation time) with its 95 % Wilson interval.

        The interval of a mean over variants is that of the rounded mean count. It is rather too wide: as if all
        variants lost stability together. Raises InputError if a controller does not walk.
        """
        import xarray as xr

        self.settle(threads)
        observation_times = self.problem.observation_times
        advance = part_of(progress, 1.0 / len(controllers) / len(self.variants))

        def losses(variant: str, controller: Controller) -> np.ndarray:
            """Return the number of starts lost within each observation time, (observation time,)."""
            times, ends = self.variants[variant]._times(varied(controller, variant), observation_times, threads)
            if advance:
                advance(1.0)
            return (times <= ends).sum(axis=1)

        lost = self._combined([[losses(name, one) for one in controllers.values()] for name in self.variants])
        interval = wilson_intervals(np.rint(lost), self.n_starts)
        return xr.Dataset(
            columns("flss", ("controller", "observation_time"), lost / self.n_starts, *interval),
            coords={"controller": list(controllers), "observation_time": list(map(str, observation_times))},
        )

    def _times(
        self, controller: Controller, observation_times: list[str | float], threads: int | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return when each start loses stability, or falls, and the ends of its observation times [time units].

        Returns:
            (start,) and (observation time, start). An end is a millionth of a step late, so that the last step counts.
        """
        p, dt = self.problem, self.problem.stride.dt
        times = [observation_duration(time, self.velocity, p.stride, p.acceleration) for time in observation_times]
        ends = np.array([steps_within(time, p.stride) for time in times]) * dt
        longest, how = ends.max(axis=0), {"acceleration": p.acceleration, "threads": threads}
        if p.conditions:
            from hexmj.measures.physical import physical_outcomes

            (settled,) = self._settled
            lost = physical_outcomes(settled, controller, self.velocity, float(longest.max()), **how).fall
        else:
            lost = first_loss(self.starts, controller, self.velocity, longest, stride=p.stride, **how)
        return lost, ends + 1e-6 * dt
