"""A plan made from a function of one step, and for one that reads the legs from a function of what is sensed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.protocol import Sensed
from hexmj.errors import InputError
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import Acceleration, Stride, commanded_velocities
from hexmj.walks import PlannedWalk


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


_KINDS = {"x": float, "y": float, "stance": bool, "aep": float, "height": float}
"""What a step says of every start and leg, and its type."""


class StepwisePlan:
    """A `protocol.Plan` that asks for one step after the other."""

    def __init__(
        self,
        step: Callable[[np.ndarray], Step],
        starts: ArrayLike,
        velocity: ArrayLike,
        stride: Stride,
        acceleration: Acceleration | None = None,
    ) -> None:
        """Begin at time 0; see `stepwise`."""
        self.starts, self.stride, self.done = checked_starts(starts, stride), stride, 0
        self._step, self._acceleration = step, acceleration
        self._velocity = checked_velocities(velocity, len(self.starts), acceleration)

    def advance(self, steps: int) -> PlannedWalk:
        """The next `steps` steps."""
        if steps < 1:
            raise InputError(f"steps = {steps}; expected at least 1")
        stride, shape = self.stride, self.starts.shape
        v = commanded_velocities(self._velocity, self.done, steps, stride, self._acceleration)
        usual = {"y": stride.geometry.y, "aep": stride.aep0, "height": np.nan}
        planned = {name: np.empty((steps, *shape), dtype=kind) for name, kind in _KINDS.items()}
        for n, now in enumerate(v):
            step = self._step(now.copy())
            if not isinstance(step, Step):
                raise InputError(f"a step gave {step!r:.80}; expected a Step")
            given = usual | {name: value for name, value in vars(step).items() if value is not None}
            for name, values in planned.items():
                values[n] = _checked(name, given.get(name), shape)
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * stride.dt
        return PlannedWalk(time, np.array(v), **planned, geometry=stride.geometry)


class ReadingStepwisePlan(StepwisePlan):
    """A `protocol.ReadingPlan` that hands on what it is told."""

    def __init__(
        self,
        step: Callable[[np.ndarray], Step],
        starts: ArrayLike,
        velocity: ArrayLike,
        stride: Stride,
        acceleration: Acceleration | None,
        sense: Callable[[Sensed], None],
    ) -> None:
        """Begin at time 0; see `stepwise`."""
        super().__init__(step, starts, velocity, stride, acceleration)
        self._sense = sense

    def sense(self, sensed: Sensed) -> None:
        """Take in what is known before the next step is planned."""
        self._sense(sensed)


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
    if sense:
        return ReadingStepwisePlan(step, starts, velocity, stride, acceleration, sense)
    return StepwisePlan(step, starts, velocity, stride, acceleration)


def _checked(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A value of one step that can be written into (start, leg)."""
    try:
        values = np.asarray(value)
    except ValueError:
        raise InputError(f"{name} of a step is {value!r:.80}; expected one array") from None
    if values.dtype.kind not in ("b" if name == "stance" else "fiu"):
        raise InputError(
            f"{name} of a step is of type {values.dtype}; expected {'booleans' if name == 'stance' else 'numbers'}"
        )
    try:
        return np.broadcast_to(values, shape)
    except ValueError:
        raise InputError(
            f"{name} of a step has the shape {values.shape}; expected (start, leg), {shape}, or what broadcasts to it"
        ) from None
