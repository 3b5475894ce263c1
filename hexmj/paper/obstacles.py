"""What an obstacle does to a walk, and the answers to it that a plan can give (paper, Section 6).

An obstacle is "the termination of motion. Then the motion is initiated from new leg positions".
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from hexmj.controllers.checked_plans import begin
from hexmj.controllers.losses import planned_losses
from hexmj.controllers.protocol import SteerableController
from hexmj.studies.disturbed_walks import Disturbed, DisturbedPlan, collect_postures, disturbance_of, find_stable_starts
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

Answer = Literal["none", "positions", "postures", "slow down"]
"""None; legs to the nearest of a small set of positions of undisturbed walking, where all of them stand, or take over
the states of that posture too; a superior level lowers V, and Eq. 11 brings it back."""


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
    """Which starts lose static stability after a halt in mid-stride, (observation time, start): 1 lost, 0 not.

    A observation time begins when the walk is at its velocity again.

    Args, beside those of `WalkSettings`:
        answer: to the obstacle.
        n_starts: starts that reach it, the first of the seed's that are stable until then.
        seed: of the starts and of the times of the obstacle.
        acceleration: Eq. 11, of the answer 'slow down'; None with any other.

    Raises:
        InputError: too few starts are stable so long, or none comes to a stable gait whose postures could be taken.
    """
    import xarray as xr

    stable = find_stable_starts(controller, velocity, n_starts, seed, stride, grid=1)
    halt = disturbance_of(stable, "halt", controller, velocity, stride)
    postures = collect_postures(controller, velocity, seed, stride) if answer in ("positions", "postures") else None
    if postures and answer == "positions":
        postures = replace(postures, standing=np.ones_like(postures.standing))
    disturbed = Disturbed(controller, halt, postures, slows=acceleration is not None)

    def plan() -> DisturbedPlan:
        begun = begin(disturbed, stable.starts, velocity, stride, acceleration, threads)
        return begun  # pyright: ignore[reportReturnType]

    ahead = plan()
    ahead.advance(int(halt.step.max()) + 1)
    back = ahead.resumed * stride.dt + (acceleration.duration(velocity) if acceleration else 0.0)
    observation_times = [
        back + observation_duration(observation_time, velocity, stride) for observation_time in OBSERVATION_TIMES
    ]
    steps = steps_within(observation_times, stride)
    first = planned_losses(plan(), steps.max(axis=0), threads)
    lost = ((first > 0) & (first <= steps)).astype(np.int8)
    return xr.Dataset({"lost": (("observation_time", "start"), lost)}, {"observation_time": list(OBSERVATION_TIMES)})
