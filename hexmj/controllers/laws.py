"""The interface checks of controllers: each is a function of a trial walk that raises InputError where it fails."""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from hexmj.controllers.planning import (
    advanced,
    begin,
    begin_at_speed,
    check_velocities,
    difference,
    place,
    planned_losses,
)
from hexmj.controllers.protocol import (
    Controller,
    FeedbackPlan,
    Plan,
    Sensed,
    SteerableController,
    SteerablePlan,
    is_steerable,
    settings_of,
)
from hexmj.errors import InputError
from hexmj.legs import LEGS, MIRROR
from hexmj.timing import AT_SPEED, Acceleration, Stride, commanded_velocities
from hexmj.walks import PLANNED, PlannedWalk, copied, joined, of_starts

N_STARTS, STEPS = 16, 600
"""Starts of a trial and steps of its walk: 60 time units, a swing and a stance at V = 0.5."""

DIVIDED = (1, 7, 250, 342)
"""The same number of steps in parts."""

REACH = 0.8
"""Distance of a tip beyond PEP_min or AEP_0 on its own axis [mm] that is allowed besides two time steps' way at V_p:
legs overshoot both by a step, and a leg that is raised out there swings for another."""

BESIDE = 0.5
"""Allowed distance of a tip from its leg's line, as a fraction of the line's distance from the body axis."""

BEFORE = AFTER = 250
"""Steps before a plan is steered, and after it: 25 time units, a swing and a quarter."""

