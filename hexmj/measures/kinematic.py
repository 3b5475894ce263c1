"""Measures of the plan: FLSS (paper, Section 3), from the first losses of static stability of planned walks, and FLDS.

FLDS is the frequency of the loss of dynamic stability, see `tipping`.  It depends on V_p and on the standing height.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike

from hexmj.command import Command
from hexmj.conditions import Conditions
from hexmj.controllers.planning import advanced, check_velocities, first_dynamic_losses, first_losses
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.controllers.steered import begin
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.measures.tables import WalkSettings, observed, settings, velocity_axis
from hexmj.progress import Progress
from hexmj.starts import MOST_STARTS, SAMPLE, check_draw, draw_slabs
from hexmj.stats import wilson_interval, wilson_intervals
from hexmj.sweep import Cell, Execution, run_study
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within
from hexmj.tipping import Pendulum
from hexmj.validate import choice, number, whole
from hexmj.walks import PlannedWalk

if TYPE_CHECKING:
    import xarray as xr

RANGE = 1600 * SAMPLE
"""Default number of starts in a cell, which takes one core seconds to minutes."""

STRIDE = Stride()

Planned = Literal["kinematic", "dynamic"]
"""Measures that need no body, see `tables.Measure`."""


def walk(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike | Command | Sequence[Command],
    duration: float,
    *,
    stride: Stride = STRIDE,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> PlannedWalk:
    """Return the planned walk of every start.

    Args:
        starts: tips at time 0, all standing, (start, leg) [mm].
        controller: controller that plans the walks.
        velocity: V_r, or its final value V_r* when accelerating; one number or (start,), 0 <= V_r < 1.
        duration: observation time [time units].
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        threads: number of threads, by default one per core; the result does not depend on it.

    Raises:
        InputError: a start, velocity or duration is out of range.
    """
    plan = begin(controller, starts, velocity, stride, acceleration, threads)
    return advanced(plan, int(steps_within(number("duration", duration), stride)))


def first_loss(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike | Command | Sequence[Command],
    duration: ArrayLike,
    *,
    stride: Stride = STRIDE,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Return the time of the first loss of static stability (Eq. 7), (start,) [time units]; inf without a loss.

    The arguments are those of `walk`; `duration` may also be (start,). The walks are not kept in memory.
    """
    plan = begin(controller, starts, velocity, stride, acceleration, threads)
    return _times(first_losses(plan, _steps(duration, plan.starts, stride), threads), stride)


class DynamicLosses(NamedTuple):
    """What each start loses in its planned walk; the walk is followed up to the loss of dynamic stability."""

    static: np.ndarray
    """(start,) time of the first loss of static stability (Eq. 7) [time units]; inf without a loss."""
    dynamic: np.ndarray
    """(start,) time of the loss of dynamic stability [time units]; inf without a loss."""
    excursion: np.ndarray
    """(start,) greatest excursion z of the pendulum [mm]; 0 without a loss of static stability."""


def dynamic_losses(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike | Command | Sequence[Command],
    duration: ArrayLike,
    *,
    conditions: Conditions = Conditions(),
    stride: Stride = STRIDE,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> DynamicLosses:
    """Return the first losses of static and of dynamic stability of planned walks, see `tipping`.

    Of the conditions only V_p and the standing height have an effect. The other arguments are those of `first_loss`.
    """
    plan = begin(controller, starts, velocity, stride, acceleration, threads)
    pendulum = Pendulum.of(conditions.standing_height, conditions.seconds(stride))
    losses = first_dynamic_losses(plan, _steps(duration, plan.starts, stride), pendulum, threads)
    return DynamicLosses(_times(losses.static, stride), _times(losses.dynamic, stride), losses.excursion)


def _steps(duration: ArrayLike, starts: np.ndarray, stride: Stride) -> np.ndarray:
    """Return the number of steps within the duration, () or (start,), after a check of its shape."""
    steps = steps_within(duration, stride)
    if steps.shape not in ((), (len(starts),)):
        raise InputError(f"duration has the shape {steps.shape}; expected one number or ({len(starts)},)")
    return steps


def _times(steps: np.ndarray, stride: Stride) -> np.ndarray:
    """Return the times at which steps end [time units]; inf for step 0."""
    return np.where(steps > 0, steps * stride.dt, np.inf)


@dataclass(frozen=True)
class KinematicFlss:
    """FLSS or FLDS of a controller's plan, with a cell for each velocity and range of the seed's random starts."""

    controller: Controller
    """Controller that plans the walks."""
    velocities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; the final velocities when accelerating."""
    n_starts: int = 7 * SAMPLE
    """Number N of random starts, the same for every velocity."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    seed: int = 0
    """Seed of the random starts."""
    stride: Stride = STRIDE
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11; without it the velocity is constant."""
    range_of: int = RANGE
    """Number of starts that one cell counts; the last cell may have fewer."""
    measure: Planned = "kinematic"
    """Count losses of static (kinematic) or of dynamic stability."""
    conditions: Conditions = Conditions()
    """Conditions of the dynamic measure, on which V_p and the standing height have an effect."""

    def __post_init__(self) -> None:
        settings_of(self.controller)  # raises InputError now rather than after the computation
        check_draw(self.n_starts, self.seed)
        choice("measure", self.measure, get_args(Planned))
        whole("range_of", self.range_of, 1, MOST_STARTS)
        _ = self.observed

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """The velocities V_r and their observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride, self.acceleration)

    def cells(self) -> list[Cell]:
        """Return a cell for each velocity and range of starts, computed by `losses_of_range`."""
        check_velocities(self.controller, self.velocities, self.stride, self.acceleration)
        cells = []
        for (v, duration), first in product(np.transpose(self.observed), range(0, self.n_starts, self.range_of)):
            count = min(self.range_of, self.n_starts - first)
            same = self.seed, self.conditions, self.stride, self.acceleration
            walks = WalkSettings(self.controller, v, duration, count, *same)
            settings = {"walks": walks, "first": first, "measure": self.measure}
            cells.append(Cell(f"{self.controller.name}-V-{v:g}-from-{first}", losses_of_range, settings, walks.work))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset that `flss` describes, from the datasets of all cells."""
        import xarray as xr

        losses = np.reshape([counted.losses.item() for counted in data], (len(self.velocities), -1)).sum(axis=1)
        low, high = wilson_intervals(losses, self.n_starts)
        name, kind = ("flds", "dynamic") if self.measure == "dynamic" else ("flss", "static")
        columns = {
            name: (losses / self.n_starts, f"frequency of the loss of {kind} stability"),
            "low": (low, "lower end of the 95 % Wilson interval"),
            "high": (high, "upper end of the 95 % Wilson interval"),
        }
        variables = {
            key: ("velocity", values, {"units": "1", "long_name": text}) for key, (values, text) in columns.items()
        }
        walks = self.observation_time, self.n_starts, self.seed, self.stride, self.acceleration
        made = {"study": "flss"} | settings({self.controller.name: self.controller}, *walks)
        if self.measure == "dynamic":
            made |= {"conditions": self.conditions.settings()}
        return xr.Dataset(variables).assign(velocity_axis(*self.observed)).assign_attrs(attributes(made))


def losses_of_range(
    walks: WalkSettings,
    first: int,
    measure: Planned = "kinematic",
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Count the `losses` of stability among `walks.n_starts` starts, of which the first has the index `first`."""
    import xarray as xr

    losses = 0
    how: Any = {"stride": walks.stride, "acceleration": walks.acceleration, "threads": threads}
    for x in draw_slabs(walks.n_starts, walks.seed, walks.stride, first):
        arguments = x, walks.controller, walks.velocity, walks.duration
        if measure == "dynamic":
            times = dynamic_losses(*arguments, conditions=walks.conditions, **how).dynamic
        else:
            times = first_loss(*arguments, **how)
        losses += np.count_nonzero(np.isfinite(times))
        if progress:
            progress(len(x) / walks.n_starts)
    return xr.Dataset({"losses": ((), losses, {"units": "1", "long_name": f"starts with a {measure} loss"})})


