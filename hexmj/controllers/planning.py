"""Begin, advance and check plans, and find their first losses of static stability."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.protocol import Controller, Plan, check_controller_type, check_steerable
from hexmj.errors import InputError, Refused
from hexmj.legs import LEGS
from hexmj.stability import walk_margin
from hexmj.starts import checked_starts, checked_velocities
from hexmj.threads import check_memory, thread_count
from hexmj.timing import Acceleration, Stride, check_reached
from hexmj.tipping import Losses, LossesSoFar, Pendulum
from hexmj.validate import short
from hexmj.walks import PLANNED, PlannedWalk, copied

STEP_MEMORY = 400
"""Memory for planning one step of one start [bytes]."""

HELD = 400_000
"""Maximum number of steps times starts of a plan that `planned_losses` holds in memory."""

MOST_AT_ONCE = 200
"""Maximum number of steps that `planned_losses` plans in one call: it plans few steps after the last first loss."""


def begin(
    controller: Controller,
    starts: ArrayLike,
    velocity: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    at_speed: bool = False,
) -> Plan:
    """Return a controller's plan for starts, (start, leg) [mm], and V_r, one number or (start,).

    With `at_speed` the plan is a `SteerablePlan` that walks at its final velocity from time 0.

    Raises:
        InputError: a start or velocity is out of range, or the plan is invalid; `Refused` if the controller refuses.
    """
    check_controller_type(controller)
    if at_speed:
        check_steerable(controller)
    thread_count(threads)
    x = checked_starts(starts, stride)
    v = checked_velocities(velocity, len(x), acceleration)
    check_reached(v, stride, acceleration)
    try:
        begun: Any = getattr(controller, "begin_at_speed" if at_speed else "begin")
        plan = begun(x.copy(), v, stride, acceleration, threads)
    except InputError as error:
        if type(error) is not InputError:
            raise
        raise Refused(*error.args) from error
    check_plan(plan, plan.starts if hasattr(plan, "y") else x, stride)
    return plan


def check_velocities(
    controller: Controller, velocities: Iterable[float], stride: Stride, acceleration: Acceleration | None = None
) -> None:
    """Raise InputError if the controller's `check_velocity` refuses one of the V_r with the time step of the stride.

    With an acceleration nothing is checked: a walk is refused only when it reaches such a V_r.
    """
    check = getattr(controller, "check_velocity", None)
    if check and not acceleration:
        for velocity in velocities:
            check(velocity, stride)


def check_plan(plan: Plan, starts: np.ndarray, stride: Stride) -> None:
    """Raise InputError unless the plan is at step 0 and has these starts, (start, leg) [mm], and this stride."""
    if not isinstance(plan, Plan):
        raise InputError(f"begin returned {short(plan)}; expected a plan with starts, stride, done and advance")
    if plan.done != 0 or plan.stride != stride:
        raise InputError(f"begin returned a plan at step {plan.done} with {plan.stride}; expected step 0 with {stride}")
    if not np.array_equal(plan.starts, starts):
        raise InputError(f"the plan's starts, {np.shape(plan.starts)}, differ from the given starts, {starts.shape}")


def advanced(plan: Plan, steps: int) -> PlannedWalk:
    """Return the plan's next `steps` steps in new arrays, after checking them.

    Raises:
        InputError: the plan returns a wrong number of steps or starts, a value that is not finite, or wrong lines.
    """
    starts = len(plan.starts)
    check_memory(f"{steps} steps of {starts} starts", STEP_MEMORY * steps * starts)
    before = plan.done
    walk = copied(plan.advance(steps))
    if (shape := walk.stance.shape) != (steps, starts, len(LEGS)) or plan.done != before + steps:
        raise InputError(f"advance({steps}) at step {before} returned the shape {shape} and ended at step {plan.done}")
    for name in ("time", "velocity", "x", "y", "aep", "aep_y", "height"):
        values = getattr(walk, name)
        bad = np.isinf(values) if name in ("aep", "aep_y", "height") else ~np.isfinite(values)
        if bad.any():
            at = np.argwhere(bad)[0]
            raise InputError(f"{name} is {values[tuple(at)]} in {place(walk, at, before)}; expected a finite number")
    if walk.geometry != plan.stride.geometry:
        raise InputError(f"the plan's geometry is {walk.geometry}; expected {plan.stride.geometry}")
    return walk


def check_same(first: PlannedWalk, second: PlannedWalk, what: str, before: int = 0) -> None:
    """Raise InputError if two walks, described by `what`, differ; in both, `before` steps precede the first one."""
    for name in (*PLANNED, "velocity"):
        a, b = getattr(first, name), getattr(second, name)
        if (bad := np.argwhere((a != b) & ~((a != a) & (b != b)))).size:
            at = tuple(bad[0])
            found = f"{name} is {a[at]!s} and {b[at]!s} in {place(first, at, before)}"
            raise InputError(f"{what} differ: {found}; expected the same bits")


def place(walk: PlannedWalk, at: Sequence[int], before: int = 0) -> str:
    """Describe the index `at`, (step, start, leg), of a walk in words; `before` steps precede the walk."""
    names = [f"step {before + at[0]}", *(f"start {start} (V = {walk.velocity[at[0], start]:.3g})" for start in at[1:2])]
    return ", ".join(names + [f"leg {LEGS[leg]}" for leg in at[2:]])


def first_losses(plan: Plan, steps: int | np.ndarray, threads: int | None = None) -> np.ndarray:
    """Return each start's first statically unstable step (Eq. 7), (start,), counted from 1; 0 if all are stable.

    Args:
        plan: a plan at time 0; the call consumes it.
        steps: number of steps to search, (start,), or one number for all starts.
        threads: number of threads, by default one per core; the result does not depend on it.
    """
    fast = getattr(plan, "first_losses", None)
    if fast:
        return fast(np.broadcast_to(steps, len(plan.starts)).copy())
    return planned_losses(plan, steps, threads)


def first_dynamic_losses(plan: Plan, steps: int | np.ndarray, pendulum: Pendulum, threads: int | None = None) -> Losses:
    """Return the first losses of static and of dynamic stability of each start; the arguments are as above."""
    fast = getattr(plan, "first_dynamic_losses", None)
    if fast:
        return fast(np.broadcast_to(steps, len(plan.starts)).copy(), pendulum)
    return planned_dynamic_losses(plan, steps, pendulum, threads)


def planned_losses(plan: Plan, steps: int | np.ndarray, threads: int | None = None) -> np.ndarray:
    """Return the result of `first_losses` by advancing the plan and computing the margin of each step."""
    steps = np.broadcast_to(steps, len(plan.starts))
    lost = np.zeros(len(steps), dtype=int)
    at_a_time = min(MOST_AT_ONCE, max(1, HELD // len(steps)))
    while plan.done < (end := steps[lost == 0].max(initial=0)):
        first = plan.done + 1
        unstable = walk_margin(advanced(plan, int(min(at_a_time, end - plan.done))), threads) <= 0.0
        unstable &= (first + np.arange(len(unstable)))[:, np.newaxis] <= steps
        new = (lost == 0) & unstable.any(axis=0)
        lost[new] = first + np.argmax(unstable, axis=0)[new]
    return lost


def planned_dynamic_losses(
    plan: Plan, steps: int | np.ndarray, pendulum: Pendulum, threads: int | None = None
) -> Losses:
    """Return the result of `first_dynamic_losses` by advancing the plan and computing the margin of each step."""
    steps = np.broadcast_to(steps, len(plan.starts))
    so_far = LossesSoFar(pendulum, len(steps))
    at_a_time = min(MOST_AT_ONCE, max(1, HELD // len(steps)))
    while plan.done < (end := steps[so_far.losses.dynamic == 0].max(initial=0)):
        walk = advanced(plan, int(min(at_a_time, end - plan.done)))
        so_far.add(walk_margin(walk, threads), steps)
    return so_far.losses
