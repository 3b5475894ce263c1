"""Physical walks from start to end: `physical_walk` keeps them whole, `physical_outcomes` only how they went."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.checks import given, typed
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.checked_plans import begin, check_repeats, check_same
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan
from hexmj.diagrams import footfall_html
from hexmj.measures.kinematic import first_loss, walk
from hexmj.physics.drive import Push, drive
from hexmj.physics.measured import feet_on_ground, measured_walk
from hexmj.physics.outcomes import Outcomes, OutcomesSoFar
from hexmj.physics.settling import Settled, settle
from hexmj.progress import Progress, shown
from hexmj.stability import loss_time
from hexmj.timing import Acceleration, Stride, steps_within
from hexmj.walks import PlannedWalk, Walk, copied, extent, joined, part_of


@dataclass(frozen=True, eq=False, repr=False)
class PhysicalWalk:
    """Physical walks kept whole.  After a fall everything measured is NaN, and no foot stands."""

    planned: PlannedWalk
    """What was planned; by a plan that reads the legs, what it plans on paper."""
    ordered: PlannedWalk
    """What the legs were told; another walk than `planned` only if the plan reads them, and then NaN after a fall."""
    measured: Walk
    """What the insect did: feet in contact, seen from its own centre of mass and heading."""
    outcomes: Outcomes
    """How every start went."""
    qpos: np.ndarray
    """(step, start, position) MuJoCo's positions at the end of each step of the plan."""
    centre_of_mass: np.ndarray
    """(step, start, 3) in the world [mm]."""
    height: np.ndarray
    """(step, start, leg) of the feet above the ground [mm]; below 0 where they sink in."""
    load: np.ndarray
    """(step, start, leg) force of the ground on the feet along its normal [g mm/s^2], adhesion taken off: below 0 where
    that holds a foot that pulls.  Of the substep that comes next; after the last step as if that came again."""
    conditions: Conditions
    """Of the walk."""
    stride: Stride
    """Of the plan."""

    def __repr__(self) -> str:
        return f"PhysicalWalk({extent(self.ordered)}; {self.outcomes!r})"

    def _repr_html_(self) -> str | None:
        """What a notebook shows: the feet that are off the ground."""
        if len(self.measured.time) < 2 or not self.measured.stance.shape[1]:
            return None
        known, fall = ~np.isnan(self.measured.x[:, 0]), self.outcomes.fall[0]
        told = "start 0 as measured" + (f", which fell at {fall:.4g}" if np.isfinite(fall) else "")
        return footfall_html(repr(self), self.measured.time, known & ~self.measured.stance[:, 0], told)


def physical_outcomes(
    settled: Settled,
    controller: Controller,
    velocity: ArrayLike,
    duration: float,
    *,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """How every settled start goes; only outcomes are kept.

    The planned loss is always that on paper, where a plan that reads the legs is told nothing: it stays the paper's
    measure, and the same with and without feedback.

    Args, beside those of `physical_walk`:
        settled: starts at rest, see `settling.settle`.
        progress: told the fraction done since it was last called.

    Raises:
        InputError, SimulationError: see `drive.drive`.
    """
    duration = typed("duration", duration, float)
    how: Any = {"stride": settled.stride, "acceleration": acceleration}
    check_repeats(controller, settled.starts, velocity, int(steps_within(duration, settled.stride)), **how)
    plan = begin(controller, settled.starts, velocity, **how, threads=1)
    planned_loss = first_loss(settled.starts, controller, velocity, duration, **how, threads=threads)
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
    typed("progress", progress, Progress | None)
    so_far = OutcomesSoFar(settled, planned_loss)
    for chunk in drive(settled, plan, duration, push=push, threads=threads, progress=progress):
        so_far.add(chunk)
    return so_far.outcomes()


def physical_walk(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike,
    duration: float,
    *,
    conditions: Conditions | None = None,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> PhysicalWalk:
    """The physical walk of every start, kept whole.

    Args:
        starts: tips at time 0, (start, leg) [mm]; all feet stand.
        controller: plans the walks.
        velocity: V_r, or its final value; one number or (start,).
        duration: observation time [time units].
        conditions: of the walk.
        stride: of the plan.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: True shows a bar; or a function that is told the fraction done since it was last called.

    Raises:
        InputError, SimulationError: see `settling.settle` and `drive.drive`.
    """
    stride, conditions = given("stride", stride, Stride), given("conditions", conditions, Conditions)
    check_ground(conditions)
    with shown(progress, "walking") as told:
        how: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
        planned = walk(starts, controller, velocity, duration, **how)
        plan = begin(controller, starts, velocity, stride, acceleration, threads=1)
        settled = settle(starts, conditions, stride, threads)
        return physical_walk_of_plan(settled, plan, planned, threads=threads, progress=told)


def physical_walk_of_plan(
    settled: Settled,
    plan: Plan,
    planned: PlannedWalk,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> PhysicalWalk:
    """The same for any plan that is at time 0, which goes as `planned`.

    Raises:
        InputError: it goes otherwise, and reads nothing.
    """
    conditions, stride = settled.conditions, settled.stride
    so_far = OutcomesSoFar(settled, loss_time(planned, threads=threads))
    shape = planned.stance.shape
    (x, y, height, load), stance = np.full((4, *shape), np.nan), np.zeros(shape, dtype=bool)
    qpos, centre = np.full((*shape[:2], settled.qpos.shape[1]), np.nan), np.full((*shape[:2], 3), np.nan)
    told: list[PlannedWalk] = []
    for chunk in drive(settled, plan, float(planned.time[-1]), push=push, threads=threads, progress=progress):
        so_far.add(chunk)
        if isinstance(plan, FeedbackPlan):
            told.append(chunk.plan)
        else:
            first = chunk.first // settled.substeps
            same = part_of(planned, slice(first, first + len(chunk.plan.time)))
            check_same(same, chunk.plan, "the controller", first)
        columns, seen, seen_centre = measured_walk(chunk, settled)
        at = np.ix_((chunk.first + columns) // conditions.substeps(stride) - 1, chunk.ids)
        x[at], y[at], stance[at], centre[at] = seen.x, seen.y, seen.stance, seen_centre
        height[at], load[at] = feet_on_ground(chunk, settled, columns)
        over = (columns[:, None] >= chunk.valid)[..., None]
        qpos[at] = np.where(over, np.nan, chunk.qpos[:, columns].swapaxes(0, 1))
    measured = Walk(planned.time, planned.velocity, x, y, stance, stride.geometry)
    outcomes = so_far.outcomes()
    ordered = _until(outcomes.fall, planned, told, stride) if told else planned
    return PhysicalWalk(planned, ordered, measured, outcomes, qpos, centre, height, load, conditions, stride)


def _until(fall: np.ndarray, planned: PlannedWalk, told: list[PlannedWalk], stride: Stride) -> PlannedWalk:
    """What starts were told by a plan that reads the legs, up to the step in which each fell, (start,) [time units]."""
    walk = copied(joined([*told, part_of(planned, slice(sum(len(one.time) for one in told), None))]))
    over = walk.time[:, None] - stride.dt >= fall
    for tips in (walk.x, walk.y, walk.aep, walk.height):
        tips[over] = np.nan
    walk.stance[over] = False
    return walk
