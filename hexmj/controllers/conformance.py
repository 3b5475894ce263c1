"""Does a controller keep the laws of `protocol`?  `check_controller` asks, from pytest or the command line.

Every law is one function: from a trial, a controller with starts, velocities and a stride, to a sentence for each thing
that is wrong.  On paper nobody knows the legs, so reach is that of the stride: tips within `REACH` of its range.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from hexmj.controllers.losses import planned_losses
from hexmj.controllers.protocol import (
    Controller,
    FastLosses,
    Plan,
    ReadingPlan,
    Sensed,
    check_controller_type,
    claims_mirrored,
    settings_of,
)
from hexmj.legs import LEGS, MIRROR
from hexmj.starts import draw_starts
from hexmj.timing import Acceleration, Stride, commanded_velocities
from hexmj.walks import PLANNED, PlannedWalk, joined

VELOCITIES = (0.0, 0.02, 0.5, 0.95)
"""V_r of the starts of a trial, in turn."""

ACCELERATION = Acceleration(rate=0.005, start=0.1)
"""Of a trial that accelerates: V = 0.3 is reached after 40 time units."""

SEEDS = (0, 1)
"""Of the starts."""

N_STARTS, STEPS = 8, 600
"""Starts of a trial and steps of its walk: 60 time units, a swing and a stance at V = 0.5."""

DIVIDED = (1, 7, 250, 342)
"""The same steps in parts."""

REACH = 1.0
"""How far a tip may be beyond PEP_min or AEP_0 on its own axis [mm]; legs overshoot both by a step."""

BESIDE = 0.5
"""How far a tip may be from its leg's line, as a part of the line's distance from the body axis."""


@dataclass(frozen=True)
class Finding:
    """What one law has found."""

    name: str
    """Of the law."""
    well: bool
    """Whether it is kept."""
    found: str
    """One sentence: what is wrong, with values, or what was looked at."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Some walks that a controller is asked for."""

    controller: Controller
    starts: np.ndarray
    """(start, leg) [mm]."""
    velocity: np.ndarray
    """(start,)."""
    stride: Stride
    acceleration: Acceleration | None

    def begin(self, threads: int | None = 1) -> Plan:
        """A new plan."""
        return self.controller.begin(self.starts.copy(), self.velocity.copy(), self.stride, self.acceleration, threads)

    @cached_property
    def walk(self) -> PlannedWalk:
        """All steps at once."""
        return self.begin().advance(STEPS)

    def of(self, which: Any) -> "Trial":
        """The same of some starts."""
        return replace(self, starts=self.starts[which], velocity=self.velocity[which])

    def __str__(self) -> str:
        """What stands before a sentence on it."""
        return "accelerating: " if self.acceleration else ""


Law = Callable[[Trial], Iterator[str]]


def check_controller(controller: object, stride: Stride | None = None) -> None:
    """Hold a controller to the laws of its protocol; takes a second or a few.

    Raises:
        InputError: no controller.
        AssertionError: a law that is not kept, in one sentence.
    """
    for finding in findings(controller, stride):
        if not finding.well:
            raise AssertionError(f"{finding.name}: {finding.found}")


def findings(controller: object, stride: Stride | None = None) -> Iterator[Finding]:
    """What each law finds, in order; the laws after one that is broken may break with it.

    Raises:
        InputError: no controller.
    """
    check_controller_type(controller)
    trials = [*_trials(controller, stride or Stride())]  # pyright: ignore[reportArgumentType]
    for name, (law, looked_at) in LAWS.items():
        wrong = next(_wrong(law, trials), None)
        yield Finding(name, wrong is None, wrong or looked_at)


def _trials(controller: Controller, stride: Stride) -> Iterator[Trial]:
    """Starts that are drawn and extreme, at several velocities at once, constant and accelerating."""
    velocity = np.resize(VELOCITIES, N_STARTS)
    for seed in SEEDS:
        starts = draw_starts(N_STARTS, seed, stride)
        starts[-1] = stride.pep0 if seed % 2 else stride.aep0
        yield Trial(controller, starts, velocity, stride, None)
        yield Trial(controller, starts, np.maximum(velocity, ACCELERATION.start), stride, ACCELERATION)


