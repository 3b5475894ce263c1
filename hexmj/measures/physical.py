"""Physical walks: `physical_walk` keeps every step in memory, `physical_outcomes` only the outcome of each start."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.command import Command
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import advanced, check_same
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan
from hexmj.controllers.steered import begin
from hexmj.measures.kinematic import dynamic_losses
from hexmj.physics.outcomes import EffortSoFar, Outcomes, OutcomesSoFar, WalkSoFar, grounded
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import drive
from hexmj.physics.settle import Settled, settle_plan
from hexmj.progress import Progress, progress_bar
from hexmj.timing import Acceleration, Stride, steps_within
from hexmj.walks import PlannedWalk, Walk, copied, extent, footfall_html, joined, part_of


@dataclass(frozen=True, eq=False, repr=False)
class PhysicalWalk:
    """Every step of physical walks. After a fall all numbers of the simulation are NaN, and no foot stands."""

    planned: PlannedWalk
    """The kinematic plan; for a feedback plan, the same plan without sensory feedback."""
    ordered: PlannedWalk
    """The plan that the legs followed: `planned`, or with feedback the plan as adjusted, which is NaN after a fall."""
    measured: Walk
    """The simulated walk: feet that carry load, and tips relative to the insect's own centre of mass and heading."""
    outcomes: Outcomes
    """Losses, falls and other numbers of every start."""
    qpos: np.ndarray
    """(step, start, position) MuJoCo's `qpos` at the end of each step of the plan."""
    centre_of_mass: np.ndarray
    """(step, start, 3) position of the centre of mass in the world [mm]."""
    height: np.ndarray
    """(step, start, leg) height of the feet's lowest points above the ground [mm]; negative if a foot has sunk in."""
    load: np.ndarray
    """(step, start, leg) normal force of the ground on a foot minus its adhesion [g mm/s^2]; negative if adhesion holds
    it down. Read in the first substep of the next step; after the last step, in the last substep."""
    conditions: Conditions
    stride: Stride
    torque: np.ndarray | None = None
    """(step, start, joint) torque of each joint over the substep of `load`, with the servo's damping [g mm^2/s^2]; None
    unless `physical_walk` keeps forces."""
    ground_force: np.ndarray | None = None
    """(step, start, leg, 3) force of the ground on each foot in the world, without adhesion, in the substep of `load`
    [g mm/s^2]; None unless `physical_walk` keeps forces."""

    @property
    def grounded(self) -> Walk:
        """The simulated walk `measured`, but with the stance of the feet at the ground, see `outcomes.grounded`."""
        return grounded(self.measured, self.height, self.conditions)

    def __repr__(self) -> str:
        return f"PhysicalWalk({extent(self.ordered)}; {self.outcomes!r})"

    def _repr_html_(self) -> str | None:
        """Return a diagram of the feet that are off the ground for notebooks, as HTML."""
        walk = self.grounded
        if len(walk.time) < 2 or not walk.stance.shape[1]:
            return None
        known, fall = ~np.isnan(walk.x[:, 0]), self.outcomes.fall[0]
        title = "start 0 in the simulation" + (f", which fell at {fall:.4g}" if np.isfinite(fall) else "")
        return footfall_html(repr(self), walk.time, known & ~walk.stance[:, 0], title)


