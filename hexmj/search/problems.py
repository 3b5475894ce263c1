"""Cost functions of a search (paper, Section 3): Problem 1 at one velocity, Problem 2 at random ones of a range."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, OutOfReach, Refused, SimulationError
from hexmj.measures.kinematic import dynamic_losses, first_loss
from hexmj.measures.study import settled_starts
from hexmj.measures.tables import Measure, columns, observed
from hexmj.plain import plain
from hexmj.progress import Progress, part_of
from hexmj.search.algorithms import Domain
from hexmj.search.forms import Form, NetworkForm
from hexmj.starts import draw_starts
from hexmj.stats import wilson_intervals
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within
from hexmj.validate import choice, number
from hexmj.variants import variants, varied

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settle import Settled

REFUSED = 1.0
"""Cost of a candidate that cannot walk: parameters that the controller rejects, foot targets out of reach, or a failed
simulation. It counts as if every start lost stability."""

Over = Literal["usual", "mean", "worst"]
Ties = Literal["equal", "later"]


@dataclass(frozen=True)
class Problem:
    """A cost function G of a form's parameters: the FLSS I_N^t of Eq. 9 or J_N^t of Eq. 10, or the FLDS likewise."""

    form: Form
    """Form that defines the free parameters."""
    low: float
    """Lowest velocity of the range W, a fraction of V_p; Problem 1 has low = high."""
    high: float
    """Highest velocity of the range W, a fraction of V_p."""
    observation_time: str | float = "walk"
    """Time in which a start must keep stability: 'walk', 'start' or a number of time units."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines along which the tips move, and time step."""
    acceleration: Acceleration | None = None
    """Accelerate from V_r(0) to the velocity by Eq. 11; by default, walk at the velocity from time 0 on."""
    measure: Measure = "kinematic"
    """Losses that count: of the plan's static (kinematic) or dynamic stability, or falls of the body (physical)."""
    conditions: Conditions = Conditions()
    """Conditions of physical walks; of the dynamic measure, V_p and the standing height."""
    feedback: bool = False
    """Let candidates use sensory feedback, which needs physical walks."""
    over: Over = "usual"
    """Cost: FLSS with these settings (usual), or its mean or maximum over variants, each with one changed constant or
    rule that the paper does not print (mean, worst). Physical walks omit the variant AEP0 11, which is out of reach."""
    ties: Ties = "equal"
    """Candidates that lose equally many starts cost the same (equal), or later losses cost less (later), which guides a
    search in which all starts lose stability."""

    def __post_init__(self) -> None:
        choice("measure", self.measure, get_args(Measure))
        choice("over", self.over, get_args(Over))
        choice("ties", self.ties, get_args(Ties))
        if self.low > self.high:
            raise InputError(f"velocity range {self.low} to {self.high}; expected the lower velocity first")
        observed(sorted({self.low, self.high}), self.observation_time, self.stride, self.acceleration)
        if self.feedback and not self.physical:
            raise InputError(f"feedback = True needs measure = 'physical', but it is {self.measure!r}")
        check_ground(self.conditions)
        if self.over != "usual" and not isinstance(self.form, NetworkForm):
            raise InputError(f"over = {self.over!r} needs a form of the 1998 network (NetworkForm)")

    @property
    def physical(self) -> bool:
        """Whether bodies walk."""
        return self.measure == "physical"

    def domain(self, reach: float, begin: Controller | None = None) -> Domain:
        """Return the box of the initial population, which begins with the vector of `begin`, if given.

        `reach` scales the box, see `Effort.domain`. The unit of a parameter is its largest magnitude for a reach of 1.
        """
        number("domain", reach, 1e-6, 1e6)
        vector, unit = self.form.vector(begin) if begin else self.form.begin, np.abs(self.form.box(1.0)).max(axis=0)
        return Domain(*self.form.box(reach), self.form.binary, vector, unit)

    def controller(self, vector: np.ndarray) -> Controller:
        """Return the controller with the parameters of a candidate, (parameter,)."""
        controller = self.form.controller(vector)
        return SensoryFeedback(controller) if self.feedback else controller

    @property
    def frequency(self) -> str:
        """Name of the frequency of losses."""
        return "FLDS" if self.measure == "dynamic" else "FLSS"

    @property
    def minimised(self) -> str:
        """Description of the cost."""
        lost = "that fell" if self.physical else "lost"
        later = f"(starts {lost} + mean part of the time lost) / (starts + 1)"
        cost = later if self.ties == "later" else self.frequency
        names = {"usual": cost, "mean": f"mean over variants of {cost}", "worst": f"greatest {cost} of all variants"}
        return names[self.over]

    def settings(self) -> dict[str, Any]:
        """Return the problem as plain data."""
        own = {name: plain(value) for name, value in vars(self).items() if name != "conditions"}
        return own | {"conditions": self.conditions.settings()}


