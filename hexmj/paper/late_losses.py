"""Loss of static stability after the beginning of a walk (paper, Section 5.2): has it come to a stable regime?"""

import numpy as np
from numpy.typing import ArrayLike

from hexmj.network import NetworkRun, steps_within
from hexmj.parameters import Model, Network


def lost_after(
    starts: ArrayLike,
    model: Model,
    velocity: float,
    wait: float,
    durations: ArrayLike,
    *,
    network: Network | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Whether each start is statically unstable within `durations` after the first `wait` of its walk.

    What happens before does not count.

    Args:
        starts: tips at time 0, all standing, (start, leg) [mm].
        model: coupling weights.
        velocity: V_r, 0 <= V < 1.
        wait: time that passes unseen [time units].
        durations: observation times after it, (duration,) [time units].
        network: the constants that the paper leaves out.
        threads: one per core unless given.

    Returns:
        (duration, start)
    """
    run = NetworkRun(starts, model, velocity, network=network, threads=threads)
    unseen, seen = int(steps_within(wait, run.network)), steps_within(durations, run.network)
    first = run.first_losses(unseen, int(seen.max()))
    return (first > 0) & (first <= unseen + seen[:, np.newaxis])
