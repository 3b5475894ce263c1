"""Cells of the league: kinematic losses and steady-state gaits, and physical walks with their costs and trials."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.planning import begin, check_repeats
from hexmj.controllers.protocol import Controller
from hexmj.controllers.wrappers import LegLost
from hexmj.errors import OutOfReach, SimulationError, StillThrown
from hexmj.gaits import limit_gait
from hexmj.measures.cells import UNITS
from hexmj.measures.kinematic import first_loss
from hexmj.measures.tables import happened, over_start
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_mean
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import Case, StableWalks, TooFewStable
from hexmj.studies.entrants import Entrant
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

REFUSALS = OutOfReach, SimulationError, StillThrown
"""Errors of a walk that has no outcome."""

EFFORT = {"work": "mm", "torque": "1", "way": "mm"}
"""Columns beside the outcomes, and their units."""

DISTURBED = {"time": "time unit", "fall": "time unit"}
"""Columns of disturbed walks, and their units."""


def losses(
    entrant: Entrant,
    velocity: float,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None = None,
    leg_lost: int | None = None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return whether each start loses static stability in its planned walk, `lost`, over start.

    Args:
        entrant: plans the walks.
        velocity: V_r, or its final value.
        observation_time: 'walk', 'start' or a number [time units]; when accelerating, counted from V_r on.
        n_starts: number of starts.
        seed: of the starts.
        stride: of the plans.
        acceleration: Eq. 11.
        leg_lost: index of a lost leg.
        threads: by default one per core.
    """
    controller = entrant.controller if leg_lost is None else LegLost(entrant.controller, leg_lost)
    starts = entrant.starts(n_starts, seed, velocity, stride)
    duration = float(observation_duration(observation_time, velocity, stride))
    duration += acceleration.duration(velocity) if acceleration else 0.0
    how = {"stride": stride, "acceleration": acceleration, "threads": threads}
    return _lost(first_loss(starts, controller, velocity, duration, **how))