def flss(
    controller: Controller,
    velocities: Sequence[float] | float,
    *,
    n_starts: int = KinematicFlss.n_starts,
    observation_time: str | float = KinematicFlss.observation_time,
    seed: int = KinematicFlss.seed,
    stride: Stride = STRIDE,
    acceleration: Acceleration | None = None,
    range_of: int = RANGE,
    measure: Planned = "kinematic",
    conditions: Conditions = Conditions(),
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Return the kinematic FLSS, I_N^t of Eq. 9, at each velocity, over the same starts.

    Args:
        controller: controller that plans the walks.
        velocities: one or several V_r, each 0 <= V < 1; the final velocities when accelerating.
        n_starts: number of random starts.
        observation_time: 'walk', 'start' or a number of time units, see `timing.observation_duration`.
        seed: seed of the random starts.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        range_of: number of starts that are computed and cached together; the result does not depend on it.
        measure: 'kinematic', or 'dynamic' for the FLDS, the frequency of the loss of dynamic stability (`tipping`).
        conditions: V_p and standing height of the dynamic measure; the others have no effect.
        folder: directory in which finished cells are cached; None caches nothing.
        how: options of `sweep.Execution`, such as `executor` and `threads`; the result does not depend on them.

    Returns:
        Over velocity: `flss`, or `flds` for the dynamic measure; the ends `low` and `high` of its 95 % Wilson interval;
        and the observation time `duration` [time units].

    Raises:
        InputError: an argument is out of range.
    """
    several: Any = np.atleast_1d(velocities).tolist()
    walks = n_starts, observation_time, seed, stride, acceleration
    return run_study(KinematicFlss(controller, several, *walks, range_of, measure, conditions), folder, **how)


def flss_over_range(
    controller: Controller,
    low: float,
    high: float,
    *,
    n_starts: int = 7 * SAMPLE,
    observation_time: str | float = "walk",
    seed: int = 0,
    stride: Stride = STRIDE,
    threads: int | None = None,
) -> tuple[float, tuple[float, float]]:
    """Return the kinematic FLSS over a range of velocities, J_N^t of Eq. 10: each start has its own random velocity.

    Args:
        controller: controller that plans the walks.
        low: lowest velocity of the uniform range W, 0 <= V < 1, and above 0 with the observation time 'walk'.
        high: highest velocity of the range W.
        n_starts: number of random starts.
        observation_time: as for `flss`; 'walk' and 'start' depend on the velocity of each start.
        seed: seed of the random starts and velocities.
        stride: step range, lines of the tips and time step.
        threads: number of threads, by default one per core; the result does not depend on it.

    Returns:
        The frequency and its 95 % Wilson interval.

    Raises:
        InputError: an argument is out of range.
    """
    if not 0 <= number("low", low) <= number("high", high) < 1:
        raise InputError(f"velocity range {low} to {high}; expected 0 <= low <= high < 1")
    n_starts, seed = check_draw(n_starts, seed)
    observation_duration(observation_time, low, stride)  # raises at V = 0, whatever velocities are drawn
    rng, count = np.random.default_rng([seed, 1]), 0
    for x in draw_slabs(n_starts, seed, stride):
        v = rng.uniform(low, high, len(x))
        duration = observation_duration(observation_time, v, stride)
        count += int(np.isfinite(first_loss(x, controller, v, duration, stride=stride, threads=threads)).sum())
    return count / n_starts, wilson_interval(count, n_starts)
