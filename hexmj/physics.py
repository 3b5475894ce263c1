"""Physical walks: the insect follows the network's plan in MuJoCo, all starts at once on all cores.

Starts and targets go in, what was measured comes out.  `settle` lets every start come to rest, `drive`
then walks them stretch by stretch, and drops a start as soon as its trunk has touched the ground.  A
stretch shows the insect before each of its physics steps: what MuJoCo's sensors hold after a step
belongs to the state before it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numba import njit
from numpy.typing import ArrayLike

from hexmj import insect
from hexmj.body import Body
from hexmj.errors import InputError, SimulationError
from hexmj.kinematics import LegDimensions, tips_to_joints
from hexmj.network import NetworkRun, checked_starts, steps_within
from hexmj.parameters import Acceleration, Model, Network
from hexmj.progress import Progress
from hexmj.targets import TipTargets
from hexmj.threads import run_blocks, thread_count
from hexmj.walks import Walk

STRETCH = 40
"""Physics steps in a stretch, about: fewer cost more calls, more waste steps after a fall."""

AT_REST = 5.0
"""Speed of the root below which a start counts as settled [mm/s]."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Starts at rest in MuJoCo; the same for every model and velocity."""

    starts: np.ndarray
    """(start, leg) planned tips [mm]."""
    qpos: np.ndarray
    """(start, 25) positions."""
    qvel: np.ndarray
    """(start, 24) velocities."""
    ctrl: np.ndarray
    """(start, 18) joint targets of the planned tips [rad]."""
    warmstart: np.ndarray
    """(start, 24) accelerations from which the solver goes on."""
    mujoco_model: mujoco.MjModel
    """The insect with the time step and the friction of the walk."""
    body: Body
    network: Network


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


def settle(
    starts: ArrayLike, body: Body | None = None, network: Network | None = None, threads: int | None = None
) -> Settled:
    """Put the insect on its six feet at every start and let it come to rest.

    Args:
        starts: planned tips, (start, leg) [mm].
        body: conditions of the walk.
        network: constants of the plan.
        threads: one per core unless given.

    Raises:
        InputError: a start that the legs cannot reach.
        SimulationError: a start that does not settle: still moving, a foot off the ground, or the trunk on it.
    """
    body, network = body or Body(), network or Network()
    x = checked_starts(starts, network)
    model = insect.load(body.seconds(network) / body.substeps(network), body.friction)
    tips = np.stack([x + np.array(network.geometry.origin), np.broadcast_to(network.geometry.y, x.shape),
                     np.full(x.shape, -body.standing_height)], axis=-1)  # fmt: skip
    joints, reachable = tips_to_joints(tips, legs := insect.dimensions(model))
    if not reachable.all():
        start, leg = np.argwhere(~reachable)[0]
        raise InputError(
            f"start {start}, leg {leg + 1}: the tip at {x[start, leg]:.3g} mm is out of reach"
            f" at a standing height of {body.standing_height:g} mm"
        )
    batch = Batch(model, len(x), thread_count(threads))
    qpos, qvel, warmstart = batch.bind("qpos"), batch.bind("qvel"), batch.bind("qacc_warmstart")
    qpos[:, : insect.ROOT_QPOS] = (0.0, 0.0, body.standing_height + legs.foot, 1.0, 0.0, 0.0, 0.0)
    qpos[:, insect.ROOT_QPOS :] = joints.reshape(len(x), -1)
    ctrl = joints.reshape(len(x), -1)
    batch.bind("ctrl")[:] = ctrl
    before = {"qpos": qpos.copy(), "qvel": qvel.copy(), "qacc_warmstart": warmstart.copy(), "ctrl": ctrl[:, None]}
    sensordata, columns = batch.bind("sensordata"), insect.sensors(model)
    batch.step(nstep=max(1, round(body.settling_time / 1000.0 / model.opt.timestep)), stage=mujoco.mjtStage.mjSTAGE_ACC)
    _raise_if_diverged(batch, np.arange(len(x)), 0.0, None, before)
    for name, failed in {
        "it still moves": np.linalg.norm(qvel[:, :3], axis=1) > AT_REST,
        "a foot is off the ground": (sensordata[:, columns.touch] <= 0).any(axis=1),
        "the trunk is on the ground": (sensordata[:, columns.trunk] > 0).any(axis=1),
    }.items():
        if failed.any():
            raise SimulationError(f"start {np.argmax(failed)} did not settle in {body.settling_time:g} ms: {name}")
    return Settled(x, qpos.copy(), qvel.copy(), ctrl, warmstart.copy(), model, body, network)


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
        SimulationError: a simulation that diverged; its state is written for `replay`.
    """
    body, network, starts = settled.body, settled.network, settled.starts
    m, legs = body.substeps(network), insect.dimensions(settled.mujoco_model)
    plan = NetworkRun(starts, model, velocity, network=network, acceleration=acceleration, threads=threads)
    targets = TipTargets(starts, body, network)
    batch = Batch(settled.mujoco_model, len(starts), thread_count(threads))
    batch.bind("qpos")[:], batch.bind("qvel")[:] = settled.qpos, settled.qvel
    batch.bind("qacc_warmstart")[:] = settled.warmstart
    speeds = np.broadcast_to(np.asarray(velocity, dtype=float), len(starts))
    commands = settled.ctrl.reshape(-1, 6, 3).copy()
    columns = insect.sensors(settled.mujoco_model)
    unloaded = np.zeros((len(starts), 6), dtype=int)
    longest_gap = body.contact_gap / 1000.0 / settled.mujoco_model.opt.timestep
    total, ids = int(steps_within(duration, network)), np.arange(len(starts))
    while plan.done < total and len(ids):
        first = plan.done * m
        steps = min(max(1, STRETCH // m), total - plan.done)
        ahead = plan.advance(steps)
        joints, missed = _commands(targets.follow(ahead, ids, threads), legs, commands, ids, threads)
        if plan.done == total:  # one substep more shows the state at the end
            joints = np.concatenate([joints, joints[:, -1:]], axis=1)
        before = {name: batch.bind(name)[ids] for name in ("qpos", "qvel", "qacc_warmstart")}
        seen = batch.rollout(joints.shape[1], joints, record=("qpos", "sensordata", "actuator_force"), ids=ids)
        _raise_if_diverged(batch, ids, first / m * network.dt, speeds, before | {"ctrl": joints})
        standing = _standing(seen["sensordata"][:, :, columns.touch] > 0, unloaded, ids, longest_gap)
        touching = (seen["sensordata"][:, :, columns.trunk] > 0).any(axis=2)
        fell = touching.any(axis=1)
        valid = np.where(fell, np.argmax(touching, axis=1) + 1, touching.shape[1])
        qpos = np.concatenate([before["qpos"][:, None], seen["qpos"][:, :-1]], axis=1)
        yield Stretch(
            plan=ahead,
            first=first,
            ids=ids,
            qpos=qpos,
            sensors=seen["sensordata"],
            standing=standing,
            force=seen["actuator_force"],
            valid=valid,
            fell=fell,
            unreachable=np.where(np.arange(missed.shape[1]) < valid[:, None], missed, 0).sum(axis=1),
        )
        ids = ids[~fell]
        if progress:
            progress(steps / total)
    if progress:
        progress((total - plan.done) / total)


def replay(path: Path | str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A written state of divergence, ready to step: set ``data.ctrl`` from the file's `ctrl`, (substep, actuator)."""
    with np.load(path) as saved:
        model = insect.load(float(saved["timestep"]), float(saved["friction"]))
        data = mujoco.MjData(model)
        for name in ("qpos", "qvel", "qacc_warmstart"):
            getattr(data, name)[:] = saved[name]
    return model, data


