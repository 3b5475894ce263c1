"""Plans made from a function that computes one step, with optional sensory feedback."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.protocol import Sensed
from hexmj.errors import InputError
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import Acceleration, Stride, commanded_velocities
from hexmj.validate import leg_last, short
from hexmj.walks import PLANNED, PlannedWalk


@dataclass(frozen=True, eq=False)
class Step:
    """The legs at the end of one step; each field is an array (start, leg), or broadcasts to it."""

    x: ArrayLike
    """Tips on the legs' own axes [mm]."""
    stance: ArrayLike
    """True for legs that stand."""
    y: ArrayLike | None = None
    """Distance of the tips from the body axis, left positive [mm]; by default that of the legs' lines."""
    aep: ArrayLike | None = None
    """Tip at the end of the present swing, on the leg's own axis [mm]; by default AEP_0."""
    aep_y: ArrayLike | None = None
    """Distance of that tip from the body axis [mm]; by default, the swing moves along the body."""
    height: ArrayLike | None = None
    """Height of the tips above the ground [mm]; where NaN, the default, the body itself lifts and lowers the foot."""
    level: ArrayLike | None = None
    """Height of the ground for which the legs are lifted and lowered [mm]; by default 0."""


@dataclass(eq=False)
class StepwisePlan:
    """A `protocol.Plan` that calls a function for each step; with `sense` it is a `protocol.FeedbackPlan`."""

    step: Callable[[np.ndarray], Step]
    """Function that computes each step, see `stepwise`."""
    starts: np.ndarray
    """(start, leg) tips at time 0 [mm]."""
    velocity: np.ndarray
    """(start,) final V_r."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None
    """Acceleration of Eq. 11, or None for constant V_r."""
    age: int | np.ndarray = 0
    """Number of steps since the acceleration began, (start,) or one number."""
    done: int = 0
    """Number of steps planned so far."""
    sense: Callable[[Sensed], None] = field(init=False, repr=False)
    """Function that receives the sensed legs before each step; the attribute is missing without feedback."""

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps.

        Raises:
            InputError: the function `step` does not return a `Step`, or a field does not broadcast to (start, leg).
        """
        stride, shape = self.stride, (steps, *self.starts.shape)
        v = np.array(commanded_velocities(self.velocity, self.age, steps, stride, self.acceleration))
        defaults = {"y": stride.geometry.y, "aep": stride.aep0, "aep_y": np.nan, "height": np.nan, "level": 0.0}
        planned = {name: np.full(shape, defaults.get(name, 0.0)) for name in PLANNED} | {"stance": np.ones(shape, bool)}
        for n, now in enumerate(v):
            step = self.step(now.copy())
            if not isinstance(step, Step):
                raise InputError(f"the function step returned {short(step)}; expected a Step")
            for name, values in planned.items():
                value = getattr(step, name)
                try:
                    if value is not None or name not in defaults:
                        np.copyto(values[n], leg_last(value), casting="same_kind")
                except (TypeError, ValueError) as error:
                    raise InputError(f"{name} of a step does not broadcast to {shape[1:]}: {error}") from None
        self.done, self.age = self.done + steps, self.age + steps
        time = np.arange(self.done - steps + 1, self.done + 1) * stride.dt
        return PlannedWalk(time, v, **planned, geometry=stride.geometry)

    def set_velocity(self, velocity: np.ndarray) -> None:
        """See `protocol.Plan`."""
        self.velocity = velocity


def stepwise(
    step: Callable[[np.ndarray], Step],
    starts: ArrayLike,
    velocity: ArrayLike,
    stride: Stride,
    acceleration: Acceleration | None = None,
    sense: Callable[[Sensed], None] | None = None,
) -> StepwisePlan:
    """Return a plan that calls a function once for every step, in order.

    Args:
        step: function that takes V_r of every start during the step, (start,), and returns the legs at its end.
        starts: tips at time 0 on their own axes, all standing, (start, leg) [mm].
        velocity: V_r, or its final value when accelerating, (start,) or one number.
        stride: step range, lines of the tips and time step.
        acceleration: Eq. 11, or None for constant V_r.
        sense: function for sensory feedback: it receives the sensed legs before each step of a physical walk.

    Raises:
        InputError: a start or velocity is out of range.
    """
    x = checked_starts(starts, stride)
    plan = StepwisePlan(step, x, checked_velocities(velocity, len(x), acceleration), stride, acceleration)
    if sense:
        plan.sense = sense
    return plan
