"""The kinematic measure: planned walks, their first losses, and FLSS, the frequency of these (paper, Section 3)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import ArrayLike

from hexmj.checks import check_types, given, typed, whole
from hexmj.controllers.checked_plans import advanced, begin, check_velocities
from hexmj.controllers.losses import first_losses
from hexmj.controllers.protocol import Controller, check_controller_type, settings_of
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.measures.frequency import frequency_table, losses_by_sample, settings
from hexmj.measures.velocities import observed
from hexmj.progress import Progress
from hexmj.starts import MOST_STARTS, SAMPLE, check_draw, draw_slabs
from hexmj.stats import wilson_interval
from hexmj.sweep import Cell, Execution, run_study
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within
from hexmj.walks import PlannedWalk

if TYPE_CHECKING:
    import xarray as xr

RANGE = 1600 * SAMPLE
"""Starts of a range that one worker counts: seconds to minutes of one core."""

MOST_RANGES = 10**5
"""More files in one folder are no good."""


def walk(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike,
    duration: float,
    *,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> PlannedWalk:
    """The planned walk of every start.

    Args:
        starts: tips at time 0, all standing, (start, leg) [mm].
        controller: plans it.
        velocity: V_r, or its final value V_r* when accelerating; one number or (start,), 0 <= V_r < 1.
        duration: observation time [time units].
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        threads: one per core unless given; the result does not depend on it.

    Raises:
        InputError: a start, velocity or duration that makes no sense.
    """
    stride = given("stride", stride, Stride)
    plan = begin(controller, starts, velocity, stride, acceleration, threads)
    return advanced(plan, int(steps_within(typed("duration", duration, float), stride)))


def first_loss(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike,
    duration: ArrayLike,
    *,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Time of the first loss of static stability (Eq. 7), (start,) [time units]; inf where there is none.

    The walks are those of `walk`, but none is kept; `duration` may be (start,).
    """
    stride = given("stride", stride, Stride)
    plan = begin(controller, starts, velocity, stride, acceleration, threads)
    steps, count = steps_within(duration, stride), len(plan.starts)
    if steps.shape not in ((), (count,)):
        raise InputError(f"durations have the shape {steps.shape}; expected one number or ({count},)")
    lost = first_losses(plan, steps, threads)
    return np.where(lost > 0, lost * stride.dt, np.inf)


@dataclass(frozen=True)
class KinematicFlss:
    """Kinematic FLSS of a controller, a cell for each velocity and range of starts.

    All ranges are stretches of one stream of random starts, and losses are counted by its samples of 1000: however it
    is cut, the counts are those of one long run.
    """

    controller: Controller
    """Plans the walks."""
    velocities: Sequence[float]
    """V_r (when accelerating, its final value), each 0 <= V < 1."""
    n_starts: int = 7 * SAMPLE
    """N, the same starts for every velocity."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    seed: int = 0
    """Of the starts."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""
    range_of: int = RANGE
    """Starts of a range; the last one may have fewer."""

    def __post_init__(self) -> None:
        check_types(self)
        settings_of(self.controller)  # now, not after the work
        check_draw(self.n_starts, self.seed)
        whole("range_of", self.range_of, math.ceil(self.n_starts / MOST_RANGES), MOST_STARTS)
        _ = self.observed

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride, self.acceleration)

    @property
    def places(self) -> list[tuple[int, int]]:
        """Of each cell: the velocity's place and the range's first start."""
        return list(product(range(len(self.velocities)), range(0, self.n_starts, self.range_of)))

    def cells(self) -> list[Cell]:
        """See `sweep.Study`; each is a `losses_of_range`."""
        v, duration = self.observed
        check_velocities(self.controller, self.velocities, self.stride, self.acceleration)
        same = {name: getattr(self, name) for name in ("controller", "seed", "stride", "acceleration")}
        cells = []
        for i, first in self.places:
            count = min(self.range_of, self.n_starts - first)
            own = {"velocity": v[i], "duration": duration[i], "first": first, "n_starts": count}
            name = f"{self.controller.name}-V-{v[i]:g}-from-{first}"
            cells.append(Cell(name, losses_of_range, same | own, work=duration[i] * count))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """As `flss` gives it."""
        losses = np.zeros((len(self.velocities), math.ceil(self.n_starts / SAMPLE)), dtype=int)
        for (i, first), one in zip(self.places, data, strict=True):
            begin = first // SAMPLE
            losses[i, begin : begin + one.sizes["sample"]] += one.losses.values
        told = self.observation_time, self.n_starts, self.seed, self.stride, self.acceleration
        made = settings({self.controller.name: self.controller}, *told)
        return frequency_table(losses, self.n_starts, *self.observed).assign_attrs(attributes({"study": "flss"} | made))


