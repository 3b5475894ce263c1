"""Laws of plans that can be steered: what `see`, `restart` and `slow_down` of `protocol.SteerablePlan` ask they do."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

import numpy as np

from hexmj.controllers.checked_plans import advanced, said
from hexmj.controllers.protocol import SteerablePlan, is_steerable
from hexmj.controllers.trial import Trial, every_other, mixed, same
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.timing import AT_SPEED, commanded_velocities
from hexmj.walks import PlannedWalk, of_starts

BEFORE = AFTER = 250
"""Steps before a plan is steered, and after it: 25 time units, a swing and a quarter."""


def _steerable(trial: Trial) -> Iterator[tuple[Trial, SteerablePlan]]:
    """A new plan, and one of `begin_at_speed`, of those that can be steered; and the trials that they are of."""
    for one in (trial, replace(trial, at_speed=True))[: 1 + is_steerable(trial.controller)]:
        plan: Any = one.begin()
        with said("a plan, tips and standing"):
            steerable = isinstance(plan, SteerablePlan)
        if steerable:
            yield one, plan


def seen(trial: Trial) -> None:
    """A plan is where its last step says, and where `see` puts it, and goes on from there as starts alone do.

    Raises:
        InputError: it is elsewhere, or goes on otherwise.
    """
    for one, plan in _steerable(trial):
        last = advanced(plan, BEFORE)
        _is_where(plan, last.x[-1], last.stance[-1], "after a step")
        tips, standing = last.x[-1, ::-1].copy(), last.stance[-1, ::-1].copy()
        with said("a plan, see"):
            plan.see(tips.copy(), standing.copy())
        _is_where(plan, tips, standing, "after see")
        on, which = advanced(plan, AFTER), ~every_other(trial)
        advanced(alone := one.of(which).begin(), BEFORE)
        with said("a plan, see"):
            cast(SteerablePlan, alone).see(tips[which].copy(), standing[which].copy())
        expected = mixed(on, which, advanced(alone, AFTER))
        same(on, expected, "starts alone, and among others, that go on after see,", BEFORE)


def restarted(trial: Trial) -> None:
    """Starts that `restart` at other tips go on as they begin there, to the last bit; the others as if nothing were.

    Raises:
        InputError: they do not.
    """
    for one, plan in _steerable(trial):
        which, last = every_other(trial), advanced(plan, BEFORE)
        others = replace(trial, starts=trial.starts[::-1])
        with said("a plan, restart"):
            plan.restart(which.copy(), others.starts.copy())
        tips = np.where(which[:, None], others.starts, last.x[-1])
        _is_where(plan, tips, which[:, None] | last.stance[-1], "after restart of some starts")
        on, begun = advanced(plan, AFTER), advanced(others.begin(), AFTER)
        same(on, mixed(on, which, of_starts(begun, which)), "restart, and beginning,")
        later = of_starts(_later(one), ~which)
        same(on, mixed(on, ~which, later), "starts alone, and beside some that restart,", BEFORE)


def slowed(trial: Trial) -> None:
    """Starts that `slow_down` are at V_r(0) of Eq. 11 again, the legs as they are; the others go on as if nothing were.

    So do all without an acceleration.

    Raises:
        InputError: they do not.
    """
    for one, plan in _steerable(trial):
        which, last, v = every_other(trial), advanced(plan, BEFORE), trial.velocity
        with said("a plan, slow_down"):
            plan.slow_down(which.copy())
        _is_where(plan, last.x[-1], last.stance[-1], "after slow_down")
        ages = np.where(which, 0, AT_SPEED if one.at_speed else BEFORE)
        on, commanded = advanced(plan, AFTER), commanded_velocities(v, ages, AFTER, trial.stride, trial.acceleration)
        if (bad := np.argwhere(on.velocity != commanded)).size:
            step, start = bad[0]
            asked = "" if which[start] else ", which was not asked to,"
            raise InputError(
                f"velocity of start {start}{asked} is {on.velocity[step, start]:.6g} in step {step + 1} after"
                f" slow_down; expected {commanded[step, start]:.6g}"
            )
        as_fast = ~which if trial.acceleration else np.ones_like(which)
        later = of_starts(_later(one), as_fast)
        same(on, mixed(on, as_fast, later), "starts that go on as fast, and the same without slow_down,", BEFORE)


def _later(trial: Trial) -> PlannedWalk:
    """What it plans where it is not steered, after `BEFORE`."""
    advanced(plan := trial.begin(), BEFORE)
    return advanced(plan, AFTER)


def _is_where(plan: SteerablePlan, tips: np.ndarray, standing: np.ndarray, when: str) -> None:
    """Refuse a plan whose own tips and states are not these, (start, leg)."""
    for name, expected in (("tips", tips), ("standing", standing)):
        with said(f"a plan, {name}"):
            shape = np.shape(getattr(plan, name))
        if shape != expected.shape:
            raise InputError(f"{name} has the shape {shape} {when}; expected {expected.shape}")
        if (bad := np.argwhere((found := np.asarray(getattr(plan, name))) != expected)).size:
            at = tuple(bad[0])
            leg = LEGS[at[1]]
            raise InputError(f"{name} of start {at[0]}, leg {leg} is {found[at]!s} {when}; expected {expected[at]!s}")