def _wrong(law: Law, trials: list[Trial]) -> Iterator[str]:
    for trial in trials:
        try:
            for sentence in law(trial):
                yield f"{trial}{sentence}"
        except Exception as error:  # whatever the user's code raises
            yield f"{trial}it raises {type(error).__name__}: {error}"


def _settings(trial: Trial) -> Iterator[str]:
    controller: Any = trial.controller
    if not controller.__dataclass_params__.frozen:
        yield "the dataclass is not frozen; expected @dataclass(frozen=True), so that settings stay as they are"
    if not (isinstance(controller.name, str) and controller.name):
        yield f"name = {controller.name!r}; expected a text"
    try:
        json.dumps(settings_of(controller))
    except TypeError as error:
        yield f"the fields are no plain data ({error}); expected numbers, texts, lists and dicts"


def _begin(trial: Trial) -> Iterator[str]:
    starts, velocity = trial.starts.copy(), trial.velocity.copy()
    plan = trial.controller.begin(starts, velocity, trial.stride, trial.acceleration)
    if not isinstance(plan, Plan):
        yield f"begin gives {plan!r:.100}; expected a plan with starts, stride, done and advance"
        return
    if plan.done != 0:
        yield f"begin gives a plan {plan.done} steps past its begin; expected one at time 0"
    if not np.array_equal(plan.starts, trial.starts):
        yield f"the plan's starts are {np.shape(plan.starts)} others; expected those that it was begun with"
    if plan.stride != trial.stride:
        yield f"the plan's stride is {plan.stride}; expected {trial.stride}"
    plan.advance(STEPS)
    if plan.done != STEPS:
        yield f"done = {plan.done} after {STEPS} steps; expected {STEPS}"
    for name, now, before in (("starts", starts, trial.starts), ("velocity", velocity, trial.velocity)):
        if not np.array_equal(now, before):
            yield f"{name} are changed for the caller; expected the plan to work on a copy"
    if not np.array_equal(plan.starts, trial.starts):
        yield "the plan's starts change as it goes on; expected those that it was begun with"


def _shapes(trial: Trial) -> Iterator[str]:
    walk = trial.walk
    if not isinstance(walk, PlannedWalk):
        yield f"advance gives {walk!r:.100}; expected a PlannedWalk"
        return
    shape = (STEPS, *trial.starts.shape)
    for name in PLANNED:
        values, kind = np.asarray(getattr(walk, name)), np.dtype(bool if name == "stance" else float)
        if values.shape != shape:
            yield f"{name} has the shape {values.shape}; expected (step, start, leg), {shape}"
        if values.dtype != kind:
            yield f"{name} is of type {values.dtype}; expected {kind}"
    if walk.geometry != trial.stride.geometry:
        yield f"geometry = {walk.geometry}; expected that of the stride, {trial.stride.geometry}"


def _times(trial: Trial) -> Iterator[str]:
    plan = trial.begin()
    parts = [plan.advance(steps) for steps in DIVIDED]
    time = np.concatenate([part.time for part in parts])
    expected = np.arange(1, STEPS + 1) * trial.stride.dt
    if time.shape != expected.shape or not np.array_equal(time, expected):
        yield f"time begins with {time[:3]} and ends at {time[-1]}; expected k dt, {expected[:3]} to {expected[-1]}"
    v = np.concatenate([part.velocity for part in parts])
    commanded = commanded_velocities(trial.velocity, 0, STEPS, trial.stride, trial.acceleration)
    if v.shape != commanded.shape:
        yield f"velocity has the shape {v.shape}; expected (step, start), {commanded.shape}"
    elif not np.array_equal(v, commanded):
        step, start = np.argwhere(v != commanded)[0]
        yield (
            f"velocity of step {step}, start {start} is {v[step, start]:.6g}; expected V_r as commanded,"
            f" {commanded[step, start]:.6g} (timing.commanded_velocities)"
        )


