"""Physical walks from start to end: `physical_walk` keeps them whole, `physical_outcomes` only how they went."""

from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import advanced, begin, check_repeats, check_same
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan
from hexmj.measures.kinematic import first_loss
from hexmj.physics.outcomes import EffortSoFar, Outcomes, OutcomesSoFar, WalkSoFar
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import drive
from hexmj.physics.settle import Settled, settle
from hexmj.progress import Progress, progress_bar
from hexmj.timing import Acceleration, Stride, steps_within
from hexmj.walks import PlannedWalk, Walk, copied, extent, footfall_html, joined, part_of


@dataclass(frozen=True, eq=False, repr=False)
class PhysicalWalk:
    """Physical walks kept whole. After a fall everything measured is NaN, and no foot stands."""

    planned: PlannedWalk
    """The kinematic plan; of a feedback plan, what it plans without feedback."""
    ordered: PlannedWalk
    """The plan that the legs followed; it differs from `planned` with feedback only, and then is NaN after a fall."""
    measured: Walk
    """What the insect did: feet in contact, relative to its own centre of mass and heading."""
    outcomes: Outcomes
    """How every start went."""
    qpos: np.ndarray
    """(step, start, position) MuJoCo's positions at the end of each step of the plan."""
    centre_of_mass: np.ndarray
    """(step, start, 3) in the world [mm]."""
    height: np.ndarray
    """(step, start, leg) of the feet above the ground [mm]; negative if they sink in."""
    load: np.ndarray
    """(step, start, leg) force of the ground on the feet along its normal without adhesion [g mm/s^2]; negative if
    adhesion holds a foot that pulls. It is that of the next substep, and of the last one after the last step."""
    conditions: Conditions
    """Of the walk."""
    stride: Stride
    """Of the plan."""

    def __repr__(self) -> str:
        return f"PhysicalWalk({extent(self.ordered)}; {self.outcomes!r})"

    def _repr_html_(self) -> str | None:
        """Show the feet that are off the ground, in a notebook."""
        if len(self.measured.time) < 2 or not self.measured.stance.shape[1]:
            return None
        known, fall = ~np.isnan(self.measured.x[:, 0]), self.outcomes.fall[0]
        title = "start 0 as measured" + (f", which fell at {fall:.4g}" if np.isfinite(fall) else "")
        return footfall_html(repr(self), self.measured.time, known & ~self.measured.stance[:, 0], title)


def physical_walk(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike,
    duration: float,
    *,
    conditions: Conditions = Conditions(),
    stride: Stride = Stride(),
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
        progress: True shows a bar; or a function that is called with the fraction done since the last call.

    Raises:
        InputError, SimulationError: see `settle.settle` and `rollout.drive`.
    """
    check_ground(conditions)
    kinematic = begin(controller, starts, velocity, stride, acceleration, threads)
    planned = advanced(kinematic, int(steps_within(duration, stride)))
    settled = settle(starts, conditions, stride, threads)
    plan = begin(controller, settled.starts, velocity, stride, acceleration, threads=1)
    with progress_bar("walking") if progress is True else nullcontext(progress or None) as advance:
        return physical_walk_of_plan(settled, plan, planned, threads=threads, progress=advance)


def physical_walk_of_plan(
    settled: Settled,
    plan: Plan,
    planned: PlannedWalk,
    *,
    push: Push | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> PhysicalWalk:
    """The physical walk of a plan at time 0, kept whole; without feedback the plan must go as `planned`.

    Raises:
        InputError, SimulationError: see `rollout.drive`; or a plan without feedback differs from `planned`.
    """
    stride, so_far = settled.stride, WalkSoFar(settled, planned, threads)
    followed: list[PlannedWalk] = []
    for chunk in drive(settled, plan, float(planned.time[-1]), push=push, threads=threads, progress=progress):
        so_far.add(chunk)
        if isinstance(plan, FeedbackPlan):
            followed.append(chunk.plan)
        else:
            first = chunk.first // settled.substeps
            same = part_of(planned, slice(first, first + len(chunk.plan.time)))
            check_same(same, chunk.plan, "two plans of the controller", first)
    outcomes = so_far.outcomes()
    ordered = _until_fall(outcomes.fall, planned, followed, stride) if followed else planned
    kept = {name: getattr(so_far, name) for name in ("measured", "qpos", "centre_of_mass", "height", "load")}
    return PhysicalWalk(planned, ordered, outcomes=outcomes, conditions=settled.conditions, stride=stride, **kept)


def physical_outcomes(
    settled: Settled,
    controller: Controller,
    velocity: ArrayLike,
    duration: float,
    *,
    acceleration: Acceleration | None = None,
    effort: EffortSoFar | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """How every settled start goes, without keeping the walks.

    The planned loss is always the kinematic one, without feedback: the same measure with and without it.

    Args:
        settled: starts at rest, see `settle.settle`; the other arguments are those of `physical_walk`.
        effort: adds up the work and the torques of the same walks.

    Raises:
        InputError, SimulationError: see `rollout.drive`.
    """
    starts, stride = settled.starts, settled.stride
    check_repeats(controller, starts, velocity, int(steps_within(duration, stride)), stride, acceleration)
    plan = begin(controller, starts, velocity, stride, acceleration, threads=1)
    planned_loss = first_loss(
        starts, controller, velocity, duration, stride=stride, acceleration=acceleration, threads=threads
    )
    how: Any = {"effort": effort, "threads": threads, "progress": progress}
    return outcomes_of_plan(settled, plan, duration, planned_loss, **how)


def outcomes_of_plan(
    settled: Settled,
    plan: Plan,
    duration: float,
    planned_loss: np.ndarray,
    *,
    push: Push | None = None,
    effort: EffortSoFar | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """How every settled start goes by a plan at time 0 with these losses, (start,) [time units]."""
    so_far = OutcomesSoFar(settled, planned_loss)
    for chunk in drive(settled, plan, duration, push=push, threads=threads, progress=progress):
        so_far.add(chunk)
        if effort:
            effort.add(chunk)
    return so_far.outcomes()


def _until_fall(fall: np.ndarray, planned: PlannedWalk, followed: list[PlannedWalk], stride: Stride) -> PlannedWalk:
    """The feedback plan that the legs followed, up to the step in which each start fell, (start,) [time units]."""
    steps = sum(len(part.time) for part in followed)
    walk = copied(joined([*followed, part_of(planned, slice(steps, None))]))
    over = walk.time[:, None] - stride.dt >= fall
    for tips in (walk.x, walk.y, walk.aep, walk.height):
        tips[over] = np.nan
    walk.stance[over] = False
    return walk