SENSED_STEPS, NUMBERS = 99, 50
"""Steps in which a plan senses, and numbers that each start senses: six for contacts, 18 joint angles, 18 torques,
tilt, velocity and turning."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Walks that a controller has to plan."""

    controller: Controller
    """Plans them."""
    starts: np.ndarray
    """Tips at time 0, (start, leg) [mm]."""
    velocity: np.ndarray
    """V_r, or its final value, (start,)."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None
    """Eq. 11, if the walks accelerate."""
    at_speed: bool = False
    """Whether they begin at their final velocity, and accelerate only after a restart or `slow_down`."""

    def begin(self, threads: int | None = 1) -> Plan:
        """Return a new plan."""
        arguments = self.starts, self.velocity, self.stride, self.acceleration, threads
        if self.at_speed:
            return begin_at_speed(cast(SteerableController, self.controller), *arguments)
        return begin(self.controller, *arguments)

    @cached_property
    def walk(self) -> PlannedWalk:
        """All steps at once."""
        return advanced(self.begin(), STEPS)

    @cached_property
    def in_parts(self) -> PlannedWalk:
        """All steps in the parts of `DIVIDED`."""
        plan = self.begin()
        return joined([advanced(plan, steps) for steps in DIVIDED])

    @property
    def every_other(self) -> np.ndarray:
        """Every other start, (start,) of bool."""
        return np.arange(len(self.starts)) % 2 == 0

    def of(self, which: Any) -> "Trial":
        """Return the trial of some starts."""
        return replace(self, starts=self.starts[which], velocity=self.velocity[which])


def _mixed(walk: PlannedWalk, which: np.ndarray, other: PlannedWalk) -> PlannedWalk:
    """Return a walk in which some starts, (start,), walk as in a walk of these starts alone."""
    walk = copied(walk)
    for name in (*PLANNED, "velocity"):
        getattr(walk, name)[:, which] = getattr(other, name)
    return walk


def _same(first: PlannedWalk, second: PlannedWalk, what: str, before: int = 0) -> None:
    """Raise InputError if two walks of the same starts differ; `before` steps precede both."""
    if differs := difference(first, second, before):
        raise InputError(f"{what} differ: {differs}; expected the same bits")


def _settings(trial: Trial) -> None:
    controller: Any = trial.controller
    if not controller.__dataclass_params__.frozen:
        raise InputError("the dataclass is not frozen; expected @dataclass(frozen=True)")
    settings_of(controller)


def _begin(trial: Trial) -> None:
    check_velocities(trial.controller, sorted({*trial.velocity.tolist()}), trial.stride, trial.acceleration)
    trial.begin()


def _steps(trial: Trial) -> None:
    starts, velocity, controller = trial.starts.copy(), trial.velocity.copy(), copy(trial.controller)
    plan = trial.controller.begin(starts, velocity, trial.stride, trial.acceleration)
    advanced(plan, STEPS)
    for name, now, expected in (
        ("starts", starts, trial.starts),
        ("velocity", velocity, trial.velocity),
        ("the plan's starts", plan.starts, trial.starts),
    ):
        if not np.array_equal(now, expected):
            raise InputError(f"{name} changed during the walk; expected the plan to work on a copy")
    settings: Any = trial.controller
    for field in fields(settings):
        if getattr(settings, field.name) is not getattr(controller, field.name):
            raise InputError(f"begin changes {field.name} of the controller")


def _times(trial: Trial) -> None:
    time, v = trial.in_parts.time, trial.in_parts.velocity
    expected = np.arange(1, STEPS + 1) * trial.stride.dt
    if not np.array_equal(time, expected):
        raise InputError(f"time is {time[:3]} to {time[-1]}; expected k dt, {expected[:3]} to {expected[-1]}")
    commanded = commanded_velocities(trial.velocity, 0, STEPS, trial.stride, trial.acceleration)
    if (bad := np.argwhere(v != commanded)).size:
        step, start = bad[0]
        raise InputError(
            f"velocity of step {step}, start {start} is {v[step, start]:.6g}; expected"
            f" {commanded[step, start]:.6g}, V_r as commanded (timing.commanded_velocities)"
        )


def _reach(trial: Trial) -> None:
    walk, stride = trial.walk, trial.stride
    line, span = np.array(stride.geometry.y), stride.aep0 - stride.pep0
    beyond, aside = REACH + 2 * stride.dt, BESIDE * np.abs(line)
    along = stride.pep_min - beyond, stride.aep0 + beyond
    limits = {"x": along, "y": (line - aside, line + aside), "aep": along, "height": (-span / 2, span)}
    for name, (low, high) in limits.items():
        values = getattr(walk, name)
        if (bad := np.argwhere((values < low) | (values > high))).size:
            at = tuple(bad[0])
            low, high = (np.broadcast_to(end, values.shape)[at] for end in (low, high))
            raise InputError(f"{name} is {values[at]:.4g} mm in {place(walk, at)}; expected {low:g} to {high:g} mm")


def _again(trial: Trial) -> None:
    _same(trial.walk, advanced(trial.begin(), STEPS), "two plans with the same arguments")
    _same(trial.walk, advanced(trial.begin(threads=2), STEPS), "plans with 1 and 2 threads")


def _divided(trial: Trial) -> None:
    _same(trial.walk, trial.in_parts, f"{STEPS} steps at once and in parts of {DIVIDED}")


def _side_by_side(trial: Trial) -> None:
    other = replace(trial, starts=trial.starts[::-1], velocity=trial.velocity[::-1])
    plans = [trial.begin(), other.begin()]
    walks = zip(*([advanced(plan, steps) for plan in plans] for steps in DIVIDED), strict=True)
    for alone, parts in zip((trial.walk, other.walk), walks, strict=True):
        _same(alone, joined(parts), "a plan alone and beside another plan of the controller")


def _batch(trial: Trial) -> None:
    n = len(trial.starts)
    for which in ([0], [n - 2], [1, n - 1, 2], [*range(n)[::-1]], np.arange(3 * n) % n):
        _same(of_starts(trial.walk, which), trial.of(which).walk, "starts alone, in another order or among others")


def _fast_losses(trial: Trial) -> None:
    plan: Any = trial.begin()
    if hasattr(plan, "first_losses"):
        steps = STEPS * (len(trial.starts) - np.arange(len(trial.starts))) // len(trial.starts)
        fast, planned = plan.first_losses(steps.copy()), planned_losses(trial.begin(), steps)
        if not np.array_equal(fast, planned):
            raise InputError(f"first_losses returns the steps {fast}; expected {planned}")


def _at_speed(trial: Trial) -> None:
    if is_steerable(trial.controller):
        usual = replace(trial, acceleration=None).walk
        _same(usual, replace(trial, at_speed=True).walk, "begin without an acceleration, and begin_at_speed,")


def _mirrored(trial: Trial) -> None:
    if getattr(trial.controller, "mirrored", False):
        other = replace(trial, starts=trial.starts[:, MIRROR]).walk
        back = replace(other, **{name: getattr(other, name)[..., MIRROR] for name in PLANNED})
        _same(trial.walk, replace(back, y=-back.y), "walks from mirrored starts, mirrored back,")


def _steerable(trial: Trial) -> Iterator[tuple[Trial, SteerablePlan]]:
    """Yield the trial, and that at speed, each with a new plan, as far as plans can be steered."""
    for variant in (trial, replace(trial, at_speed=True))[: 1 + is_steerable(trial.controller)]:
        plan = variant.begin()
        if isinstance(plan, SteerablePlan):
            yield variant, plan


def _seen(trial: Trial) -> None:
    for variant, plan in _steerable(trial):
        last = advanced(plan, BEFORE)
        _check_legs(plan, last.x[-1], last.stance[-1], "after a step")
        tips, standing = last.x[-1, ::-1].copy(), last.stance[-1, ::-1].copy()
        plan.see(tips.copy(), standing.copy())
        _check_legs(plan, tips, standing, "after see")
        on, which = advanced(plan, AFTER), ~trial.every_other
        advanced(alone := variant.of(which).begin(), BEFORE)
        cast(SteerablePlan, alone).see(tips[which].copy(), standing[which].copy())
        expected = _mixed(on, which, advanced(alone, AFTER))
        _same(on, expected, "starts alone and among others after see", BEFORE)


def _restarted(trial: Trial) -> None:
    for variant, plan in _steerable(trial):
        which, last = trial.every_other, advanced(plan, BEFORE)
        others = replace(trial, starts=trial.starts[::-1])
        plan.restart(which.copy(), others.starts.copy())
        tips = np.where(which[:, None], others.starts, last.x[-1])
        _check_legs(plan, tips, which[:, None] | last.stance[-1], "after restart of some starts")
        on, begun = advanced(plan, AFTER), advanced(others.begin(), AFTER)
        _same(on, _mixed(on, which, of_starts(begun, which)), "starts after restart and after begin")
        later = of_starts(_later(variant), ~which)
        _same(on, _mixed(on, ~which, later), "starts alone and beside some that restart", BEFORE)


def _slowed(trial: Trial) -> None:
    for variant, plan in _steerable(trial):
        which, last, v = trial.every_other, advanced(plan, BEFORE), trial.velocity
        plan.slow_down(which.copy())
        _check_legs(plan, last.x[-1], last.stance[-1], "after slow_down")
        ages = np.where(which, 0, AT_SPEED if variant.at_speed else BEFORE)
        on, commanded = advanced(plan, AFTER), commanded_velocities(v, ages, AFTER, trial.stride, trial.acceleration)
        if (bad := np.argwhere(on.velocity != commanded)).size:
            step, start = bad[0]
            raise InputError(
                f"velocity of start {start}{'' if which[start] else ', which was not slowed down,'} is"
                f" {on.velocity[step, start]:.6g} in step {step + 1} after slow_down; expected"
                f" {commanded[step, start]:.6g}"
            )
        as_fast = ~which if trial.acceleration else np.ones_like(which)
        later = of_starts(_later(variant), as_fast)
        _same(on, _mixed(on, as_fast, later), "starts that are not slowed down, with and without slow_down,", BEFORE)


def _later(trial: Trial) -> PlannedWalk:
    """Return the steps after `BEFORE` of a plan that is not steered."""
    advanced(plan := trial.begin(), BEFORE)
    return advanced(plan, AFTER)


def _check_legs(plan: SteerablePlan, tips: np.ndarray, standing: np.ndarray, when: str) -> None:
    """Raise InputError unless a plan's own tips and states are these, (start, leg)."""
    for name, expected in (("tips", tips), ("standing", standing)):
        found = np.asarray(getattr(plan, name))
        if found.shape != expected.shape:
            raise InputError(f"{name} has the shape {found.shape} {when}; expected {expected.shape}")
        if (bad := np.argwhere(found != expected)).size:
            start, leg = bad[0]
            raise InputError(
                f"{name} of start {start}, leg {LEGS[leg]} is {found[start, leg]!s} {when}; expected"
                f" {expected[start, leg]!s}"
            )


