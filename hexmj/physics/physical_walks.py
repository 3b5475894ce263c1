"""Physical walks from start to end: `physical_walk` keeps them whole, `physical_outcomes` only how they went."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.network import NetworkRun, first_loss, walk
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.physics.drive import Push, drive
from hexmj.physics.measurement import Outcomes, Tally, measured_walk
from hexmj.physics.settling import Settled, settle
from hexmj.plans import Plan
from hexmj.progress import Progress
from hexmj.stability import loss_time
from hexmj.walks import Walk


@dataclass(frozen=True, eq=False)
class PhysicalWalk:
    """Physical walks kept whole.  After a fall everything measured is NaN, and no foot stands."""

    planned: Walk
    """What the network planned; with `Body.feedback`, what it plans by itself."""
    measured: Walk
    """What the insect did: feet in contact, seen from its own centre of mass and heading."""
    outcomes: Outcomes
    """How every start went."""
    qpos: np.ndarray
    """(step, start, 25) MuJoCo's positions at the end of each step of the network."""
    centre_of_mass: np.ndarray
    """(step, start, 3) in the world [mm]."""
    body: Body
    """Conditions of the walk."""
    network: Network
    """Constants of the plan."""


def physical_outcomes(
    settled: Settled,
    model: Model,
    velocity: ArrayLike,
    duration: float,
    *,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """How every settled start goes; only outcomes are kept.

    The planned loss is always that of the network by itself, so that it stays the paper's measure, and the same
    with and without `Body.feedback`.

    Args:
        settled: starts at rest, see `settling.settle`.
        model: coupling weights.
        velocity: V_r, or its final value; one number or (start,).
        duration: observation time [time units of the network].
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Raises:
        InputError, SimulationError: see `drive.drive`.
    """
    conditions: Any = {"network": settled.network, "acceleration": acceleration}
    plan = NetworkRun(settled.starts, model, velocity, **conditions, threads=1)
    planned_loss = first_loss(settled.starts, model, velocity, duration, **conditions, threads=threads)
    return outcomes_of_plan(settled, plan, duration, planned_loss, threads=threads, progress=progress)


def outcomes_of_plan(
    settled: Settled,
    plan: Plan,
    duration: float,
    planned_loss: np.ndarray,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """The same for any plan that is at time 0, whose own losses, (start,) [time units], are known."""
    tally = Tally(settled, planned_loss)
    for stretch in drive(settled, plan, duration, push=push, threads=threads, progress=progress):
        tally.add(stretch)
    return tally.outcomes()


def physical_walk(
    starts: ArrayLike,
    model: Model,
    velocity: ArrayLike,
    duration: float,
    *,
    body: Body | None = None,
    vp: float | None = None,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> PhysicalWalk:
    """The physical walk of every start, kept whole.

    Args:
        starts: tips at time 0, (start, leg) [mm]; all feet stand.
        model: coupling weights.
        velocity: V_r, or its final value; one number or (start,).
        duration: observation time [time units of the network].
        body: conditions of the walk.
        vp: V_p [mm/s], short for a body with this velocity.
        network: constants of the plan.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Raises:
        InputError, SimulationError: see `settling.settle` and `drive.drive`.
    """
    body = body or Body() if vp is None else replace(body or Body(), vp=vp)
    conditions: Any = {"network": network or Network(), "acceleration": acceleration}
    planned = walk(starts, model, velocity, duration, **conditions, threads=threads)
    plan = NetworkRun(starts, model, velocity, **conditions, threads=1)
    settled = settle(starts, body, plan.network, threads)
    return physical_walk_of_plan(settled, plan, planned, threads=threads, progress=progress)


def physical_walk_of_plan(
    settled: Settled,
    plan: Plan,
    planned: Walk,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> PhysicalWalk:
    """The same for any plan that is at time 0, which goes as `planned`."""
    body, network = settled.body, settled.network
    tally = Tally(settled, loss_time(planned, threads=threads))
    shape = planned.stance.shape
    x, y, stance = np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=bool)
    qpos, centre = np.full((*shape[:2], settled.qpos.shape[1]), np.nan), np.full((*shape[:2], 3), np.nan)
    for stretch in drive(settled, plan, float(planned.time[-1]), push=push, threads=threads, progress=progress):
        tally.add(stretch)
        columns, seen, seen_centre = measured_walk(stretch, settled)
        at = np.ix_((stretch.first + columns) // body.substeps(network) - 1, stretch.ids)
        x[at], y[at], stance[at], centre[at] = seen.x, seen.y, seen.stance, seen_centre
        over = (columns[:, None] >= stretch.valid)[..., None]
        qpos[at] = np.where(over, np.nan, stretch.qpos[:, columns].swapaxes(0, 1))
    measured = Walk(planned.time, planned.velocity, x, y, stance, network.geometry)
    return PhysicalWalk(planned, measured, tally.outcomes(), qpos, centre, body, network)
