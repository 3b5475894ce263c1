"""Every start is put on its six feet in MuJoCo and comes to rest before it walks."""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike

from hexmj.errors import InputError, SimulationError
from hexmj.network import checked_starts
from hexmj.parameters import Network
from hexmj.physics import insect
from hexmj.physics.body import Body
from hexmj.physics.clock import stopped_clock
from hexmj.physics.divergence import raise_if_diverged
from hexmj.physics.kinematics import tips_to_joints
from hexmj.physics.targets import standing_tips
from hexmj.threads import thread_count

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
    """(start, actuator) joint targets of the planned tips [rad], and the feet's adhesion where they grasp."""
    warmstart: np.ndarray
    """(start, 24) accelerations from which the solver goes on."""
    mujoco_model: mujoco.MjModel
    """The insect with the time step and the friction of the walk."""
    body: Body
    network: Network


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
    model = insect.load(body.seconds(network) / body.substeps(network), body, looks=False)
    tips = standing_tips(x, body, network)
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
    ctrl = np.ones((len(x), model.nu))
    ctrl[:, : insect.JOINT_ACTUATORS] = joints.reshape(len(x), -1)
    batch.bind("ctrl")[:] = ctrl
    before = {"qpos": qpos.copy(), "qvel": qvel.copy(), "qacc_warmstart": warmstart.copy(), "ctrl": ctrl[:, None]}
    sensordata, columns = batch.bind("sensordata"), insect.sensors(model)
    steps = max(1, round(body.settling_time / 1000.0 / model.opt.timestep))
    with stopped_clock():
        batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_ACC)
    raise_if_diverged(batch, np.arange(len(x)), 0.0, None, before)
    for name, failed in {
        "it still moves": np.linalg.norm(qvel[:, :3], axis=1) > AT_REST,
        "a foot is off the ground": (sensordata[:, columns.touch] <= 0).any(axis=1),
        "the trunk is on the ground": (sensordata[:, columns.trunk] > 0).any(axis=1),
    }.items():
        if failed.any():
            raise SimulationError(f"start {np.argmax(failed)} did not settle in {body.settling_time:g} ms: {name}")
    return Settled(x, qpos.copy(), qvel.copy(), ctrl, warmstart.copy(), model, body, network)
