"""Loss of static stability after the beginning of a walk (paper, Section 5.2): has it come to a stable regime?"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from hexmj import lanes
from hexmj.network import NetworkRun, steps_within
from hexmj.parameters import Model, Network
from hexmj.threads import run_blocks


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
    blocks, (order, p, k) = run._blocks, run._settings

    def work(begin: int, end: int) -> None:
        _first_losses_after(blocks[begin:end], unseen, int(seen.max()), order, p, k)

    run_blocks(work, len(blocks), 1, threads)
    first = blocks.reshape(len(blocks), lanes.ROWS, lanes.LANES)[:, lanes.LOST].ravel()[: len(run._starts)]
    return (first > 0) & (first <= unseen + seen[:, np.newaxis])


@njit(cache=True, nogil=True)
def _first_losses_after(blocks: Any, unseen: int, seen: int, order: int, p: Any, k: Any) -> None:
    """Step every block on, and note in its row `LOST` the first loss of each lane after the `unseen` steps."""
    for b in range(len(blocks)):
        z = blocks[b]
        for n in range(unseen + seen):
            if n == unseen:
                z[lanes.STEPS * lanes.LANES : (lanes.STEPS + 1) * lanes.LANES] = unseen + seen  # before, none counts
            lanes._step(z, order, p, k)