def _commands(
    tips: np.ndarray, legs: LegDimensions, commands: np.ndarray, ids: np.ndarray, threads: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Joint targets (n, substep, actuator) [rad] and the number of tips out of reach, (n, substep).

    A leg whose tip is out of reach keeps its last angles; `commands`, (start, leg, joint), keeps them for
    the next stretch.
    """
    joints, missed = np.empty(tips.shape), np.zeros(tips.shape[:2], dtype=int)

    def work(begin: int, end: int) -> None:
        joints[begin:end], reachable = tips_to_joints(tips[begin:end], legs)
        missed[begin:end] = (~reachable).sum(axis=2)
        for i in begin + np.flatnonzero(missed[begin:end].any(axis=1)):
            _hold(joints[i], commands[ids[i]])

    run_blocks(work, len(ids), 64, threads)
    commands[ids] = joints[:, -1]
    return joints.reshape(*tips.shape[:2], -1), missed


def _hold(joints: np.ndarray, last: np.ndarray) -> None:
    """Replace missing angles, (substep, leg, joint), by those before them, at first by `last`."""
    for now in joints:
        missing = np.isnan(now)
        now[missing] = last[missing]
        last = now


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


def _raise_if_diverged(
    batch: Batch, ids: np.ndarray, time: float, speeds: np.ndarray | None, state: dict[str, np.ndarray]
) -> None:
    """A MuJoCo warning or a number that is not finite in one of `ids` ends everything; its state is written.

    `speeds` are the velocities V_r of all starts, none while they settle.
    """
    warned = batch.warning[ids, :, 1] > 0
    broken = ~np.isfinite(batch.bind("qpos")[ids]).all(axis=1)
    failed = np.flatnonzero(warned.any(axis=1) | broken)
    if len(failed) == 0:
        return
    i = failed[0]
    kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned[i])] or ["a state that is not finite"]
    path = Path(f"diverged-start-{ids[i]}.npz").resolve()
    when = "while settling" if speeds is None else f"while walking at V = {speeds[ids[i]]:g}"
    model = batch.model
    saved = {name: values[i] for name, values in state.items()}
    try:
        np.savez(path, allow_pickle=False, **saved, timestep=model.opt.timestep, friction=model.geom_friction[0, 0])
        written = f"its last good state is in {path} (hexmj.physics.replay)"
    except OSError as error:
        written = f"its last good state could not be written to {path}: {error.strerror}"
    raise SimulationError(f"start {ids[i]} diverged {when}, at {time:.4g} time units: {', '.join(kinds)}; {written}")