@dataclass(frozen=True)
class Sample:
    """Starts on which all candidates walk: the first of a seed, as in `flss` and `flss_over_range`."""

    problem: Problem
    n_starts: int
    seed: int

    @cached_property
    def variants(self) -> "dict[str, Sample]":
        """Name of each variant -> sample of the same starts under it; `Problem.over` combines their costs."""
        problem = self.problem
        if problem.over == "usual":
            return {"usual": self}

        def under(name: str) -> Sample:
            form, stride = varied(problem.form, name), varied(problem.stride, name)
            return replace(self, problem=replace(problem, form=form, stride=stride, over="usual"))

        return {name: under(name) for name in variants(physical=problem.physical)}

    @cached_property
    def starts(self) -> np.ndarray:
        """(start, leg) initial tip positions along the step lines [mm]."""
        return draw_starts(self.n_starts, self.seed, self.problem.stride)

    @cached_property
    def velocity(self) -> np.ndarray:
        """(start,) velocity V_r of each start, as a fraction of V_p."""
        return np.random.default_rng([self.seed, 1]).uniform(self.problem.low, self.problem.high, self.n_starts)

    def settle(self, threads: int | None = None) -> None:
        """For physical walks, let the body settle at all starts; raise SimulationError if it does not come to rest."""
        for one in self.variants.values() if self.problem.physical else ():
            one._settled(threads)

    def _settled(self, threads: int | None) -> "Settled":
        return settled_starts(self.n_starts, self.seed, self.problem.conditions, self.problem.stride, threads)

    def costs(self, vectors: np.ndarray, threads: int | None = None) -> np.ndarray:
        """Return the cost of each candidate, (candidate,), from the parameters, (candidate, parameter)."""
        self.settle(threads)
        return self._combined([[one._cost(vector, threads) for vector in vectors] for one in self.variants.values()])

    def _combined(self, values: Any) -> np.ndarray:
        """Return the mean or the largest of all variants' values, (variant, ...) -> (...), see `Problem.over`."""
        return np.mean(values, axis=0) if self.problem.over == "mean" else np.max(values, axis=0)

    def _cost(self, vector: np.ndarray, threads: int | None) -> float:
        """Return the FLSS; with ties 'later', the mean part of the time after a loss counts as one more start."""
        try:
            controller = self.problem.controller(vector)
        except ValueError:
            return REFUSED
        try:
            times, ends = self._times(controller, threads)
        except (OutOfReach, Refused, SimulationError):
            return REFUSED
        lost = (times <= ends).sum().item()
        if self.problem.ties == "equal":
            return lost / self.n_starts
        return (lost + np.mean(1.0 - np.minimum(times / ends, 1.0)).item()) / (self.n_starts + 1)

    def check_walks(self, vector: np.ndarray, threads: int | None = None) -> None:
        """Raise InputError or SimulationError if a candidate, (parameter,), cannot walk; return None otherwise."""
        self.settle(threads)
        for one in self.variants.values():
            one._times(one.problem.controller(vector), threads)

    def verdict(
        self, controllers: Mapping[str, Controller], threads: int | None = None, progress: Progress | None = None
    ) -> "xr.Dataset":
        """Return the FLSS of each controller, with its 95 % Wilson interval.

        The interval of a mean over variants is that of the rounded mean count. It is too wide, because it assumes that
        a start is lost under all variants or under none. Raises InputError if a controller cannot walk.
        """
        import xarray as xr

        self.settle(threads)
        advance = part_of(progress, 1.0 / len(controllers) / len(self.variants))

        def losses(variant: str, controller: Controller) -> int:
            """Return the number of starts that lose stability."""
            times, ends = self.variants[variant]._times(varied(controller, variant), threads)
            if advance:
                advance(1.0)
            return int(np.count_nonzero(times <= ends))

        lost = self._combined([[losses(name, one) for one in controllers.values()] for name in self.variants])
        interval = wilson_intervals(np.rint(lost), self.n_starts)
        table = columns("flss", ("controller",), lost / self.n_starts, *interval)
        return xr.Dataset(table, coords={"controller": list(controllers)})

    def _times(self, controller: Controller, threads: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Walk, and return when each start loses stability, or falls, and when its observation time ends.

        Returns:
            Times of loss and ends, (start,) each [time units]. An end is later by a millionth of a step, so that a loss
            in the last step counts.
        """
        p, dt = self.problem, self.problem.stride.dt
        duration = observation_duration(p.observation_time, self.velocity, p.stride, p.acceleration)
        ends, how = steps_within(duration, p.stride) * dt, {"acceleration": p.acceleration, "threads": threads}
        if p.physical:
            from hexmj.measures.physical import physical_outcomes

            settled = self._settled(threads)
            lost = physical_outcomes(settled, controller, self.velocity, float(ends.max()), **how).fall
        elif p.measure == "dynamic":
            walks = self.starts, controller, self.velocity, ends
            lost = dynamic_losses(*walks, conditions=p.conditions, stride=p.stride, **how).dynamic
        else:
            lost = first_loss(self.starts, controller, self.velocity, ends, stride=p.stride, **how)
        return lost, ends + 1e-6 * dt
