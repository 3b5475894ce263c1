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
from numpy.typing import ArrayLike

from hexmj.network import NetworkRun
from hexmj.parameters import Acceleration, Model
from hexmj.physics import insect
from hexmj.physics.clock import stopped_clock
from hexmj.physics.divergence import raise_if_diverged
from hexmj.physics.joint_targets import JointTargets, Orders
from hexmj.physics.settling import Settled
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
    """(n, substep, actuator) torques of the joints [g mm^2/s^2]."""
    valid: np.ndarray
    """(n,) substeps up to the fall, that one included."""
    fell: np.ndarray
    """(n,) whether the trunk touched the ground."""
    unreachable: np.ndarray
    """(n,) targets out of reach."""


def drive(
    settled: Settled,
    model: Model,
    velocity: ArrayLike,
    duration: float,
    *,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Stretch]:
    """Walk settled starts, stretch by stretch; the arguments are those of `network.walk`.

    Raises:
        SimulationError: a simulation that diverged; its state is written for `divergence.replay`.
    """
    network = settled.network
    plan = NetworkRun(settled.starts, model, velocity, network=network, acceleration=acceleration, threads=1)
    targets = JointTargets(settled, plan, duration)
    batch = Batch(settled.mujoco_model, len(settled.starts), thread_count(threads))
    batch.bind("qpos")[:], batch.bind("qvel")[:] = settled.qpos, settled.qvel
    batch.bind("qacc_warmstart")[:] = settled.warmstart
    columns = insect.sensors(settled.mujoco_model)
    unloaded = np.zeros((len(settled.starts), 6), dtype=int)
    longest_gap = settled.body.contact_gap / 1000.0 / settled.mujoco_model.opt.timestep

    def step(orders: Orders) -> tuple[np.ndarray, dict[str, Any]]:
        """Positions before the stretch, (n, 25), and what MuJoCo records in it."""
        ids = orders.ids
        before = {name: batch.bind(name)[ids] for name in ("qpos", "qvel", "qacc_warmstart")}
        record = ("qpos", "sensordata", "actuator_force")
        seen = batch.rollout(orders.joints.shape[1], orders.joints, record=record, ids=ids)
        time, speed = orders.plan.time[0] - network.dt, orders.plan.velocity[0]
        raise_if_diverged(batch, ids, time, speed, before | {"ctrl": orders.joints})
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
                force=seen["actuator_force"],
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
