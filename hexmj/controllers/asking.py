"""Controllers asked for plans and plans for steps, by everybody who walks: what they answer is checked here, once.

What a user's code raises becomes one sentence that says where.
"""

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.protocol import Controller, Plan, ReadingPlan, Sensed, check_controller_type
from hexmj.errors import InputError
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PLANNED, PlannedWalk


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
        InputError: a controller, start, velocity or plan that makes no sense.
    """
    check_controller_type(controller)
    x = checked_starts(starts, stride)
    v = checked_velocities(velocity, len(x), acceleration)
    with _said(f"{controller.name}, begin"):
        plan = controller.begin(x.copy(), v, stride, acceleration, threads)
    check_plan(plan, x, stride)
    return plan


def check_plan(plan: Plan, starts: np.ndarray, stride: Stride) -> None:
    """Refuse a plan that does not begin at these starts, (start, leg) [mm].

    Raises:
        InputError: no plan, or one of other starts, with another stride, or not at time 0.
    """
    if not isinstance(plan, Plan):
        raise InputError(f"begin gave {plan!r:.80}; expected a plan, with starts, stride, done and advance")
    if plan.done:
        raise InputError(f"the plan is at step {plan.done}; expected one at time 0, as `begin` gives it")
    if plan.stride != stride:
        raise InputError(f"the plan's stride is {plan.stride}; expected {stride}")
    if not np.array_equal(plan.starts, starts):
        raise InputError(f"the plan is of other starts, {np.shape(plan.starts)}; expected the {len(starts)} asked for")


def advanced(plan: Plan, steps: int) -> PlannedWalk:
    """The plan's next steps, if it gives as many, for all of its starts, with numbers that are finite.

    Raises:
        InputError: it does not, or it raised something.
    """
    end = plan.done + steps
    with _said("a plan, advance"):
        walk = plan.advance(steps)
    if not isinstance(walk, PlannedWalk):
        raise InputError(f"a plan gave {walk!r:.80}; expected a PlannedWalk")
    if plan.done != end:
        raise InputError(f"a plan is at step {plan.done} after it was asked for {steps} more; expected {end}")
    shape = steps, *np.shape(plan.starts)
    shapes = {"time": shape[:1], "velocity": shape[:2]} | dict.fromkeys(PLANNED, shape)
    for name, expected in shapes.items():
        values = np.asarray(getattr(walk, name))
        if values.shape != expected or values.dtype != (bool if name == "stance" else float):
            raise InputError(
                f"a plan was asked for {steps} steps, and its {name} is {values.dtype} of the shape {values.shape};"
                f" expected {'bool' if name == 'stance' else 'float64'} of the shape {expected}"
            )
        if (name in ("x", "y", "velocity") and not np.isfinite(values).all()) or np.isinf(values).any():
            raise InputError(f"a plan's {name} holds a number that is not finite, before step {end}")
    return walk


def tell(plan: ReadingPlan, sensed: Sensed) -> None:
    """Tell a plan what is known before its next step.

    Raises:
        InputError: it raised something.
    """
    with _said("a plan, sense"):
        plan.sense(sensed)


@contextmanager
def _said(what: str) -> Iterator[None]:
    """Say in one sentence what a user's code raises, and where."""
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
