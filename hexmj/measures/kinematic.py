"""The kinematic measure: planned walks, their first losses, and FLSS, the frequency of these (paper, Section 3)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.attributes import attributes
from hexmj.checks import given, typed
from hexmj.controllers.asking import advanced, begin
from hexmj.controllers.losses import first_losses
from hexmj.controllers.protocol import Controller, check_controller_type, settings_of
from hexmj.errors import InputError
from hexmj.intervals import wilson_interval, wilson_intervals
from hexmj.measures.velocities import observed, velocity_axis
from hexmj.progress import Progress, shown
from hexmj.starts import SAMPLE, check_draw, draw_slabs
from hexmj.timing import Acceleration, Stride, observation_time, steps_within
from hexmj.walks import PlannedWalk

if TYPE_CHECKING:
    import xarray as xr


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


def flss(
    controller: Controller,
    velocities: Sequence[float] | float,
    *,
    n_starts: int = 7 * SAMPLE,
    window: str | float = "walk",
    seed: int = 0,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> "xr.Dataset":
    """Kinematic FLSS, I_N^t of Eq. 9, at each velocity, over the same starts.

    Starts are drawn, walked and counted slab by slab; of 1000 starts 8 bytes a velocity are kept.  The time of
    every loss is had from `first_loss` of `draw_starts`.

    Args:
        controller: plans the walks.
        velocities: V_r (when accelerating, its final value), one or several, each 0 <= V < 1.
        n_starts: N.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of the starts.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: True shows a bar; or a function that is told the fraction done since it was last called.

    Returns:
        Over velocities: `flss`, its interval `low`, `high`, the standard deviation `sample_sd` over samples
        of 1000 starts, and the observation time `duration`.
    """
    stride = given("stride", stride, Stride)
    check_controller_type(controller)
    n_starts, seed = check_draw(n_starts, seed)
    v, duration = observed(velocities, window, stride, acceleration)
    how: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
    counts = []
    with shown(progress, "kinematic FLSS") as told:
        for x in draw_slabs(n_starts, seed, stride):
            lost = np.empty((len(v), len(x)), dtype=bool)
            for i in range(len(v)):
                lost[i] = np.isfinite(first_loss(x, controller, v[i], duration[i], **how))
                if told:
                    told(len(x) / n_starts / len(v))
            counts.append(losses_by_sample(lost))
    made = settings({controller.name: controller}, window, n_starts, seed, stride, acceleration)
    table = frequency_table(np.concatenate(counts, axis=1), n_starts, v, duration)
    return table.assign_attrs(attributes({"study": "flss"} | made))


def flss_over_range(
    controller: Controller,
    low: float,
    high: float,
    *,
    n_starts: int = 7 * SAMPLE,
    window: str | float = "walk",
    seed: int = 0,
    stride: Stride | None = None,
    threads: int | None = None,
) -> tuple[float, tuple[float, float]]:
    """Kinematic FLSS over a range of velocities, J_N^t of Eq. 10: each start has one of its own.

    Args:
        controller: plans the walks.
        low: least velocity of the range W, uniform, 0 <= V < 1.
        high: greatest velocity of the range W.
        n_starts: N.
        window: 'walk', 'start' or the observation time itself [time units]; the named ones follow each velocity.
        seed: of the starts and their velocities.
        stride: step range, lines of the tips and time step.
        threads: one per core unless given; the result does not depend on it.

    Returns:
        The frequency and its 95 % Wilson interval.

    Raises:
        InputError: a range, window, seed or number of starts that makes no sense.
    """
    stride = given("stride", stride, Stride)
    low, high = typed("low", low, float), typed("high", high, float)
    if not 0 <= low <= high < 1:
        raise InputError(f"velocity range {low} to {high}; expected 0 <= low <= high < 1")
    n_starts, seed = check_draw(n_starts, seed)
    rng, count = np.random.default_rng([seed, 1]), 0
    for x in draw_slabs(n_starts, seed, stride):
        v = rng.uniform(low, high, len(x))
        lost = first_loss(x, controller, v, observation_time(window, v, stride), stride=stride, threads=threads)
        count += int(np.isfinite(lost).sum())
    return count / n_starts, wilson_interval(count, n_starts)


def settings(
    controllers: Mapping[str, Controller],
    window: str | float,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
) -> dict[str, Any]:
    """All that is needed to run a measure again, as plain data; every result has it, see `attributes.settings`."""
    return {
        "controllers": {name: settings_of(one) for name, one in controllers.items()},
        "window": window,
        "starts": n_starts,
        "seed": seed,
        "stride": asdict(stride),
        "acceleration": asdict(acceleration) if acceleration else None,
    }


def losses_by_sample(lost: np.ndarray) -> np.ndarray:
    """Number of losses in each sample of 1000 starts, (velocity, sample), from (velocity, start)."""
    return np.add.reduceat(lost, np.arange(0, lost.shape[1], SAMPLE), axis=1, dtype=int)


def frequency_table(losses: np.ndarray, n_starts: int, velocities: np.ndarray, duration: np.ndarray) -> "xr.Dataset":
    """FLSS with its intervals, from the number of losses in each sample of `n_starts` starts, (velocity, sample)."""
    import xarray as xr

    total = losses.sum(axis=1)
    low, high = wilson_intervals(total, n_starts)
    samples = losses[:, : n_starts // SAMPLE] / SAMPLE
    spread = samples.std(axis=1, ddof=1) if samples.shape[1] > 1 else np.full(len(total), np.nan)
    columns = {
        "flss": (total / n_starts, "frequency of the loss of static stability"),
        "low": (low, "lower end of the 95 % Wilson interval"),
        "high": (high, "upper end of the 95 % Wilson interval"),
        "sample_sd": (spread, "standard deviation over samples of 1000 starts"),
    }
    told = {name: ("velocity", values, {"units": "1", "long_name": text}) for name, (values, text) in columns.items()}
    return xr.Dataset(told).assign(velocity_axis(velocities, duration))