def _sensed(trial: Trial) -> None:
    """After half of the steps every other one of the starts that are sensed has fallen."""
    if isinstance(plan := trial.begin(), FeedbackPlan):
        which, last = trial.every_other, len(trial.starts) - 2
        felt = np.random.default_rng(0).uniform(-1.0, 1.0, (SENSED_STEPS, len(which), NUMBERS))
        felt[:, ~which] = felt[SENSED_STEPS // 2 :, ::4] = np.nan
        walk = _with_sense(trial, felt)
        unsensed = of_starts(advanced(plan, len(walk.time)), ~which)
        _same(walk, _mixed(walk, ~which, unsensed), "starts that are not sensed")
        alone = _with_sense(trial.of([last]), felt[:, [last]])
        _same(walk, _mixed(walk, np.arange(len(which)) == last, alone), "a sensed start beside others and alone")


def _with_sense(trial: Trial, felt: np.ndarray) -> PlannedWalk:
    """Return steps of a plan that senses `felt`, (step, start, number), for the starts that are not NaN."""
    plan: Any = trial.begin()
    parts = [advanced(plan, 1)]
    for numbers in felt:
        ids = np.flatnonzero(np.isfinite(numbers[:, 0]))
        sensed, before = (_legs_as_planned(parts[-1], ids, trial.stride, numbers[ids]) for _ in range(2))
        plan.sense(sensed)
        for field in fields(Sensed):
            if not np.array_equal(getattr(sensed, field.name), getattr(before, field.name)):
                raise InputError(f"sense changes {field.name} of its argument; expected it to work on a copy")
        parts.append(advanced(plan, 1))
    return joined(parts)


def _legs_as_planned(walk: PlannedWalk, ids: np.ndarray, stride: Stride, numbers: np.ndarray) -> Sensed:
    """Return what legs sense that follow the plan, with standing feet 10 mm below the root.

    Contacts, joints and the root's motion are made of numbers between -1 and 1, (n, number).
    """
    x, y, stance, height = (getattr(walk, name)[-1, ids] for name in ("x", "y", "stance", "height"))
    tips = np.stack([x + np.array(stride.geometry.origin), y, np.nan_to_num(height) - 10.0], axis=-1)
    chance, joints, torques, tilt, velocity, turning = np.split(numbers, [6, 24, 42, 44, 47], axis=1)
    contact = stance ^ (chance > 0.96)
    gained, lost = contact & (chance > 0.9), ~contact & (chance > 0.9)
    load = np.where(contact, 9810.0 / np.maximum(contact.sum(axis=1, keepdims=True), 1), 0.0)
    angles, moments = 0.5 * joints.reshape(tips.shape), 1e4 * torques.reshape(tips.shape)
    return Sensed(
        ids.copy(), tips, contact, gained, lost, load, angles, moments, 0.1 * tilt, 80.0 * velocity, turning.copy()
    )


LAWS: dict[str, tuple[Callable[[Trial], None], str]] = {
    "settings": (_settings, "a frozen dataclass with a name, its settings plain data"),
    "begin": (_begin, "plans begin at time 0 with the starts and stride of their arguments"),
    "steps": (_steps, "finite tips, and stance, aep and height of every step, start and leg; arguments do not change"),
    "times": (_times, "time is k dt, and velocity is V_r as commanded"),
    "reach": (_reach, "tips lie within the reach of the legs"),
    "begun again": (_again, "plans with the same arguments are the same walk, with any number of threads"),
    "divided": (_divided, "the walk does not depend on how steps are divided into calls"),
    "side by side": (_side_by_side, "two plans that advance in turn are independent"),
    "batch": (_batch, "a start walks alike alone, in another order and among others"),
    "first losses": (_fast_losses, "first_losses, where plans have it, are those of the plan"),
    "at speed": (_at_speed, "begin_at_speed, where there is one, walks as begin does without an acceleration"),
    "see": (_seen, "a steerable plan is where its last step says, and continues from other legs after see"),
    "restart": (_restarted, "starts that restart walk as they begin, and the others are not affected"),
    "slow down": (_slowed, "starts that are slowed down begin at V_r(0) again, and the others are not affected"),
    "mirrored": (_mirrored, "mirrored starts give mirrored walks, where the controller is mirrored"),
    "sense": (_sensed, "with sensory feedback a start depends on what is sensed of it, and of no other"),
}
"""Every interface check by its name, and what holds where it passes."""

FIRST = ("begin", "steps", "begun again", "divided")
"""Checks on which all later ones rest."""
