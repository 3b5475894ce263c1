"""A plan made from a function of one step, and for one that reads the legs from a function of what is sensed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.checks import NO_ARRAY, whole
from hexmj.controllers.protocol import Sensed
from hexmj.errors import InputError
from hexmj.legs import leg_last
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import Acceleration, Stride, commanded_velocities
from hexmj.walks import PLANNED, PlannedWalk


@dataclass(frozen=True, eq=False)
class Step:
    """Where the legs shall be at the end of one step; each (start, leg), or what broadcasts to it."""

    x: ArrayLike
    """Tips on their own axes [mm]."""
    stance: ArrayLike
    """Which legs stand."""
    y: ArrayLike | None = None
    """Tips beside the body axis, left positive [mm]; on their lines unless given."""
    aep: ArrayLike | None = None
    """Where the swing that a leg is in will end, on its own axis [mm]; at AEP_0 unless given."""
    height: ArrayLike | None = None
    """Of the tips above the ground [mm], NaN for those that the body shall lift; it lifts all unless given."""


@dataclass(eq=False)
class StepwisePlan:
    """A `protocol.Plan` that asks for one step after the other."""

    step: Callable[[np.ndarray], Step]
    """See `stepwise`."""
    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    velocity: np.ndarray
    """(start,) final V_r."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None
    """Eq. 11."""
    done: int = 0
    """Steps planned so far."""

    def advance(self, steps: int) -> PlannedWalk:
        """The next `steps` steps."""
        steps = whole("steps", steps, 1)
        stride, shape = self.stride, self.starts.shape
        v = commanded_velocities(self.velocity, self.done, steps, stride, self.acceleration)
        planned = {name: np.empty((steps, *shape), dtype=bool if name == "stance" else float) for name in PLANNED}
        usual = {"y": stride.geometry.y, "aep": stride.aep0, "height": np.nan}
        for name, value in usual.items():
            planned[name][:] = value
        for n, now in enumerate(v):
            step = self.step(now.copy())
            if not isinstance(step, Step):
                given = " ".join(f"{step!r}".split())
                raise InputError(f"a step gave {given:.60}; expected a Step, such as Step(x, stance)")
            for name, values in planned.items():
                value = getattr(step, name)
                if value is not None or name not in usual:
                    values[n] = _checked(name, value, shape)
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * stride.dt
        return PlannedWalk(time, np.array(v), **planned, geometry=stride.geometry)


@dataclass(eq=False)
class ReadingStepwisePlan(StepwisePlan):
    """A `protocol.FeedbackPlan` that hands on what it is told."""

    sense: Callable[[Sensed], None] = field(kw_only=True)
    """Takes in what is known before the next step is planned."""


def stepwise(
    step: Callable[[np.ndarray], Step],
    starts: ArrayLike,
    velocity: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
    sense: Callable[[Sensed], None] | None = None,
) -> StepwisePlan:
    """A plan from a function that is called once for every step, in order.

    Args:
        step: from V_r of every start during the step, (start,), to where the legs shall be at its end.
        starts: that of `protocol.Controller.begin`, like the next three.
        velocity: V_r, or its final value when accelerating.
        stride: step range, lines of the tips and time step.
        acceleration: Eq. 11.
        sense: makes the plan one that reads the legs: called with what is known, before each step of a physical walk.

    Raises:
        InputError: starts or a velocity that make no sense; while the plan goes on, a step that makes none.
    """
    x = checked_starts(starts, stride)
    asked = step, x, checked_velocities(velocity, len(x), acceleration), stride, acceleration
    return ReadingStepwisePlan(*asked, sense=sense) if sense else StepwisePlan(*asked)


def _checked(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A value of one step that can be written into (start, leg); labelled legs may come in any order."""
    value = value if type(value) is np.ndarray else leg_last(value)
    try:
        values = np.asarray(value)
    except NO_ARRAY:
        raise InputError(f"{name} of a step is {value!r:.80}; expected one array") from None
    kinds, expected = ("b", "booleans") if name == "stance" else ("fiu", "numbers")
    if values.dtype.kind not in kinds:
        raise InputError(f"{name} of a step is of type {values.dtype}; expected {expected}")
    if type(value) is not np.ndarray and np.ma.is_masked(value):
        raise InputError(f"{name} of a step is masked in part; expected {expected} throughout")
    try:
        return values if values.shape == shape else np.broadcast_to(values, shape)
    except ValueError:
        raise InputError(
            f"{name} of a step has the shape {values.shape}; expected (start, leg), {shape}, or what broadcasts to it"
        ) from None
