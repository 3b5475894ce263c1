"""What Section 5 measures at one velocity: losses of stability, limit regimes, footfalls.

The outcome of every start is kept, so that curves can be compared on the same starts and samples of 1000 can be formed
afterwards.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.controllers.checked_plans import begin
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.gaits import limit_gait
from hexmj.legs import LEGS
from hexmj.measures.kinematic import first_loss
from hexmj.paper.late_losses import lost_after, lost_at_periods
from hexmj.phases import PAIRS
from hexmj.starts import draw_starts
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

NO_SET = -1
"""Stands for the outcome where no set has been searched yet."""

LATE_PERIODS = 5
"""Periods of a single leg oscillator, (AEP_0 - PEP_0) (1 + 1/V), after which Section 5.2 looks again."""

Looks = Literal["steps", "periods"]
"""It is looked for a loss of static stability after every step, or after every period of a single leg."""

MOMENTS = 1201
"""Of a footfall diagram."""


def losses(
    velocity: float,
    sets: tuple[Cruse1998 | None, ...],
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
    late: bool,
    looks: Looks = "steps",
    margin: float = 0.0,
    threads: int | None = None,
) -> "xr.Dataset":
    """Which starts lose static stability under both observation times, (observation time, start): 1 lost, 0 not, -1 where there is no set.

    Args, beside those of `WalkSettings`:
        sets: the network for each of `OBSERVATION_TIMES`.
        late: look only after `LATE_PERIODS`.
        looks: at every step, or once a period only.
        margin: by how much S is narrower than ]PEP_0, AEP_0[ at either end [mm].
    """
    import xarray as xr

    inner = replace(stride, pep0=stride.pep0 + margin, aep0=stride.aep0 - margin)
    starts = draw_starts(n_starts, seed, inner)
    lost = np.full((len(OBSERVATION_TIMES), n_starts), NO_SET, dtype=np.int8)
    for one in dict.fromkeys(filter(None, sets)):
        rows = [row for row, other in enumerate(sets) if other == one]
        times = [observation_duration(OBSERVATION_TIMES[row], np.array(velocity), stride, acceleration) for row in rows]
        durations = np.array(times)
        wait = stride.periods(velocity, LATE_PERIODS) if late else 0.0
        how: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
        if looks == "periods":
            lost[rows] = [lost_at_periods(starts, one, velocity, wait, time.item(), **how) for time in times]
        elif late:
            lost[rows] = lost_after(starts, one, velocity, wait, durations, stride=stride, threads=threads)
        else:
            first = first_loss(starts, one, velocity, durations.max(), **how)
            lost[rows] = first < (steps_within(durations, stride)[:, np.newaxis] + 0.5) * stride.dt
    return xr.Dataset({"lost": (("observation_time", "start"), lost)}, {"observation_time": list(OBSERVATION_TIMES)})


def limit_regimes(
    velocity: float,
    controller: Cruse1998,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Phases (start, pair), periods (start, leg) and what is true of each start's limit regime."""
    import xarray as xr

    how: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
    starts = draw_starts(n_starts, seed, stride)
    duration = observation_duration("walk", np.array(velocity), stride, acceleration)
    times = first_loss(starts, controller, velocity, duration, **how)
    gait = limit_gait(controller, velocity, n_starts=n_starts, seed=seed, **how)
    return xr.Dataset(
        {
            "phase": (("start", "pair"), gait.phase, {"units": "1"}),
            "periods": (("start", "leg"), gait.periods, {"units": "time unit"}),
            "duty_factor": (("start", "leg"), gait.duty_factor, {"units": "1"}),
            "reached": ("start", gait.reached, {"units": "time unit"}),
            "periodic": ("start", gait.periodic),
            "stable": ("start", gait.stable),
            "lost": ("start", np.isfinite(times), {"long_name": "static stability lost on the way"}),
        },
        {"pair": list(PAIRS), "leg": list(LEGS)},
    )


def footfalls(
    velocity: float,
    controller: Cruse1998,
    seed: int,
    stride: Stride,
    acceleration: Acceleration,
    threads: int | None = None,
) -> "xr.Dataset":
    """Stance (time, leg) of one start over three periods of its limit regime; time in periods of a single leg."""
    import xarray as xr

    start, period = draw_starts(1, seed, stride), stride.periods(velocity)
    plan = begin(controller, start, velocity, stride, acceleration, threads)
    settled = int(steps_within(acceleration.duration(velocity) + 10 * period, stride))
    while plan.done < settled:
        plan.advance(min(20_000, settled - plan.done))
    seen = plan.advance(int(steps_within(3 * period, stride))).stance[:, 0]
    time = np.linspace(0, 3, MOMENTS)
    return xr.Dataset(
        {"stance": (("time", "leg"), seen[np.round(time / 3 * (len(seen) - 1)).astype(int)])},
        {"time": ("time", time, {"units": "periods of a single leg"}), "leg": list(LEGS)},
    )
