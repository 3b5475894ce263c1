"""Physical walks: the insect follows a plan in MuJoCo, all starts at once on all cores.

Settled starts go in, what was measured comes out, stretch by stretch; a start whose trunk has touched the
ground is dropped.  In the open loop the plan goes on by itself: while MuJoCo's threads step one stretch, this
one plans the next and the caller measures the last.  `closed_loop` is the other way to walk.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from hexmj.network import steps_within
from hexmj.physics.clock import stopped_clock
from hexmj.physics.closed_loop import closed_loop
from hexmj.physics.joint_targets import JointTargets
from hexmj.physics.settling import Settled
from hexmj.physics.stretches import Insects, Push, Stretch
from hexmj.plans import Plan
from hexmj.progress import Progress

__all__ = ["Push", "Stretch", "drive"]


def drive(
    settled: Settled,
    plan: Plan,
    duration: float,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Stretch]:
    """Walk settled starts by a plan, stretch by stretch.

    Args:
        settled: starts at rest.
        plan: of the same starts, at time 0.
        duration: observation time [time units of the network].
        push: from the side.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Raises:
        InputError: with `Body.feedback`, a plan that cannot see.
        SimulationError: a simulation that diverged; its state is written for `divergence.replay`.
    """
    insects = Insects(settled, push, threads)
    loop = closed_loop if settled.body.feedback else _open_loop
    total = int(steps_within(duration, settled.network)) * settled.body.substeps(settled.network)
    told = 0.0
    with stopped_clock():
        for stretch in loop(insects, plan, duration):
            yield stretch
            if progress:
                done = 1.0 if stretch.fell.all() else min(1.0, (stretch.first + stretch.qpos.shape[1]) / total)
                progress(done - told)
                told = done


def _open_loop(insects: Insects, plan: Plan, duration: float) -> Iterator[Stretch]:
    """The plan goes on, whatever happens to the insects."""
    targets = JointTargets(insects.settled, plan, duration)
    now = targets.ahead(np.arange(len(insects.settled.starts)))
    with ThreadPoolExecutor(1) as stepper:
        stepping = now and stepper.submit(insects.obey, [now], len(now.plan.time))
        while now and stepping:
            ahead = targets.ahead(now.ids)
            stretch = stepping.result()
            now = ahead.only(~stretch.fell) if ahead and not stretch.fell.all() else None
            stepping = now and stepper.submit(insects.obey, [now], len(now.plan.time))
            yield stretch
