"""Loss of static stability after the beginning of a walk (paper, Section 5.2): has it come to a stable regime?"""

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.starts import checked_starts
from hexmj.timing import Acceleration, Stride, steps_within


def lost_after(
    starts: ArrayLike,
    controller: Cruse1998,
    velocity: float,
    wait: float,
    durations: ArrayLike,
    *,
    stride: Stride | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Whether each start is statically unstable within `durations` after the first `wait` of its walk.

    What happens before does not count.

    Args, beside those of `kinematic.walk`:
        controller: the network.
        wait: time that passes unseen, a step at least [time units].
        durations: observation times after it, (duration,) [time units].

    Returns:
        (duration, start)
    """
    stride = stride or Stride()
    x = checked_starts(starts, stride)
    plan = controller.begin(x, np.full(len(x), velocity), stride, threads=threads)
    unseen, seen = int(steps_within(wait, stride)), steps_within(durations, stride)
    first = plan.first_losses_after(unseen, int(seen.max()))
    return (first > 0) & (first <= unseen + seen[:, np.newaxis])


def lost_at_periods(
    starts: ArrayLike,
    controller: Cruse1998,
    velocity: float,
    wait: float,
    duration: float,
    *,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Whether each start, (start,), is statically unstable at the end of a period of a single leg.

    The periods, at V_r, are those that end within `duration` [time units] after the first `wait`, a whole number of
    them; other arguments as of `lost_after`.
    """
    x = checked_starts(starts, stride)
    plan = controller.begin(x, np.full(len(x), velocity), stride, acceleration, threads)
    period = int(steps_within(stride.periods(velocity), stride))
    ahead, lost = period * (1 + round(wait / stride.periods(velocity))), np.zeros(len(x), dtype=bool)
    for _ in range(int(steps_within(duration, stride)) // period):
        lost, ahead = plan.first_losses_after(ahead - 1, 1) > 0, period
    return lost
