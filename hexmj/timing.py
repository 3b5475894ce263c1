"""Step range, time step, acceleration (Eq. 11) and observation time of a walk.

A time unit is 1 mm / V_p: the time in which a swinging foot moves 1 mm.  Velocities V are fractions of V_p.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.legs import FIG1, Geometry
from hexmj.validate import number, numbers

OBSERVATION_TIMES = ("walk", "start")
"""Named observation times, see `observation_duration`."""

MOST_STEPS = 10**7
"""Maximum number of steps of a walk."""

AT_SPEED = 10**9
"""Number of steps after which every acceleration has ended."""

LEAST_STEP = 1e-5
"""Minimum time step of a plan [time units]: a ten-thousandth of the default."""

FAR = 1e6
"""Maximum magnitude of AEP_0, PEP_0 and PEP_min [mm], beyond the reach of any leg."""


@dataclass(frozen=True)
class Stride:
    """Step range, tip lines and time step of every controller; all are inferred (docs/reference/constants.md)."""

    aep0: float = 10.0
    """Anterior extreme position without influences, on each leg's own axis [mm]."""
    pep0: float = -10.0
    """Posterior extreme position without influences [mm]."""
    pep_min: float = -20.0
    """Rearmost posterior extreme position that influences can set [mm]."""
    dt: float = 0.1
    """Time step of a plan, dt in Eq. 6 [time units; a swinging foot moves 1 mm per time unit]."""
    geometry: Geometry = field(default=FIG1)
    """Lines of the tips: fig1, as in Fig. 1 of the paper, or centred, with the centre of mass above O_2."""

    def __post_init__(self) -> None:
        for name in ("aep0", "pep0", "pep_min"):
            object.__setattr__(self, name, number(name, getattr(self, name), -FAR, FAR))
        object.__setattr__(self, "dt", number("dt", self.dt, LEAST_STEP, 1))
        if not self.pep_min <= self.pep0 < self.aep0:
            raise InputError(
                f"pep_min = {self.pep_min}, pep0 = {self.pep0}, aep0 = {self.aep0} mm; expected pep_min <= pep0 < aep0"
            )

    def periods(self, velocity: Any, count: float = 1.0) -> Any:
        """Return the duration of `count` periods (AEP_0 - PEP_0) (1 + 1/V) of a single leg at V_r [time units]."""
        return count * (self.aep0 - self.pep0) * (1.0 + 1.0 / velocity)


@dataclass(frozen=True)
class Acceleration:
    """The accelerating procedure, Eq. 11: V_r grows from `start` at `rate` up to the final velocity of the walk."""

    rate: float = 0.00008
    """a in Eq. 11: growth of V_r [1 / time unit]; 0.00008 in the paper."""
    start: float = 0.1
    """V_r(0), the velocity at time 0 as a fraction of V_p; inferred."""

    def __post_init__(self) -> None:
        if not (math.isfinite(number("rate", self.rate)) and self.rate > 0):
            raise InputError(f"rate = {self.rate}; expected a finite acceleration above 0 per time unit")
        if not 0 <= self.start < 1:
            raise InputError(f"start = {self.start}; expected 0 <= V_r(0) < 1")

    def duration(self, velocity: Any) -> Any:
        """Return the time until V_r reaches `velocity` [time units]."""
        return (velocity - self.start) / self.rate


def check_reached(velocity: np.ndarray, stride: Stride, acceleration: Acceleration | None) -> None:
    """Raise InputError if a V_r, plus what Eq. 11 adds to it in one time step, is 1 or more."""
    if acceleration and not (velocity + acceleration.rate * stride.dt < 1.0).all():
        step = acceleration.rate * stride.dt
        raise InputError(f"V = {velocity.max():g}, to which one time step adds {step:g}; expected a sum below 1")


def observation_duration(
    observation_time: str | float, velocity: ArrayLike, stride: Stride, acceleration: Acceleration | None = None
) -> np.ndarray:
    """Return the observation time, t in Eq. 7, for each velocity [time units]; the paper leaves it open.

    'walk' is three periods of a single leg oscillator, 3 (AEP_0 - PEP_0) (1 + 1/V); 'start' is
    2 (AEP_0 - PEP_0) / V_p. With an acceleration, these count from the moment when V is reached; a number counts from
    time 0.

    Raises:
        InputError: there is no such observation time, or V is 0 with the observation time 'walk'.
    """
    v = numbers("velocity", velocity)
    if not isinstance(observation_time, str):
        return np.full(v.shape, number("observation_time", observation_time))
    if observation_time not in OBSERVATION_TIMES:
        raise InputError(f"observation_time = {observation_time!r}; expected 'walk', 'start' or a number of time units")
    if observation_time == "walk" and (odd := v[~(v > 0)]).size:
        raise InputError(f"velocity = {odd[0]:g} has no period; expected V > 0 with the observation time 'walk'")
    time = stride.periods(v, 3.0) if observation_time == "walk" else np.full(v.shape, 2.0 * (stride.aep0 - stride.pep0))
    return time + acceleration.duration(v) if acceleration else time


def steps_within(duration: ArrayLike, stride: Stride) -> np.ndarray:
    """Return the number of whole steps of a plan within a duration [time units].

    Raises:
        InputError: the duration is shorter than one step, or longer than `MOST_STEPS` steps.
    """
    duration, dt = numbers("duration", duration), stride.dt
    if (odd := duration[~((duration >= dt) & (duration <= MOST_STEPS * dt))]).size:
        raise InputError(f"duration = {odd[0]:g}; expected at least {dt:g} and at most {MOST_STEPS * dt:g} time units")
    return np.floor(duration / dt + 1e-6).astype(int)


def commanded_velocities(
    velocity: np.ndarray, done: int | np.ndarray, steps: int, stride: Stride, acceleration: Acceleration | None
) -> np.ndarray:
    """Return V_r in each of the `steps` steps after `done` steps, (step, start), by Eq. 11.

    Args:
        velocity: final V_r, (start,).
        done: number of steps since the acceleration began, (start,), or one number for all starts.
        steps: number of steps for which V_r is returned.
        stride: the stride, which gives the time step.
        acceleration: acceleration of Eq. 11; without it, V_r has its final value in all steps.
    """
    if acceleration is None:
        return np.broadcast_to(velocity, (steps, len(velocity)))
    step = done + np.arange(steps)[:, np.newaxis]
    now, before = (acceleration.start + acceleration.rate * (n * stride.dt) for n in (step, step - 1))
    return np.where(before < velocity, now, velocity)
