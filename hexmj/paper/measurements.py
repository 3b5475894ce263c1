"""Measurements at one velocity: losses of stability, also after obstacles, and steady-state gaits.

Results hold every single start, so that curves can be compared on the same starts and divided into samples later.
All functions take the velocity V_r as a fraction of V_p, the seed and the number of the starts, the stride, the
acceleration of Eq. 11 (None: V_r from time 0 on), and the number of threads, by default one per core.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.controllers.planning import begin, first_losses, planned_losses
from hexmj.controllers.protocol import SteerableController
from hexmj.gaits import steady_state_gait
from hexmj.legs import LEGS
from hexmj.measures.kinematic import first_loss
from hexmj.phases import PAIRS
from hexmj.starts import draw_starts
from hexmj.tasks.disturbed import Disturbance, Disturbed, collect_postures, find_stable_starts
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

NO_SET = -1
"""Outcome of a start if the weight set has not been searched yet."""

LATE_PERIODS = 5
"""Number of periods of a single leg, (AEP_0 - PEP_0) (1 + 1/V), before late losses count (Section 5.2)."""

Answer = Literal["none", "positions", "postures", "slow down"]
"""Response to an obstacle (Section 6). 'positions': the tips go to the nearest posture of an undisturbed walk, and all
legs stand; 'postures': the legs also take the states of that posture; 'slow down': V drops, and Eq. 11 raises it."""


def losses(
    velocity: float,
    sets: tuple[Cruse1998 | None, ...],
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
    late: bool = False,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return whether each start loses stability, (observation time, start): 1 yes, 0 no, `NO_SET` without a weight set.

    Args:
        sets: the network for each of `OBSERVATION_TIMES`; None if it has not been searched yet.
        late: whether the observation time begins after `LATE_PERIODS` periods, instead of at time 0.
    """
    starts, at = draw_starts(n_starts, seed, stride), np.full(n_starts, velocity)
    lost = np.full((len(OBSERVATION_TIMES), n_starts), NO_SET, dtype=np.int8)
    unseen = int(steps_within(stride.periods(velocity, LATE_PERIODS), stride)) if late else 0
    for network in dict.fromkeys(filter(None, sets)):
        rows = [row for row, candidate in enumerate(sets) if candidate == network]
        times = [observation_duration(OBSERVATION_TIMES[row], velocity, stride, acceleration) for row in rows]
        seen = steps_within(times, stride)
        plan, longest = network.begin(starts, at, stride, acceleration, threads), int(seen.max())
        first = plan.losses_after(unseen, longest).static if late else first_losses(plan, longest, threads)
        lost[rows] = (first > 0) & (first <= unseen + seen[:, np.newaxis])
    return _lost(lost)


def _lost(lost: np.ndarray) -> "xr.Dataset":
    import xarray as xr

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
    """Return phases (start, pair), periods (start, leg) and further properties of each start's steady-state gait."""
    import xarray as xr

    how: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
    starts = draw_starts(n_starts, seed, stride)
    duration = observation_duration("walk", np.array(velocity), stride, acceleration)
    times = first_loss(starts, controller, velocity, duration, **how)
    gait = steady_state_gait(controller, velocity, n_starts=n_starts, seed=seed, **how)
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


def losses_after(
    velocity: float,
    controller: SteerableController,
    answer: Answer,
    n_starts: int,
    seed: int,
    stride: Stride,
    acceleration: Acceleration | None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Return whether each start loses stability after an obstacle, (observation time, start): 1 yes, 0 no.

    An obstacle is "the termination of motion. Then the motion is initiated from new leg positions" (Section 6): a halt
    in mid-stride. The observation time begins when the walk has reached its velocity again.

    Args:
        controller: a controller whose plans can be steered.
        answer: response to the obstacle.
        n_starts: number of starts that reach the obstacle: the first of the seed that are stable until then.
        acceleration: Eq. 11 for the answer 'slow down'; None for other answers.

    Raises:
        InputError: too few starts are stable until the obstacle, or no start has a stable gait that provides postures.
    """
    stable = find_stable_starts(controller, velocity, n_starts, seed, stride, grid=1)
    halt = Disturbance("halt", stable.step, stable.draw)
    postures = collect_postures(controller, velocity, seed, stride) if answer in ("positions", "postures") else None
    if postures and answer == "positions":
        postures = replace(postures, standing=np.ones_like(postures.standing))
    disturbed = Disturbed(controller, halt, postures, slows=acceleration is not None)

    ahead, plan = (begin(disturbed, stable.starts, velocity, stride, acceleration, threads) for _ in range(2))
    ahead.advance(int(halt.step.max()) + 1)
    resumed: np.ndarray = ahead.resumed  # pyright: ignore[reportAttributeAccessIssue]  # of DisturbedPlan
    back = resumed * stride.dt + (acceleration.duration(velocity) if acceleration else 0.0)
    steps = steps_within([back + observation_duration(time, velocity, stride) for time in OBSERVATION_TIMES], stride)
    first = planned_losses(plan, steps.max(axis=0), threads)
    return _lost(((first > 0) & (first <= steps)).astype(np.int8))
