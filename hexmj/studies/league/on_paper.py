"""What the league asks of a plan: losses of static stability, and the limit regime."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.controllers.leg_lost import LegLost
from hexmj.gaits import limit_gait
from hexmj.measures.frequency import over_start
from hexmj.measures.kinematic import first_loss
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_mean
from hexmj.starts import draw_starts
from hexmj.studies.league.entrant import Entrant
from hexmj.timing import Acceleration, Stride, observation_duration

if TYPE_CHECKING:
    import xarray as xr


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
    """Whether each start loses static stability on paper, `lost`, over start.

    Args, beside those of `WalkSettings`:
        entrant: who walks.
        observation_time: 'walk', 'start' or the observation time [time units]; a number, too, from when on V_r is reached.
        leg_lost: index of a leg that is lost.
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
    """The same where every start has a velocity of its own, uniform from `low` to `high` (Eq. 10)."""
    velocity = np.random.default_rng([seed, 1]).uniform(low, high, n_starts)
    duration = observation_duration(observation_time, velocity, stride)
    starts = draw_starts(n_starts, seed, stride)
    return _lost(first_loss(starts, entrant.controller, velocity, duration, stride=stride, threads=threads))


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
    """The limit regime of each start, over start; arguments as of `gaits.limit_gait`.

    Returns:
        `reached`, from when on it lasts [time units], inf where there is none; whether it is `stable`; and, NaN where
        there is none, the `duty_factor` and the phases `ipsilateral` and `contralateral`, circular means over legs and
        pairs.
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


def _lost(time: np.ndarray) -> "xr.Dataset":
    return over_start({"lost": np.isfinite(time).astype(np.int8)})
