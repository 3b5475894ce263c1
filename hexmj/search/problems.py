"""What is minimised (paper, Section 3): Problem 1, a fixed velocity, and Problem 2, velocities drawn from a range."""

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from hexmj.errors import InputError
from hexmj.intervals import wilson_intervals
from hexmj.loss_frequency import WINDOWS, draw_starts, observation_time
from hexmj.network import checked_velocities, first_loss, steps_within
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.search.domain import Domain
from hexmj.search.forms import FORMS, Form
from hexmj.threads import thread_count

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settling import Settled


@dataclass(frozen=True)
class Problem:
    """A cost function G: FLSS of a form of the model, I_N^t of Eq. 9 or J_N^t of Eq. 10."""

    form: Form
    """Which parameters are free, see `forms`."""
    low: float
    """Least velocity of the range W, a fraction of V_p; Problem 1 where it is also the greatest."""
    high: float
    """Greatest velocity of the range W, a fraction of V_p."""
    window: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    network: Network = field(default_factory=Network)
    """The constants that the paper leaves out."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""
    body: Body | None = None
    """Conditions of physical walks, where the physical FLSS is minimised; without it the kinematic one."""

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise InputError(f"form = {self.form!r}; valid names: {', '.join(FORMS)}")
        if not 0 <= self.low <= self.high < 1:
            raise InputError(f"velocity range {self.low} to {self.high}; expected 0 <= low <= high < 1")
        ends = checked_velocities([self.low, self.high], 2, self.acceleration)
        steps_within(observation_time(self.window, ends, self.network, self.acceleration), self.network)

    @property
    def windows(self) -> list[str | float]:
        """The window of the cost, and the named ones beside it."""
        named = [name for name in WINDOWS if self.low > 0 or name != "walk"]
        return list(dict.fromkeys([self.window, *named]))

    def names(self) -> list[str]:
        """Names of the parameters, in the order of the vector."""
        return list(FORMS[self.form].names)

    def domain(self, reach: float, begin: Model | None = None) -> Domain:
        """Where a search begins, not printed in the paper: -reach to reach for the neutral positions [mm], 0 to
        reach for shifts [mm] and weights (the signs of the printed sets), 0 to 1 for the binary P^2 and P^4."""
        if not 0 < reach < math.inf:
            raise InputError(f"domain = {reach}; expected a finite number above 0")
        form = FORMS[self.form]
        vector = None if begin is None else form.vector(begin)
        return Domain(np.where(form.neutral, -reach, 0.0), np.where(form.binary, 1.0, reach), form.binary, vector)


@dataclass(frozen=True, eq=False)
class Sample:
    """Starts of a problem: common random numbers, the same for every candidate that is judged on them."""

    problem: Problem
    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    velocity: np.ndarray
    """(start,) V_r of each start, a fraction of V_p."""
    settled: "Settled | None"
    """The starts at rest in MuJoCo, for a physical problem."""
    threads: int | None
    """One per core unless given; no result depends on it."""

    @classmethod
    def draw(cls, problem: Problem, size: int, seed: int, threads: int | None = None) -> "Sample":
        """The first `size` starts of a seed, as `loss_frequency.flss` and `flss_over_range` draw them."""
        starts = draw_starts(size, seed, problem.network)
        velocity = np.random.default_rng([seed, 1]).uniform(problem.low, problem.high, size)
        settled = None
        if problem.body:
            from hexmj.physics.settling import settle

            settled = settle(starts, problem.body, problem.network, threads)
        return cls(problem, starts, velocity, settled, threads)

    def costs(self, vectors: np.ndarray) -> np.ndarray:
        """G of each candidate, (candidate,), from (candidate, parameter): a function of vectors, nothing else."""

        def cost(vector: np.ndarray, threads: int | None) -> float:
            return self._losses(FORMS[self.problem.form].model(vector), [self.problem.window], threads)[0] / len(
                self.starts
            )

        if self.problem.body or len(vectors) == 1:
            return np.array([cost(vector, self.threads) for vector in vectors])
        with ThreadPoolExecutor(thread_count(self.threads)) as pool:
            return np.array(list(pool.map(cost, vectors, [1] * len(vectors))))

    def verdict(self, models: Mapping[str, Model]) -> "xr.Dataset":
        """FLSS of models over (model, window) with its 95 % Wilson interval, on these starts."""
        import xarray as xr

        size, windows = len(self.starts), self.problem.windows
        lost = np.array([self._losses(model, windows, self.threads) for model in models.values()])
        low, high = wilson_intervals(lost, size)
        over, unit = ("model", "window"), {"units": "1"}
        return xr.Dataset(
            {
                "flss": (over, lost / size, unit | {"long_name": "frequency of the loss of static stability"}),
                "flss_low": (over, low, unit | {"long_name": "lower end of the 95 % Wilson interval"}),
                "flss_high": (over, high, unit | {"long_name": "upper end of the 95 % Wilson interval"}),
            },
            coords={"model": list(models), "window": [str(window) for window in windows]},
        )

    def _losses(self, model: Model, windows: list[str | float], threads: int | None) -> np.ndarray:
        """Number of starts that lose stability, or fall, within each window, (window,)."""
        p, dt = self.problem, self.problem.network.dt
        steps = [
            steps_within(observation_time(w, self.velocity, p.network, p.acceleration), p.network) for w in windows
        ]
        ends = np.array(steps) * dt
        longest = ends.max(axis=0)
        if self.settled:
            from hexmj.physics.physical_walks import physical_outcomes

            time = float(longest.max())
            outcomes = physical_outcomes(
                self.settled, model, self.velocity, time, acceleration=p.acceleration, threads=threads
            )
            lost = outcomes.fall
        else:
            lost = first_loss(
                self.starts,
                model,
                self.velocity,
                longest,
                network=p.network,
                acceleration=p.acceleration,
                threads=threads,
            )
        return (lost <= ends + 1e-6 * dt).sum(axis=1)
