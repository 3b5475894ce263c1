"""The interface checks of controllers: each is a function of a trial walk that raises InputError where it fails."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from hexmj.controllers.planning import (
    advanced,
    begin,
    check_same,
    check_velocities,
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
    settings_of,
)
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.timing import AT_SPEED, Acceleration, Stride, commanded_velocities
from hexmj.walks import PLANNED, PlannedWalk, joined, of_starts

N_STARTS, STEPS = 16, 600
"""Starts of a trial and steps of its walk: 60 time units, a swing and a stance at V = 0.5."""

EVERY_OTHER = np.arange(N_STARTS) % 2 == 0
"""Every other start, (start,) of bool."""

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
        return begin(self.controller, *arguments, self.at_speed)

    @cached_property
    def walk(self) -> PlannedWalk:
        """All steps at once."""
        return advanced(self.begin(), STEPS)

    def of(self, which: Any) -> "Trial":
        """Return the trial of some starts."""
        return replace(self, starts=self.starts[which], velocity=self.velocity[which])


def _settings(trial: Trial) -> None:
    """The controller is a frozen dataclass with a name, its settings are plain data."""
    controller: Any = trial.controller
    if not controller.__dataclass_params__.frozen:
        raise InputError("the dataclass is not frozen; expected @dataclass(frozen=True)")
    settings_of(controller)


def _begin(trial: Trial) -> None:
    """Plans begin at time 0 with the starts and stride of their arguments."""
    check_velocities(trial.controller, sorted({*trial.velocity.tolist()}), trial.stride, trial.acceleration)
    trial.begin()


def _steps(trial: Trial) -> None:
    """Tips are finite, and stance, aep and height of every step, start and leg; arguments do not change."""
    starts, velocity, settings = trial.starts.copy(), trial.velocity.copy(), settings_of(trial.controller)
    plan = trial.controller.begin(starts, velocity, trial.stride, trial.acceleration)
    advanced(plan, STEPS)
    _check_equal("starts after the walk", starts, trial.starts)
    _check_equal("velocity after the walk", velocity, trial.velocity)
    _check_equal("the plan's starts after the walk", plan.starts, trial.starts)
    if (now := settings_of(trial.controller)) != settings:
        raise InputError(f"begin changes the controller to {now}; expected {settings}")


def _times(trial: Trial) -> None:
    """Time is k dt, and velocity is V_r as commanded (`timing.commanded_velocities`)."""
    commanded = commanded_velocities(trial.velocity, 0, STEPS, trial.stride, trial.acceleration)
    _check_equal("time (step)", trial.walk.time, np.arange(1, STEPS + 1) * trial.stride.dt)
    _check_equal("velocity (step, start)", trial.walk.velocity, commanded)


def _reach(trial: Trial) -> None:
    """Tips lie within the reach of the legs."""
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


def _begun_again(trial: Trial) -> None:
    """Plans with the same arguments are the same walk, with any number of threads."""
    check_same(trial.walk, advanced(trial.begin(), STEPS), "two plans with the same arguments")
    check_same(trial.walk, advanced(trial.begin(threads=2), STEPS), "plans with 1 and 2 threads")


def _divided(trial: Trial) -> None:
    """The walk does not depend on how steps are divided into calls."""
    plan = trial.begin()
    walk = joined([advanced(plan, steps) for steps in DIVIDED])
    _check_equal("time (step) in parts", walk.time, trial.walk.time)
    check_same(trial.walk, walk, f"{STEPS} steps at once and in parts of {DIVIDED}")


def _side_by_side(trial: Trial) -> None:
    """Two plans that advance in turn are independent."""
    other = replace(trial, starts=trial.starts[::-1], velocity=trial.velocity[::-1])
    plans = trial.begin(), other.begin()
    parts = zip(*([advanced(plan, steps) for plan in plans] for steps in DIVIDED), strict=True)
    for alone, walk in zip((trial.walk, other.walk), map(joined, parts), strict=True):
        check_same(alone, walk, "a plan alone and beside another plan of the controller")


def _batch(trial: Trial) -> None:
    """A start walks alike alone, in another order and among others."""
    n = len(trial.starts)
    for which in ([0], [n - 2], [1, n - 1, 2], [*range(n)[::-1]], np.arange(3 * n) % n):
        check_same(of_starts(trial.walk, which), trial.of(which).walk, "starts alone, in another order or among others")


def _first_losses(trial: Trial) -> None:
    """The plan's first_losses, if it has them, are those of its steps."""
    plan: Any = trial.begin()
    if hasattr(plan, "first_losses"):
        steps = STEPS * (len(trial.starts) - np.arange(len(trial.starts))) // len(trial.starts)
        _check_equal("first_losses (start)", plan.first_losses(steps.copy()), planned_losses(trial.begin(), steps))


def _at_speed(trial: Trial) -> None:
    """The plan of begin_at_speed, if there is one, walks as that of begin without an acceleration."""
    if isinstance(trial.controller, SteerableController):
        usual = replace(trial, acceleration=None).walk
        check_same(usual, replace(trial, at_speed=True).walk, "begin without an acceleration, and begin_at_speed,")


def _mirrored(trial: Trial) -> None:
    """Mirrored starts give mirrored walks, if the controller is mirrored."""
    if getattr(trial.controller, "mirrored", False):
        other = replace(trial, starts=trial.starts[:, MIRROR]).walk
        back = replace(other, **{name: getattr(other, name)[..., MIRROR] for name in PLANNED})
        check_same(trial.walk, replace(back, y=-back.y), "walks from mirrored starts, mirrored back,")


