"""Controllers asked for plans and plans for steps, by everybody who walks: what they answer is checked here, once.

What a user's code raises becomes one sentence that says where.
"""

import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from hexmj.checks import typed, whole
from hexmj.controllers.protocol import (
    Controller,
    FeedbackPlan,
    KnowsItsLimits,
    Plan,
    Sensed,
    SteerableController,
    SteerablePlan,
    check_controller_type,
)
from hexmj.errors import InputError, Refused
from hexmj.legs import LEGS
from hexmj.starts import checked_starts, checked_velocities
from hexmj.threads import check_memory, thread_count
from hexmj.timing import Acceleration, Stride, check_reached
from hexmj.walks import PLANNED, PlannedWalk, copied

KEPT = 400
"""Memory that a step of a start takes while it is planned [bytes]."""

REPEATED = 20
"""Steps by which two plans are told apart, of longer walks: every leg that lifts in two time units shows."""


def begin(
    controller: Controller,
    starts: ArrayLike,
    velocity: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> Plan:
    """A plan of checked starts and velocities; one velocity stands for all starts.

    Raises:
        InputError: a controller, start, velocity or plan that makes no sense; `Refused` what the controller refuses.
    """
    check_controller_type(controller)
    typed("stride", stride, Stride)
    typed("acceleration", acceleration, Acceleration | None)
    thread_count(threads)
    x = checked_starts(starts, stride)
    v = checked_velocities(velocity, len(x), acceleration)
    check_reached(v, stride, acceleration)
    with said(f"{controller.name}, begin"):
        try:
            plan = controller.begin(x.copy(), v, replace(stride), acceleration and replace(acceleration), threads)
        except InputError as error:
            if type(error) is not InputError:
                raise
            raise Refused(*error.args) from error
    check_plan(plan, x, stride)
    return plan


def check_velocities(
    controller: Controller, velocities: Iterable[float], stride: Stride, acceleration: Acceleration | None = None
) -> None:
    """Refuse velocities V_r, fractions of V_p, at which a controller says that it cannot plan with the time step.

    Of walks that accelerate it says so as they go, if they come to V_r.

    Raises:
        InputError: one of them.
    """
    if acceleration:
        return
    with said(f"{controller.name}, check_velocity"):
        if isinstance(controller, KnowsItsLimits) and callable(controller.check_velocity):
            for velocity in velocities:
                controller.check_velocity(velocity, stride)


def begin_at_speed(
    controller: SteerableController,
    starts: np.ndarray,
    velocity: np.ndarray,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> SteerablePlan:
    """A plan of checked starts, (start, leg) [mm], and final V_r, (start,), which walks at that velocity at once.

    Raises:
        InputError: a plan that makes no sense, or cannot be steered.
    """
    with said(f"{controller.name}, begin_at_speed"):
        asked = starts.copy(), velocity.copy(), replace(stride), acceleration and replace(acceleration), threads
        plan = controller.begin_at_speed(*asked)
        steerable = isinstance(plan, SteerablePlan)
    if not steerable:
        raise InputError(f"begin_at_speed of {controller.name} gave {plan!r:.80}; expected a plan that can be steered")
    check_plan(plan, starts, stride)
    return plan


def check_plan(plan: Plan, starts: np.ndarray, stride: Stride) -> None:
    """Refuse a plan that does not begin at these starts, (start, leg) [mm].

    Raises:
        InputError: no plan, or one of other starts, with another stride, or not at time 0.
    """
    if not isinstance(plan, Plan):
        raise InputError(f"begin gave {plan!r:.80}; expected a plan, with starts, stride, done and advance")
    if whole("a plan's done", plan.done, 0):
        raise InputError(f"the plan is at step {plan.done}; expected one at time 0")
    if plan.stride != stride:
        raise InputError(f"the plan's stride is {plan.stride}; expected {stride}")
    if not np.array_equal(plan.starts, starts):
        told = f", {np.shape(plan.starts)}; expected the {len(starts)} asked for"
        if np.shape(plan.starts) == starts.shape:
            (start, leg), *_ = np.argwhere((begun := np.asarray(plan.starts)) != starts)
            told = f": leg {LEGS[leg]} of start {start} at {begun[start, leg]} mm; expected {starts[start, leg]} mm"
        raise InputError(f"the plan is of other starts{told}")


def advanced(plan: Plan, steps: int) -> PlannedWalk:
    """The plan's next steps, if it gives as many, for all of its starts, with numbers that are finite.

    They are the caller's: a plan may write into its own arrays again.

    Raises:
        InputError: it does not, or it raised something.
    """
    count = len(plan.starts)
    check_memory(f"{steps} steps of {count} starts, kept whole,", KEPT * steps * count)
    end = plan.done + steps
    with said("a plan, advance"):
        walk = plan.advance(steps)
    if not isinstance(walk, PlannedWalk):
        raise InputError(f"a plan gave {walk!r:.80}; expected a PlannedWalk")
    walk = copied(walk)
    if whole("a plan's done", plan.done, 0) != end:
        raise InputError(f"a plan is at step {plan.done} after it was asked for {steps} more; expected {end}")
    if walk.stance.shape != (expected := (steps, *np.shape(plan.starts))):
        raise InputError(f"a plan was asked for {steps} steps, and gave {walk.stance.shape}; expected {expected}")
    for name in ("time", "velocity", "x", "y", "aep", "height"):
        values = getattr(walk, name)
        may_be_unknown = name in ("aep", "height")
        bad = np.isinf(values) if may_be_unknown else ~np.isfinite(values)
        if np.count_nonzero(bad):
            at, known = np.argwhere(bad)[0], "a number, or NaN where nothing tells" if may_be_unknown else "a number"
            raise InputError(
                f"a plan's {name} is {values[tuple(at)]} in {place(walk, at, end - steps)}; expected {known}"
            )
    if walk.geometry != plan.stride.geometry:
        raise InputError(f"a plan's geometry = {walk.geometry}; expected that of the stride")
    times = np.arange(end - steps + 1, end + 1) * plan.stride.dt
    if not (np.abs(walk.time - times) <= 1e-9 * times).all():
        raise InputError(f"a plan's time is not that of its steps to {end}; expected k dt")
    if not ((walk.velocity >= 0.0) & (walk.velocity < 1.0)).all():
        raise InputError("a plan's velocity is below 0 or not below 1; expected V_r as it was commanded")
    return walk


def check_repeats(
    controller: Controller,
    starts: np.ndarray,
    velocity: ArrayLike,
    steps: int,
    stride: Stride,
    acceleration: Acceleration | None = None,
) -> None:
    """Refuse a controller whose first steps are others when it begins again, as by random numbers without a seed.

    Starts, (start, leg) [mm], and V_r, one number or (start,), are those of a walk of `steps`, which may be fewer than
    `REPEATED`.

    Raises:
        InputError: it is one.
    """
    plans = [begin(controller, starts, velocity, stride, acceleration, threads=1) for _ in range(2)]
    one, other = (advanced(plan, min(steps, REPEATED)) for plan in plans)
    check_same(one, other, controller.name)


def check_same(one: PlannedWalk, other: PlannedWalk, whose: str, before: int = 0) -> None:
    """Refuse two plans that ought to be the same and are not: what is told of one is not of the other.

    They are of the same starts and steps; a sentence says `whose`, and counts the steps of the plan `before` these.

    Raises:
        InputError: they differ.
    """
    if differ := difference(one, other, before):
        raise InputError(
            f"{whose} plans another walk when it begins again: {differ}; expected the same numbers each time, as from"
            " seeds that are fields"
        )


def difference(one: PlannedWalk, other: PlannedWalk, before: int = 0) -> str:
    """The first number that differs between two walks of the same starts, and where; nothing if they are the same."""
    for name in (*PLANNED, "velocity"):
        a, b = getattr(one, name), getattr(other, name)
        if (bad := np.argwhere((a != b) & ~((a != a) & (b != b)))).size:
            at = tuple(bad[0])
            return f"{name} is {a[at]!s} and {b[at]!s} in {place(one, at, before)}"
    return ""


def place(walk: PlannedWalk, at: Sequence[int], before: int = 0) -> str:
    """Where in a walk, or the part of a plan after some steps, something is: step, start and leg, as far as given."""
    names = [f"step {before + at[0]}", *(f"start {start} (V = {walk.velocity[at[0], start]:.3g})" for start in at[1:2])]
    return ", ".join(names + [f"leg {LEGS[leg]}" for leg in at[2:]])


def tell(plan: FeedbackPlan, sensed: Sensed) -> None:
    """Tell a plan what is known before its next step.

    Raises:
        InputError: it raised something.
    """
    with said("a plan, sense"):
        plan.sense(sensed)


@contextmanager
def said(what: str) -> Iterator[None]:
    """Say in one sentence what a user's code raises, and where; if it changes the folder, that is changed back."""
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        said = " ".join(str(error).split())
        raise InputError(
            f"{what}: {type(error).__name__} in {place.filename}, line {place.lineno}: {said:.300}"
        ) from error