def _finite(trial: Trial) -> Iterator[str]:
    walk = trial.walk
    for name in ("x", "y"):
        if (bad := np.argwhere(~np.isfinite(values := getattr(walk, name)))).size:
            yield f"{name} is {values[tuple(bad[0])]} in {_place(walk, bad[0])}; expected a number"
    for name in ("aep", "height"):
        if (bad := np.argwhere(np.isinf(getattr(walk, name)))).size:
            yield f"{name} is infinite in {_place(walk, bad[0])}; expected a number, or NaN where nothing tells"


def _reach(trial: Trial) -> Iterator[str]:
    stride, walk = trial.stride, trial.walk
    line, span = np.array(stride.geometry.y), stride.aep0 - stride.pep0
    aside = BESIDE * np.abs(line)
    limits = {
        "x": (walk.x, stride.pep_min - REACH, stride.aep0 + REACH),
        "y": (walk.y, line - aside, line + aside),
        "aep": (walk.aep, stride.pep_min - REACH, stride.aep0 + REACH),
        "height": (walk.height, -span / 2, span),
    }
    for name, (values, low, high) in limits.items():
        if (bad := np.argwhere((values < low) | (values > high))).size:
            at = tuple(bad[0])
            low, high = (np.broadcast_to(end, values.shape)[at] for end in (low, high))
            yield f"{name} is {values[at]:.4g} mm in {_place(walk, at)}; expected {low:g} to {high:g} mm"


def _again(trial: Trial) -> Iterator[str]:
    first, second = trial.begin(), trial.begin()
    one = first.advance(STEPS)
    yield from _difference(one, second.advance(STEPS), "two plans that are begun alike")
    yield from _difference(one, trial.begin(threads=2).advance(STEPS), "with 1 and 2 threads")


def _batch(trial: Trial) -> Iterator[str]:
    n = len(trial.starts)
    for which in ([0], [n - 2], range(n)[::-1], np.arange(3 * n) % n):
        among = trial.of(np.asarray(which)).walk
        yield from _difference(_starts(trial.walk, which), among, "a start alone, in another order, or among others")


def _divided(trial: Trial) -> Iterator[str]:
    plan = trial.begin()
    parts = joined([plan.advance(steps) for steps in DIVIDED])
    yield from _difference(trial.walk, parts, f"{STEPS} steps at once and in parts of {DIVIDED}")


def _fast_losses(trial: Trial) -> Iterator[str]:
    if isinstance(trial.controller, FastLosses):
        steps = STEPS - 50 * np.arange(len(trial.starts))
        fast = trial.controller.first_losses(
            trial.starts.copy(), trial.velocity.copy(), steps.copy(), trial.stride, trial.acceleration
        )
        planned = planned_losses(trial.begin(), steps)
        if not np.array_equal(fast, planned):
            yield f"first_losses gives the steps {fast}; expected those of the plan, {planned}"


def _mirrored(trial: Trial) -> Iterator[str]:
    if claims_mirrored(trial.controller):
        other = replace(trial, starts=trial.starts[:, MIRROR]).walk
        back = replace(other, **{name: getattr(other, name)[..., MIRROR] for name in PLANNED})
        yield from _difference(trial.walk, replace(back, y=-back.y), "mirrored starts, mirrored back,")


