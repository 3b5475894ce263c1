"""Physical walks: the insect follows the network's plan in MuJoCo, all starts at once on all cores.

Settled starts go in, what was measured comes out, stretch by stretch; a start whose trunk has touched the
ground is dropped.  While MuJoCo's threads step one stretch, this one plans the next and the caller measures
the last.  A stretch shows the insect before each of its physics steps: what MuJoCo's sensors hold after a
step belongs to the state before it.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from mujoco.batch import Batch
from numba import njit

from hexmj.physics import insect
from hexmj.physics.clock import stopped_clock
from hexmj.physics.divergence import raise_if_diverged
from hexmj.physics.joint_targets import JointTargets, Orders
from hexmj.physics.settling import Settled
from hexmj.plans import Plan
from hexmj.progress import Progress
from hexmj.threads import thread_count
from hexmj.walks import Walk


@dataclass(frozen=True, eq=False)
class Stretch:
    """What some physics steps of the starts that still walk have shown."""

    plan: Walk
    """The plan over the stretch, of all starts."""
    first: int
    """Index of the first substep shown."""
    ids: np.ndarray
    """(n,) which starts these are."""
    qpos: np.ndarray
    """(n, substep, 25)."""
    sensors: np.ndarray
    """(n, substep, column), see `insect.Sensors`."""
    standing: np.ndarray
    """(n, substep, leg) whether the ground carried the foot within the last `Body.contact_gap`."""
    force: np.ndarray
    """(n, substep, joint) torques of the joints [g mm^2/s^2]."""
    valid: np.ndarray
    """(n,) substeps up to the fall, that one included."""
    fell: np.ndarray
    """(n,) whether the trunk touched the ground."""
    unreachable: np.ndarray
    """(n,) targets out of reach."""


@dataclass(frozen=True, eq=False)
class Push:
    """A push from the side at the root, for each start; it lasts one stretch, `push_time`."""

    impulse: np.ndarray
    """(start,) to the left [g mm/s]."""
    time: np.ndarray
    """(start,) when it begins, rounded down to the beginning of a stretch [time units]."""


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
        SimulationError: a simulation that diverged; its state is written for `divergence.replay`.
    """
    network = settled.network
    targets = JointTargets(settled, plan, duration)
    batch = Batch(settled.mujoco_model, len(settled.starts), thread_count(threads))
    batch.bind("qpos")[:], batch.bind("qvel")[:] = settled.qpos, settled.qvel
    batch.bind("qacc_warmstart")[:] = settled.warmstart
    columns, root = insect.sensors(settled.mujoco_model), settled.mujoco_model.body("mesothorax").id
    unloaded = np.zeros((len(settled.starts), 6), dtype=int)
    longest_gap = settled.body.contact_gap / 1000.0 / settled.mujoco_model.opt.timestep

    def step(orders: Orders) -> tuple[np.ndarray, dict[str, Any]]:
        """Positions before the stretch, (n, 25), and what MuJoCo records in it."""
        ids = orders.ids
        before = {name: batch.bind(name)[ids] for name in ("qpos", "qvel", "qacc_warmstart")}
        time, speed = orders.plan.time[0] - network.dt, orders.plan.velocity[0]
        if push:
            now = (push.time >= time - 1e-9) & (push.time < time + len(orders.plan.time) * network.dt - 1e-9)
            seconds = len(orders.plan.time) * settled.body.seconds(network)
            batch.bind("xfrc_applied")[:, root, 1] = np.where(now, push.impulse / seconds, 0.0)
        record = ("qpos", "sensordata", "actuator_force")
        seen = batch.rollout(orders.control.shape[1], orders.control, record=record, ids=ids)
        raise_if_diverged(batch, settled.body, ids, time, speed, before | {"ctrl": orders.control})
        return before["qpos"], seen

    with stopped_clock(), ThreadPoolExecutor(1) as stepper:
        now = targets.ahead(np.arange(len(settled.starts)))
        stepping = now and stepper.submit(step, now)
        while now and stepping:
            ahead = targets.ahead(now.ids)
            before, seen = stepping.result()
            touching = (seen["sensordata"][:, :, columns.trunk] > 0).any(axis=2)
            fell = touching.any(axis=1)
            following = ahead.only(~fell) if ahead and not fell.all() else None
            stepping = following and stepper.submit(step, following)
            valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
            yield Stretch(
                plan=now.plan,
                first=now.first,
                ids=now.ids,
                qpos=np.concatenate([before[:, None], seen["qpos"][:, :-1]], axis=1),
                sensors=seen["sensordata"],
                standing=_standing(seen["sensordata"][:, :, columns.touch] > 0, unloaded, now.ids, longest_gap),
                force=seen["actuator_force"][:, :, : insect.JOINT_ACTUATORS],
                valid=valid,
                fell=fell,
                unreachable=np.where(np.arange(now.missed.shape[1]) < valid[:, None], now.missed, 0).sum(axis=1),
            )
            if progress:
                done = following.first / targets.total if following else 1.0
                progress(done - now.first / targets.total)
            now = following


@njit(cache=True, nogil=True)
def _standing(touches: Any, unloaded: Any, ids: Any, longest_gap: float) -> Any:
    """Which feet stand, (n, substep, leg); `unloaded`, (start, leg), counts the substeps since they last touched."""
    standing = np.empty(touches.shape, dtype=np.bool_)
    for i, start in enumerate(ids):
        for t in range(touches.shape[1]):
            for leg in range(6):
                unloaded[start, leg] = 0 if touches[i, t, leg] else unloaded[start, leg] + 1
                standing[i, t, leg] = unloaded[start, leg] <= longest_gap
    return standing