def physical_walk(
    starts: ArrayLike,
    controller: Controller,
    velocity: ArrayLike | Command | Sequence[Command],
    duration: float,
    *,
    conditions: Conditions = Conditions(),
    stride: Stride = Stride(),
    acceleration: Acceleration | None = None,
    forces: bool = False,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> PhysicalWalk:
    """Return every step of the physical walks from some starts.

    Args:
        starts: tips at time 0, (start, leg) [mm]; all feet stand.
        controller: controller that plans the walks.
        velocity: V_r, or its final value when accelerating; one number or (start,), 0 <= V_r < 1.
        duration: observation time [time units].
        conditions: V_p, body, ground and contacts of the walk.
        stride: step range, lines of the tips and time step of the plan.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        forces: keep `PhysicalWalk.torque` and `ground_force`. By default they are not kept, since they take 5 to 7 %
            more time and, in long walks, up to half as much memory again; all else has the same bits.
        threads: number of threads, by default one per core; the result does not depend on it.
        progress: True shows a bar; a function is called with the fraction done since its last call.

    Raises:
        InputError: an argument is out of range, a start is out of reach, or the walk crosses an edge of the ground.
        SimulationError: an insect does not come to rest at its start, or a walk diverges.
    """
    check_ground(conditions)
    kinematic = begin(controller, starts, velocity, stride, acceleration, threads)
    planned = advanced(kinematic, int(steps_within(duration, stride)))
    settled = settle_plan(kinematic, conditions, threads, pushes=forces)
    plan = begin(controller, starts, velocity, stride, acceleration, threads=1)
    with progress_bar("walking") if progress is True else nullcontext(progress or None) as advance:
        return physical_walk_of_plan(settled, plan, planned, threads=threads, progress=advance)


def physical_walk_of_plan(
    settled: Settled,
    plan: Plan,
    planned: PlannedWalk,
    *,
    pushes: Sequence[Push] = (),
    threads: int | None = None,
    progress: Progress | None = None,
) -> PhysicalWalk:
    """Return every step of the physical walk of a plan that is at time 0; `planned` is the same plan, without feedback.

    Raises:
        InputError, SimulationError: see `rollout.drive`; InputError also if a plan without feedback is not `planned`.
    """
    stride, so_far = settled.stride, WalkSoFar(settled, planned, threads)
    followed: list[PlannedWalk] = []
    for chunk in drive(settled, plan, float(planned.time[-1]), pushes=pushes, threads=threads, progress=progress):
        so_far.add(chunk)
        if isinstance(plan, FeedbackPlan):
            followed.append(chunk.plan)
        else:
            first = chunk.first // settled.substeps
            same = part_of(planned, slice(first, first + len(chunk.plan.time)))
            check_same(same, chunk.plan, "two plans of the controller", first)
    outcomes = so_far.outcomes()
    ordered = _until_fall(outcomes.fall, planned, followed, stride) if followed else planned
    settings: Any = {"conditions": settled.conditions, "stride": stride}
    return PhysicalWalk(planned, ordered, so_far.measured, outcomes, **settings, **so_far.kept)


def physical_outcomes(
    settled: Settled,
    controller: Controller,
    velocity: ArrayLike | Command | Sequence[Command],
    duration: float,
    *,
    starts: np.ndarray | None = None,
    acceleration: Acceleration | None = None,
    effort: EffortSoFar | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """Return the outcomes of physical walks from starts at rest, without keeping the walks in memory.

    The planned loss is that of the plan without sensory feedback, whether the walk uses feedback or not.

    Args:
        settled: starts at rest, see `settle.settle`; the other arguments are those of `physical_walk`.
        starts: starts of the plan, by default those at rest, which differ after a warm-up (`wrappers.FromSteadyState`).
        effort: accumulates the work and the torques of these walks; None leaves them out.

    Raises:
        InputError, SimulationError: see `rollout.drive`.
    """
    starts, stride = settled.starts if starts is None else starts, settled.stride
    plan = begin(controller, starts, velocity, stride, acceleration, threads=1)
    walks: Any = {"stride": stride, "acceleration": acceleration, "threads": threads}
    lost = dynamic_losses(starts, controller, velocity, duration, conditions=settled.conditions, **walks)
    how: Any = {"effort": effort, "threads": threads, "progress": progress}
    return outcomes_of_plan(settled, plan, duration, lost.static, lost.dynamic, **how)


def outcomes_of_plan(
    settled: Settled,
    plan: Plan,
    duration: float,
    planned_loss: np.ndarray,
    dynamic_loss: np.ndarray | None = None,
    *,
    pushes: Sequence[Push] = (),
    effort: EffortSoFar | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """Return the outcomes of the physical walks of a plan at time 0, whose planned losses, (start,), are known."""
    so_far = OutcomesSoFar(settled, planned_loss, dynamic_loss)
    for chunk in drive(settled, plan, duration, pushes=pushes, threads=threads, progress=progress):
        so_far.add(chunk)
        if effort:
            effort.add(chunk)
    return so_far.outcomes()


def _until_fall(fall: np.ndarray, planned: PlannedWalk, followed: list[PlannedWalk], stride: Stride) -> PlannedWalk:
    """Return the feedback plan that the legs followed, NaN after the `fall` of each start, (start,) [time units]."""
    steps = sum(len(part.time) for part in followed)
    walk = copied(joined([*followed, part_of(planned, slice(steps, None))]))
    over = walk.time[:, None] - stride.dt >= fall
    for tips in (walk.x, walk.y, walk.aep, walk.aep_y, walk.height):
        tips[over] = np.nan
    walk.stance[over] = False
    return walk