def _see(trial: Trial) -> None:
    """A steerable plan is where its last step says, and continues from other legs after see."""
    for variant, plan in _steerable(trial):
        last, which = advanced(plan, BEFORE), EVERY_OTHER
        _check_legs("after a step", plan, last.x[-1], last.stance[-1])
        tips, standing = last.x[-1, ::-1].copy(), last.stance[-1, ::-1].copy()
        plan.see(tips.copy(), standing.copy())
        _check_legs("after see", plan, tips, standing)
        alone: Any = variant.of(~which).begin()
        advanced(alone, BEFORE)
        alone.see(tips[~which], standing[~which])
        on = of_starts(advanced(plan, AFTER), ~which)
        check_same(on, advanced(alone, AFTER), "starts alone and among others after see", BEFORE)


def _restart(trial: Trial) -> None:
    """Starts that restart walk as they begin, and the others are not affected."""
    for variant, plan in _steerable(trial):
        last, which = advanced(plan, BEFORE), EVERY_OTHER
        others = replace(trial, starts=trial.starts[::-1])
        plan.restart(which.copy(), others.starts.copy())
        tips = np.where(which[:, None], others.starts, last.x[-1])
        _check_legs("after restart of some starts", plan, tips, which[:, None] | last.stance[-1])
        on, begun = advanced(plan, AFTER), advanced(others.of(which).begin(), AFTER)
        check_same(of_starts(on, which), begun, "starts after restart and after begin")
        later = _later(variant.of(~which))
        check_same(of_starts(on, ~which), later, "starts alone and beside some that restart", BEFORE)


def _slow_down(trial: Trial) -> None:
    """Starts that are slowed down begin at V_r(0) again, and the others are not affected."""
    for variant, plan in _steerable(trial):
        last, which = advanced(plan, BEFORE), EVERY_OTHER
        plan.slow_down(which.copy())
        _check_legs("after slow_down", plan, last.x[-1], last.stance[-1])
        on, ages = advanced(plan, AFTER), np.where(which, 0, AT_SPEED if variant.at_speed else BEFORE)
        commanded = commanded_velocities(trial.velocity, ages, AFTER, trial.stride, trial.acceleration)
        _check_equal("velocity (step, start) after slow_down", on.velocity, commanded)
        as_fast = ~which if trial.acceleration else np.ones_like(which)
        later = _later(variant.of(as_fast))
        check_same(of_starts(on, as_fast), later, "starts with and beside slow_down", BEFORE)


def _sense(trial: Trial) -> None:
    """With sensory feedback a start depends on what is sensed of it, and of no other."""
    if isinstance(trial.begin(), FeedbackPlan):
        which, last = EVERY_OTHER, [len(trial.starts) - 2]
        felt = np.random.default_rng(0).uniform(-1.0, 1.0, (SENSED_STEPS, len(which), NUMBERS))
        felt[:, ~which] = felt[SENSED_STEPS // 2 :, ::4] = np.nan  # half of the sensed starts have fallen then
        walk, alone = _with_sense(trial, felt), _with_sense(trial.of(last), felt[:, last])
        unsensed = advanced(trial.of(~which).begin(), len(walk.time))
        check_same(of_starts(walk, ~which), unsensed, "starts that are not sensed")
        check_same(of_starts(walk, last), alone, "a sensed start beside others and alone")


def _check_equal(what: str, found: Any, expected: np.ndarray) -> None:
    """Raise InputError unless an array is as expected."""
    found = np.asarray(found)
    if found.shape != expected.shape:
        raise InputError(f"{what} has the shape {found.shape}; expected {expected.shape}")
    if (bad := np.argwhere(found != expected)).size:
        at = tuple(bad[0].tolist())
        raise InputError(f"{what} is {found[at]!s} at {at}; expected {expected[at]!s}")


def _steerable(trial: Trial) -> Iterator[tuple[Trial, SteerablePlan]]:
    """Yield the trial, and that at speed, each with a new plan, as far as plans can be steered."""
    at_speed = [replace(trial, at_speed=True)] * isinstance(trial.controller, SteerableController)
    for variant in (trial, *at_speed):
        plan = variant.begin()
        if isinstance(plan, SteerablePlan):
            yield variant, plan


def _check_legs(when: str, plan: SteerablePlan, tips: np.ndarray, standing: np.ndarray) -> None:
    """Raise InputError unless a plan's own tips and states are these, (start, leg)."""
    _check_equal(f"tips (start, leg) {when}", plan.tips, tips)
    _check_equal(f"standing (start, leg) {when}", plan.standing, standing)


def _later(trial: Trial) -> PlannedWalk:
    """Return the steps after `BEFORE` of a plan that is not steered."""
    advanced(plan := trial.begin(), BEFORE)
    return advanced(plan, AFTER)


def _with_sense(trial: Trial, felt: np.ndarray) -> PlannedWalk:
    """Return steps of a plan that senses `felt`, (step, start, number), for the starts that are not NaN."""
    plan: Any = trial.begin()
    parts = [advanced(plan, 1)]
    for numbers in felt:
        ids = np.flatnonzero(np.isfinite(numbers[:, 0]))
        sensed, before = (_legs_as_planned(parts[-1], ids, trial.stride, numbers[ids]) for _ in range(2))
        plan.sense(sensed)
        for field in fields(Sensed):
            _check_equal(f"{field.name} after sense", getattr(sensed, field.name), getattr(before, field.name))
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


LAWS: dict[str, Callable[[Trial], None]] = {
    law.__name__.strip("_").replace("_", " "): law
    for law in (
        *(_settings, _begin, _steps, _times, _reach, _begun_again, _divided, _side_by_side, _batch, _first_losses),
        *(_at_speed, _see, _restart, _slow_down, _mirrored, _sense),
    )
}
"""Every interface check by its name; its docstring says what holds if it passes."""

FIRST = ("begin", "steps", "begun again", "divided")
"""Checks on which all later ones rest."""