def losses_over_range(
    entrant: Entrant,
    low: float,
    high: float,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    stride: Stride,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return what `losses` does, with a velocity for each start, uniform from `low` to `high` (Eq. 10)."""
    velocity = np.random.default_rng([seed, 1]).uniform(low, high, n_starts)
    duration = observation_duration(observation_time, velocity, stride)
    starts = draw_starts(n_starts, seed, stride)
    return _lost(first_loss(starts, entrant.controller, velocity, duration, stride=stride, threads=threads))


def _lost(time: np.ndarray) -> "xr.Dataset":
    return over_start({"lost": np.isfinite(time).astype(np.int8)})


def regimes(
    entrant: Entrant,
    velocity: float,
    *,
    n_starts: int,
    periods: int,
    seed: int,
    stride: Stride,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return the steady-state gait of each start; arguments are those of `gaits.limit_gait`.

    Returns:
        Over start: `reached`, the time from which on the gait lasts [time units], or inf; whether it is `stable`; and,
        NaN without a gait, the `duty_factor` and the phases `ipsilateral` and `contralateral`, as circular means.
    """
    how = {"seed": seed, "stride": stride, "periods": periods, "threads": threads}
    gait = limit_gait(entrant.controller, velocity, n_starts=n_starts, **how)
    columns = {
        "reached": gait.reached,
        "stable": gait.stable.astype(np.int8),
        "duty_factor": gait.duty_factor.mean(axis=1),
        "ipsilateral": circular_mean(gait.phase[:, IPSILATERAL], axis=1),
        "contralateral": circular_mean(gait.phase[:, CONTRALATERAL], axis=1),
    }
    return over_start(columns, {"reached": "time unit"})


def walks(
    entrant: Entrant,
    controller: Controller,
    velocity: float,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return the outcome of every physical walk.

    Args:
        entrant: whose starts are walked.
        controller: the entrant's own, or a changed one.
        velocity: V_r.
        observation_time: 'walk', 'start' or a number [time units].
        n_starts: number of starts.
        seed: of the starts.
        conditions: of the walks.
        stride: of the plans.
        threads: by default one per core.

    Returns:
        Over start: all `Outcomes`; the `work` of the joints over the insect's weight [mm] and the greatest `torque`
        over its limit, see `EffortSoFar`; the `way` walked ahead [mm]. NaN for walks that fail, see `unless_refused`.

    Raises:
        SimulationError: none of the random starts comes to rest, whoever walks.
    """
    from hexmj.physics.outcomes import EffortSoFar, Outcomes, OutcomesSoFar
    from hexmj.physics.rollout import drive
    from hexmj.physics.settle import settle

    starts = entrant.starts(n_starts, seed, velocity, stride)
    duration = float(observation_duration(observation_time, velocity, stride))
    steps = int(steps_within(duration, stride))
    columns = {field.name: UNITS.get(field.name, "1") for field in fields(Outcomes)} | EFFORT

    def walked(which: np.ndarray) -> "xr.Dataset":
        some = starts[which]
        check_repeats(controller, some, velocity, steps, stride)
        settled = settle(some, conditions, stride, threads)
        lost = first_loss(some, controller, velocity, duration, stride=stride, threads=threads)
        so_far, effort = OutcomesSoFar(settled, lost), EffortSoFar(settled)
        for chunk in drive(settled, begin(controller, some, velocity, stride), duration, threads=threads):
            so_far.add(chunk)
            effort.add(chunk)
        outcomes = so_far.outcomes()
        costs = {"work": effort.work / settled.compiled.weight, "torque": effort.torque}
        commanded = np.minimum(outcomes.fall, steps * stride.dt) * velocity
        return over_start(vars(outcomes) | costs | {"way": commanded * outcomes.speed}, columns)

    found = unless_refused(walked, len(starts), columns)
    if found.fall.isnull().all():
        _check_settles(draw_starts(n_starts, seed, stride), conditions, stride, threads)
    return found


def unless_refused(
    walked: Callable[[np.ndarray], "xr.Dataset"], n_starts: int, columns: Mapping[str, str]
) -> "xr.Dataset":
    """Return the outcomes of all starts, with NaN for walks that fail.

    A walk fails if it diverges, its tips are out of reach, or a push still acts at the end of the observation time.

    Args:
        walked: walks some of the starts, (n,); the outcome of a start must not depend on the others.
        n_starts: number of all starts.
        columns: columns of the outcomes, and their units.
    """
    import xarray as xr

    everyone = np.arange(n_starts)
    with suppress(*REFUSALS):
        return walked(everyone)
    nothing = xr.Dataset({name: ("start", [np.nan], {"units": units}) for name, units in columns.items()})
    alone: list[xr.Dataset] = []
    for start in everyone[:, np.newaxis]:
        try:
            alone.append(walked(start))
        except REFUSALS:
            alone.append(nothing)
    return xr.concat(alone, "start")


def _check_settles(starts: np.ndarray, conditions: Conditions, stride: Stride, threads: int | None) -> None:
    """Raise the first error if no start comes to rest."""
    from hexmj.physics.settle import settle

    failed = []
    for start in starts:
        try:
            settle(start[np.newaxis], conditions, stride, threads)
            return
        except SimulationError as error:
            failed.append(error)
    raise failed[0]


def disturbed(
    entrant: Entrant,
    velocity: float,
    case: Case,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    grid: int,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return whether disturbed starts `fell`, over start: 1 or 0.

    NaN if too few starts are stable until the disturbance, the insect fell before it, or the walk fails. Arguments are
    those of `StableWalks`.
    """
    stable = StableWalks(entrant.controller, velocity, n_starts, seed, stride, grid)
    how = case, float(observation_duration(observation_time, velocity, stride)), None, conditions, threads
    try:
        times = unless_refused(lambda which: stable.times(*how, which)[[*DISTURBED]], n_starts, DISTURBED)
    except TooFewStable:
        return over_start({"fell": np.full(n_starts, np.nan)})
    fell = happened(times.fall).where(~(times.fall <= times.time))
    return over_start({"fell": fell.values})