def _reading(trial: Trial) -> Iterator[str]:
    plan = trial.begin()
    if not isinstance(plan, ReadingPlan):
        return
    told, others, parts = np.arange(0, len(trial.starts), 2), slice(1, None, 2), [plan.advance(1)]
    for _ in range(99):
        sensed = _as_planned(parts[-1], told, trial.stride)
        copies = {one.name: getattr(sensed, one.name).copy() for one in fields(Sensed)}
        plan.sense(sensed)
        for name, before in copies.items():
            if not np.array_equal(getattr(sensed, name), before):
                yield f"sense changes what it is told, {name}; expected it to work on a copy"
        parts.append(plan.advance(1))
    walk, by_itself = joined(parts), trial.begin().advance(100)
    shape = (100, *trial.starts.shape)
    if walk.x.shape != shape:
        yield f"told of some starts, x has the shape {walk.x.shape}; expected all starts, {shape}"
        return
    if not (np.isfinite(walk.x).all() and np.isfinite(walk.y).all()):
        yield "told of some starts, tips are no numbers; expected them as finite as without"
    yield from _difference(_starts(by_itself, others), _starts(walk, others), "starts it is told nothing of")


LAWS: dict[str, tuple[Law, str]] = {
    "settings": (_settings, "a frozen dataclass with a name, its settings plain data"),
    "begin": (_begin, "plans begin at time 0 of the starts and stride asked for, and leave these as they are"),
    "shapes": (_shapes, "x, y, stance, aep and height of every step, start and leg"),
    "times": (_times, "time is k dt, and velocity is V_r as commanded"),
    "finite": (_finite, "tips are finite"),
    "reach": (_reach, "tips lie where legs can reach"),
    "begun again": (_again, "plans begun alike are the same walk, with any threads"),
    "batch": (_batch, "a start walks alike alone, in another order and among others"),
    "divided": (_divided, "divided anyhow it is the same walk"),
    "first losses": (_fast_losses, "first_losses, where it has them, are those of the plan"),
    "mirrored": (_mirrored, "mirrored starts give mirrored walks, where it claims that"),
    "sense": (_reading, "a plan that reads the legs can be told of some starts, and the others do not feel it"),
}
"""Every law by its name, and what it has looked at where it is kept."""


def _starts(walk: PlannedWalk, which: Any) -> PlannedWalk:
    """The walks of some starts."""
    at = which if isinstance(which, slice) else np.asarray(which)
    return replace(walk, **{name: getattr(walk, name)[:, at] for name in ("velocity", *PLANNED)})


def _difference(one: PlannedWalk, other: PlannedWalk, what: str) -> Iterator[str]:
    """A sentence on the first thing in which two walks differ."""
    for name in PLANNED:
        a, b = np.asarray(getattr(one, name)), np.asarray(getattr(other, name))
        if a.shape != b.shape:
            yield f"{what} differ: {name} has the shapes {a.shape} and {b.shape}; expected the same bits"
            return
        if (bad := np.argwhere((a != b) & ~((a != a) & (b != b)))).size:
            at = tuple(bad[0])
            yield f"{what} differ: {name} is {a[at]!s} and {b[at]!s} in {_place(one, at)}; expected the same bits"
            return


def _place(walk: PlannedWalk, at: Any) -> str:
    step, start, leg = at
    return f"step {step}, start {start} (V = {walk.velocity[step, start]:.3g}), leg {LEGS[leg]}"


def _as_planned(walk: PlannedWalk, ids: np.ndarray, stride: Stride) -> Sensed:
    """What legs would know that do as the last step says, their feet 10 mm below the root where they stand."""
    x, y, stance, height = (getattr(walk, name)[-1, ids] for name in ("x", "y", "stance", "height"))
    tips = np.stack([x + np.array(stride.geometry.origin), y, np.nan_to_num(height) - 10.0], axis=-1)
    none = np.zeros_like(stance)
    return Sensed(
        ids=ids,
        tips=tips,
        contact=stance.copy(),
        gained=none,
        lost=none.copy(),
        load=np.where(stance, 9810.0 / np.maximum(stance.sum(axis=1, keepdims=True), 1), 0.0),
        joints=np.zeros(tips.shape),
        torques=np.zeros(tips.shape),
        tilt=np.zeros((len(ids), 2)),
        velocity=np.zeros((len(ids), 3)),
        turning=np.zeros((len(ids), 3)),
    )
