"""The interface checks of controllers: each is a function that takes a `Trial` and raises InputError if it fails."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hexmj.controllers.planning import (
    advanced,
    begin,
    check_same,
    check_velocities,
    place,
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
from hexmj.timing import Acceleration, Stride, commanded_velocities
from hexmj.walks import PLANNED, PlannedWalk, joined, of_starts

N_STARTS, STEPS = 16, 600
"""Number of starts of a trial, and of steps of its walk: 60 time units, a swing and a stance at V = 0.5."""

EVERY_OTHER = np.arange(N_STARTS) % 2 == 0
"""(start,) mask of every second start."""

DIVIDED = (1, 7, 250, 342)
"""The `STEPS` steps of a trial, divided into four calls of `advance`."""

REACH = 0.8
"""Allowed distance of a tip beyond PEP_min or AEP_0 on its own axis [mm], in addition to two time steps at V_p: a leg
passes either limit by up to one step, and a leg that lifts off beyond AEP_0 swings for a second step."""

BESIDE = 0.5
"""Allowed lateral distance of a tip from its leg's line, as a fraction of the line's distance from the body axis."""

PART = 250
"""Number of steps between calls that steer a plan: 25 time units, 1.25 times the duration of a swing."""

SENSED_STEPS, NUMBERS = 99, 50
"""Number of steps in which a plan senses, and of random numbers per start and step: 6 for contacts, 18 for joint
angles, 18 for torques, 2 for tilt, 3 for velocity and 3 for turning."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A controller and the arguments of the walks that it plans in a check."""

    controller: Controller
    """The controller that is checked."""
    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    velocity: np.ndarray
    """(start,) V_r, or its final value when accelerating."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None
    """Acceleration of Eq. 11, or None for constant V_r."""
    at_speed: bool = False
    """Whether plans begin at their final velocity and accelerate only after `restart` or `slow_down`."""

    def begin(self, threads: int | None = 1) -> Plan:
        """Return a new plan of these walks."""
        arguments = self.starts, self.velocity, self.stride, self.acceleration, threads
        return begin(self.controller, *arguments, self.at_speed)

    @cached_property
    def walk(self) -> PlannedWalk:
        """The first `STEPS` steps of the walks, planned in one call."""
        return advanced(self.begin(), STEPS)

    def of(self, which: Any) -> "Trial":
        """Return the same trial with only the starts that `which` selects."""
        return replace(self, starts=self.starts[which], velocity=self.velocity[which])


def _settings(trial: Trial) -> None:
    """The controller is a frozen dataclass with a name, and its settings are plain data."""
    controller: Any = trial.controller
    if not controller.__dataclass_params__.frozen:
        raise InputError("the dataclass is not frozen; expected @dataclass(frozen=True)")
    settings_of(controller)


def _begin(trial: Trial) -> None:
    """Plans begin at time 0 with the given starts and stride."""
    check_velocities(trial.controller, sorted({*trial.velocity.tolist()}), trial.stride, trial.acceleration)
    trial.begin()


def _steps(trial: Trial) -> None:
    """Every step has finite tips, and stance, AEP and height for all starts and legs; planning changes no argument."""
    starts, velocity = trial.starts.copy(), trial.velocity.copy()
    plan = trial.controller.begin(starts, velocity, trial.stride, trial.acceleration)
    advanced(plan, STEPS)
    _check_equal("starts after the walk", starts, trial.starts)
    _check_equal("velocity after the walk", velocity, trial.velocity)
    _check_equal("the plan's starts after the walk", plan.starts, trial.starts)


def _times(trial: Trial) -> None:
    """Step k ends at time k dt, and velocity is the commanded V_r (`timing.commanded_velocities`)."""
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
    """Plans with the same arguments give the same walk, with any number of threads."""
    check_same(trial.walk, advanced(trial.begin(), STEPS), "two plans with the same arguments")
    check_same(trial.walk, advanced(trial.begin(threads=2), STEPS), "plans with 1 and 2 threads")


def _divided(trial: Trial) -> None:
    """Several short calls of `advance` give the same walk as one long call."""
    plan = trial.begin()
    walk = joined([advanced(plan, steps) for steps in DIVIDED])
    _check_equal("time (step) in parts", walk.time, trial.walk.time)
    check_same(trial.walk, walk, f"{STEPS} steps at once and in parts of {DIVIDED}")


def _batch(trial: Trial) -> None:
    """A start walks in the same way alone, in another order and among other starts."""
    n = len(trial.starts)
    for which in ([0], [n - 2], [1, n - 1, 2], [*range(n)[::-1]], np.arange(3 * n) % n):
        check_same(of_starts(trial.walk, which), trial.of(which).walk, "starts alone, in another order or among others")


def _at_speed(trial: Trial) -> None:
    """A plan of begin_at_speed, if there is one, walks like a plan of begin without an acceleration."""
    if isinstance(trial.controller, SteerableController):
        constant = replace(trial, acceleration=None).walk
        check_same(constant, replace(trial, at_speed=True).walk, "begin without an acceleration, and begin_at_speed,")


def _mirrored(trial: Trial) -> None:
    """Mirrored starts give mirrored walks, if the controller has `mirrored = True`."""
    if getattr(trial.controller, "mirrored", False):
        other = replace(trial, starts=trial.starts[:, MIRROR]).walk
        back = replace(other, **{name: getattr(other, name)[..., MIRROR] for name in PLANNED})
        check_same(trial.walk, replace(back, y=-back.y), "walks from mirrored starts, mirrored back,")


def _steering(trial: Trial) -> None:
    """A steerable plan continues from given legs, slows down and restarts, which affects no other start."""
    plan, which, others = trial.begin(), EVERY_OTHER, replace(trial, starts=trial.starts[::-1])
    if not isinstance(plan, SteerablePlan):
        return
    last = advanced(plan, PART)
    _check_legs("after a step", plan, last.x[-1], last.stance[-1])
    tips, standing = last.x[-1, ::-1].copy(), last.stance[-1, ::-1].copy()
    plan.see(tips.copy(), standing.copy())
    _check_legs("after see", plan, tips, standing)
    walks = [advanced(plan, PART)]
    plan.slow_down(which.copy())
    _check_legs("after slow_down", plan, walks[-1].x[-1], walks[-1].stance[-1])
    walks.append(last := advanced(plan, PART))
    ages = np.where(which, 0, 2 * PART)
    commanded = commanded_velocities(trial.velocity, ages, PART, trial.stride, trial.acceleration)
    _check_equal("velocity (step, start) after slow_down", last.velocity, commanded)
    plan.restart(which.copy(), others.starts.copy())
    new: Any = others.begin()
    restarted = (np.where(which[:, None], *legs) for legs in ((new.tips, last.x[-1]), (new.standing, last.stance[-1])))
    _check_legs("after restart of some starts", plan, *restarted)
    walks.append(advanced(plan, PART))
    begun = advanced(others.of(which).begin(), PART)
    check_same(of_starts(walks[-1], which), begun, "starts after restart and after begin")
    for part, n in (which, 2), (~which, 3):  # the starts that restart are compared until they do
        alone: Any = trial.of(part).begin()
        advanced(alone, PART)
        alone.see(tips[part], standing[part])
        parts = [advanced(alone, PART)]
        if part is which and trial.acceleration:
            alone.slow_down(np.ones(part.sum(), dtype=bool))
        parts += [advanced(alone, PART) for _ in walks[1:n]]
        check_same(of_starts(joined(walks[:n]), part), joined(parts), "steered starts alone and among others", PART)


def _sense(trial: Trial) -> None:
    """With sensory feedback, a start depends on the sensed state of its own legs and of no other start."""
    if isinstance(trial.begin(), FeedbackPlan):
        which, last = EVERY_OTHER, [len(trial.starts) - 2]
        felt = np.random.default_rng(0).uniform(-1.0, 1.0, (SENSED_STEPS, len(which), NUMBERS))
        felt[:, ~which] = felt[SENSED_STEPS // 2 :, ::4] = np.nan  # from the middle on, half of these have fallen
        walk, alone = _with_sense(trial, felt), _with_sense(trial.of(last), felt[:, last])
        unsensed = advanced(trial.of(~which).begin(), len(walk.time))
        check_same(of_starts(walk, ~which), unsensed, "starts that are not sensed")
        check_same(of_starts(walk, last), alone, "a sensed start beside others and alone")


def _check_equal(what: str, found: Any, expected: np.ndarray) -> None:
    """Raise InputError unless the array `found`, described by `what`, equals `expected` in shape and values."""
    found = np.asarray(found)
    if found.shape != expected.shape:
        raise InputError(f"{what} has the shape {found.shape}; expected {expected.shape}")
    if (bad := np.argwhere(found != expected)).size:
        at = tuple(bad[0].tolist())
        raise InputError(f"{what} is {found[at]!s} at {at}; expected {expected[at]!s}")


def _check_legs(when: str, plan: SteerablePlan, tips: np.ndarray, standing: np.ndarray) -> None:
    """Raise InputError unless the plan's tips and standing legs equal the given arrays, (start, leg)."""
    _check_equal(f"tips (start, leg) {when}", plan.tips, tips)
    _check_equal(f"standing (start, leg) {when}", plan.standing, standing)


def _with_sense(trial: Trial, felt: np.ndarray) -> PlannedWalk:
    """Return the walk of a plan that senses the numbers `felt`, (step, start, number); starts at NaN sense nothing."""
    plan: Any = trial.begin()
    parts = [advanced(plan, 1)]
    for numbers in felt:
        ids = np.flatnonzero(np.isfinite(numbers[:, 0]))
        plan.sense(_legs_as_planned(parts[-1], ids, trial.stride, numbers[ids]))
        parts.append(advanced(plan, 1))
    return joined(parts)


def _legs_as_planned(walk: PlannedWalk, ids: np.ndarray, stride: Stride, numbers: np.ndarray) -> Sensed:
    """Return the sensed state of legs that follow the plan, with standing feet 10 mm below the root.

    Contacts, joints and the root's motion are computed from `numbers`, (n, number), between -1 and 1.
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
        *(_settings, _begin, _steps, _times, _reach, _begun_again, _divided, _batch),
        *(_at_speed, _steering, _mirrored, _sense),
    )
}
"""Name -> interface check; the docstring of the check says what holds if the check passes."""

FIRST = ("begin", "steps", "begun again", "divided")
"""Names of the checks that all later checks rely on."""
