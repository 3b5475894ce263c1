"""First losses of static stability (Eq. 7) of any plan: by a fast way of its own, or by looking at every step."""

from typing import TypeGuard

import numpy as np

from hexmj.controllers.checked_plans import advanced, said
from hexmj.controllers.protocol import FastLosses, Plan, goes_with
from hexmj.errors import InputError
from hexmj.stability import walk_margin

HELD = 400_000
"""Steps times starts of a plan held in memory at a time."""

MOST = 200
"""Steps at a time, at most: a few starts that are lost early shall not walk on for long."""


def first_losses(plan: Plan, steps: np.ndarray, threads: int | None = None) -> np.ndarray:
    """The first of each start's steps that is statically unstable, (start,), counted from 1; 0 where none is.

    Args:
        plan: at time 0; nobody goes on with it.
        steps: how far to look, (start,), or one number for all.
        threads: one per core unless given; the losses do not depend on it.

    Raises:
        InputError: a plan that makes no sense.
    """
    if not tells_losses(plan):
        return planned_losses(plan, steps, threads)
    steps = np.broadcast_to(steps, len(plan.starts)).copy()
    with said("a plan, first_losses"):
        lost = np.asarray(plan.first_losses(steps.copy()))
    if lost.shape != steps.shape or lost.dtype.kind not in "iu" or not ((lost >= 0) & (lost <= steps)).all():
        raise InputError(
            f"first_losses of a plan gave {lost!r:.80}; expected the number of a step, from 0 on, for each start"
        )
    return lost


def tells_losses(plan: Plan) -> TypeGuard[FastLosses]:
    """Whether a plan tells first losses of its own: not those of one that it wraps, or whose class it changes."""
    own = getattr(plan, "__dict__", {})
    if "first_losses" in own or "advance" in own:
        return "first_losses" in own
    tells = next((one for one in type(plan).__mro__ if "first_losses" in vars(one)), None)
    return hasattr(tells, "advance") and goes_with(type(plan), "first_losses", "advance")


def planned_losses(plan: Plan, steps: np.ndarray, threads: int | None = None) -> np.ndarray:
    """The same of any plan, which is advanced and looked at."""
    steps = np.broadcast_to(steps, len(plan.starts))
    lost = np.zeros(len(steps), dtype=int)
    at_a_time = min(MOST, max(1, HELD // len(steps)))
    while plan.done < (end := steps[lost == 0].max(initial=0)):
        first = plan.done + 1
        unstable = walk_margin(advanced(plan, int(min(at_a_time, end - plan.done))), threads) <= 0.0
        unstable &= (first + np.arange(len(unstable)))[:, np.newaxis] <= steps
        new = (lost == 0) & unstable.any(axis=0)
        lost[new] = first + np.argmax(unstable, axis=0)[new]
    return lost