def losses_of_range(
    controller: Controller,
    velocity: float,
    duration: float,
    first: int,
    n_starts: int,
    *,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """How many of the starts from `first` on lose static stability: `losses`, (sample,), of 1000 starts each.

    Starts are drawn, walked and counted slab by slab.  The samples are those of the stream; the range holds no more
    than a part of the first and the last, if it does not begin and end with one.
    """
    import xarray as xr

    begin = first // SAMPLE
    losses = np.zeros(math.ceil((first + n_starts) / SAMPLE) - begin, dtype=int)
    for x in draw_slabs(n_starts, seed, stride, first):
        times = first_loss(x, controller, velocity, duration, stride=stride, acceleration=acceleration, threads=threads)
        count = losses_by_sample(np.isfinite(times)[None], first)[0]
        losses[first // SAMPLE - begin :][: len(count)] += count
        first += len(x)
        if progress:
            progress(len(x) / n_starts)
    return xr.Dataset({"losses": ("sample", losses, {"units": "1", "long_name": "starts that lose static stability"})})


def flss(
    controller: Controller,
    velocities: Sequence[float] | float,
    *,
    n_starts: int = KinematicFlss.n_starts,
    observation_time: str | float = KinematicFlss.observation_time,
    seed: int = KinematicFlss.seed,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    range_of: int = RANGE,
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Kinematic FLSS, I_N^t of Eq. 9, at each velocity, over the same starts.

    Of 1000 starts 8 bytes a velocity are kept.  The time of every loss is had from `first_loss` of `draw_starts`.

    Args:
        controller: as of `KinematicFlss`, and so are `velocities` to `range_of`.
        velocities: V_r, one or several.
        n_starts: N.
        observation_time: observation time.
        seed: of the starts.
        stride: of the plans.
        acceleration: of Eq. 11.
        range_of: starts of a range, which is computed and kept as one; the result does not depend on it.
        folder: keeps what is finished, for a run that was stopped; None keeps nothing.
        how: executor, threads and progress, see `sweeps.Execution`; the result does not depend on it.

    Returns:
        Over velocities: `flss`, its interval `low`, `high`, the standard deviation `sample_sd` over samples
        of 1000 starts, and the observation time `duration`.

    Raises:
        InputError: something that makes no sense, and what `sweeps.finish` raises.
    """
    check_controller_type(controller)
    stride = given("stride", stride, Stride)
    n_starts, seed = check_draw(n_starts, seed)
    v, _ = observed(velocities, observation_time, stride, acceleration)
    study = KinematicFlss(controller, v.tolist(), n_starts, observation_time, seed, stride, acceleration, range_of)
    return run_study(study, folder, **how)


def flss_over_range(
    controller: Controller,
    low: float,
    high: float,
    *,
    n_starts: int = 7 * SAMPLE,
    observation_time: str | float = "walk",
    seed: int = 0,
    stride: Stride | None = None,
    threads: int | None = None,
) -> tuple[float, tuple[float, float]]:
    """Kinematic FLSS over a range of velocities, J_N^t of Eq. 10: each start has one of its own.

    Args:
        controller: plans the walks.
        low: least velocity of the range W, uniform, 0 <= V < 1, and above 0 with the observation time 'walk'.
        high: greatest velocity of the range W.
        n_starts: N.
        observation_time: 'walk', 'start' or the observation time itself [time units]; the named ones follow each velocity.
        seed: of the starts and their velocities.
        stride: step range, lines of the tips and time step.
        threads: one per core unless given; the result does not depend on it.

    Returns:
        The frequency and its 95 % Wilson interval.

    Raises:
        InputError: a range, observation time, seed or number of starts that makes no sense.
    """
    stride = given("stride", stride, Stride)
    low, high = typed("low", low, float), typed("high", high, float)
    if not 0 <= low <= high < 1:
        raise InputError(f"velocity range {low} to {high}; expected 0 <= low <= high < 1")
    n_starts, seed = check_draw(n_starts, seed)
    observation_duration(
        observation_time, low, stride
    )  # refuses a range that begins where there is no period, whatever is drawn
    rng, count = np.random.default_rng([seed, 1]), 0
    for x in draw_slabs(n_starts, seed, stride):
        v = rng.uniform(low, high, len(x))
        lost = first_loss(
            x, controller, v, observation_duration(observation_time, v, stride), stride=stride, threads=threads
        )
        count += int(np.isfinite(lost).sum())
    return count / n_starts, wilson_interval(count, n_starts)
