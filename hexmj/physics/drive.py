"""Physical walks: the insect follows a plan in MuJoCo, all starts at once on all cores.

Settled starts go in, what was measured comes out, chunk by chunk; a start whose trunk has touched the ground is
dropped.  A plan that reads the legs is told of them before each of its steps.  Any other goes on by itself: while
MuJoCo's threads step one chunk, this one plans the next, of one insect the next eight, and the caller measures the
last.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from hexmj.controllers.checked_plans import tell
from hexmj.controllers.protocol import FeedbackPlan, Plan
from hexmj.physics.chunks import Chunk, Insects
from hexmj.physics.orders import Orders, OrdersFromPlan
from hexmj.physics.pushes import Push
from hexmj.physics.settling import Settled
from hexmj.progress import Progress
from hexmj.timing import steps_within

__all__ = ["Chunk", "Push", "drive"]


def drive(
    settled: Settled,
    plan: Plan,
    duration: float,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Chunk]:
    """Walk settled starts by a plan, chunk by chunk.

    Args:
        settled: starts at rest.
        plan: of the same starts, at time 0.
        duration: observation time [time units].
        push: from the side.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Raises:
        InputError: a plan of other starts, with another stride, not at time 0, or of other shapes than asked for; a
            push beside the observation time.
        SimulationError: a simulation that diverged; it carries its last good state.
        StillThrown: the observation time ends before a push is over, after the last chunk.
    """
    if push:
        push.check_within(duration, settled.conditions, settled.stride, len(settled.starts))
    divisor = push.divisor(settled.conditions, settled.stride) if push else 0
    insects, orders = Insects(settled, push, threads), OrdersFromPlan(settled, plan, duration, divisor)
    total = int(steps_within(duration, settled.stride)) * settled.substeps
    told, walking = 0.0, np.arange(len(settled.starts))
    for chunk in _reading(insects, plan, orders) if isinstance(plan, FeedbackPlan) else _by_itself(insects, orders):
        yield chunk
        if progress:
            done = 1.0 if chunk.fell.all() else min(1.0, (chunk.first + chunk.qpos.shape[1]) / total)
            progress(done - told)
            told = done
        walking = chunk.ids[~chunk.fell]
    insects.check_landed(walking)


def _by_itself(insects: Insects, orders: OrdersFromPlan) -> Iterator[Chunk]:
    """The plan goes on, whatever happens to the insects."""
    now = orders.ahead(np.arange(len(insects.settled.starts)))
    with ThreadPoolExecutor(1) as stepper:
        stepping = now and stepper.submit(insects.carry_out, [now])
        while now and stepping:
            ahead = orders.ahead(now.ids)
            chunk = stepping.result()
            now = ahead.only(~chunk.fell) if ahead and not chunk.fell.all() else None
            stepping = now and stepper.submit(insects.carry_out, [now])
            yield chunk


def _reading(insects: Insects, plan: FeedbackPlan, orders: OrdersFromPlan) -> Iterator[Chunk]:
    """The plan is told what the insects know before each of its steps."""
    ids = np.arange(len(insects.settled.starts))
    while len(ids) and (steps := orders.steps_ahead()):
        chunk = insects.carry_out(_step_by_step(insects, plan, orders, ids, steps))
        yield chunk
        ids = ids[~chunk.fell]


def _step_by_step(
    insects: Insects, plan: FeedbackPlan, orders: OrdersFromPlan, ids: np.ndarray, steps: int
) -> Iterator[Orders]:
    """Orders for one step after the other, each made from what the last one has brought about."""
    for _ in range(steps):
        tell(plan, insects.sensed(ids))
        if now := orders.ahead(ids, steps=1):
            yield now
