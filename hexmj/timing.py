"""Stride, periods and times: how far legs step, how finely time is divided, and for how long a walk is observed.

The time unit is 1 mm / V_p: in one, a protracting tip moves 1 mm.  Velocities V are fractions of V_p.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError
from hexmj.legs import FIG1, Geometry
from hexmj.validate import choice, number, numbers

OBSERVATION_TIMES = ("walk", "start")
"""Named observation times, see `observation_duration`."""

MOST_STEPS = 10**7
"""Longest walk [steps]."""

AT_SPEED = 10**9
"""Steps after which every acceleration has ended."""

LEAST_STEP = 1e-5
"""Shortest time step of a plan [time units]; a ten-thousandth of the usual one."""

FAR = 1e6
"""Greatest coordinate of a tip, beyond the reach of any leg [mm]."""


@dataclass(frozen=True)
class Stride:
    """Where tips step and how time is divided, the same for every controller; all are inferred (docs/constants.md)."""

    aep0: float = 10.0
    """Anterior extreme position without influences, on each leg's own axis [mm]."""
    pep0: float = -10.0
    """Posterior extreme position without influences [mm]."""
    pep_min: float = -20.0
    """Rearmost posterior extreme position [mm]."""
    dt: float = 0.1
    """Time step of a plan, of Eq. 6 for the network [time units; in one, a protracting tip moves 1 mm]."""
    geometry: Geometry = field(default=FIG1)
    """Lines of the tips: fig1, as in Fig. 1 (`FIG1`), or centred (`CENTRED`), with the centre of mass above O_2."""

    def __post_init__(self) -> None:
        for name in ("aep0", "pep0", "pep_min"):
            object.__setattr__(self, name, number(name, getattr(self, name), -FAR, FAR))
        object.__setattr__(self, "dt", number("dt", self.dt, LEAST_STEP, 1))
        if not self.pep_min <= self.pep0 < self.aep0:
            raise InputError(
                f"pep_min = {self.pep_min}, pep0 = {self.pep0}, aep0 = {self.aep0} mm; expected pep_min <= pep0 < aep0"
            )

    def periods(self, velocity: Any, count: float = 1.0) -> Any:
        """Duration of some periods of a single leg at V_r, (AEP_0 - PEP_0) (1 + 1/V) each [time units]."""
        return count * (self.aep0 - self.pep0) * (1.0 + 1.0 / velocity)


@dataclass(frozen=True)
class Acceleration:
    """The accelerating procedure, Eq. 11: V_r grows from `start` with `rate` up to the velocity of the walk."""

    rate: float = 0.00008
    """a [1 / time unit]; the paper's 0.00008."""
    start: float = 0.1
    """V_r(0), as a fraction of V_p; inferred."""

    def __post_init__(self) -> None:
        if not (math.isfinite(number("rate", self.rate)) and self.rate > 0):
            raise InputError(f"rate = {self.rate}; expected a finite acceleration above 0 per time unit")
        if not 0 <= self.start < 1:
            raise InputError(f"start = {self.start}; expected 0 <= V_r(0) < 1")

    def duration(self, velocity: Any) -> Any:
        """Time until V_r is reached [time units]."""
        return (velocity - self.start) / self.rate


def check_reached(velocity: np.ndarray, stride: Stride, acceleration: Acceleration | None) -> None:
    """Raise InputError if V_r, (...) fractions of V_p, and the growth of V in a time step (Eq. 11) reach 1 together."""
    if acceleration and not (velocity + acceleration.rate * stride.dt < 1.0).all():
        step = acceleration.rate * stride.dt
        raise InputError(
            f"V = {velocity.max():g} is reached in steps of {step:g}; expected V and a step below 1 together"
        )


def check_in_time(velocity: np.ndarray, duration: np.ndarray, acceleration: Acceleration | None) -> None:
    """Raise InputError if V_r, (velocity,), is not reached by Eq. 11 within a time, (velocity,) [time units]."""
    if acceleration and (late := np.flatnonzero(duration < acceleration.duration(velocity) * (1.0 - 1e-9))).size:
        v, end = velocity[late[0]], duration[late[0]]
        reached = f"V = {v:g} is reached at {acceleration.duration(v):g} time units"
        raise InputError(f"{reached}; expected an observation time longer than {end:g}, or 'walk' or 'start'")


def observation_duration(
    observation_time: str | float, velocity: ArrayLike, stride: Stride, acceleration: Acceleration | None = None
) -> np.ndarray:
    """Return the time t of Eq. 7 for each velocity [time units], which the paper leaves open.

    'walk' is three periods of a single leg oscillator, 3 (AEP_0 - PEP_0) (1 + 1/V); 'start' is
    2 (AEP_0 - PEP_0) / V_p. When accelerating, a named observation time begins when V is reached; a number is the whole
    time.

    Raises:
        InputError: there is no such observation time, or V is 0 with the observation time 'walk'.
    """
    v = numbers("velocity", velocity)
    if not isinstance(observation_time, str):
        return np.full(v.shape, number("observation_time", observation_time))
    choice("observation_time", observation_time, OBSERVATION_TIMES)
    if observation_time == "walk" and (odd := v[~(v > 0)]).size:
        raise InputError(f"velocity = {odd[0]:g} has no period; expected V > 0 with the observation time 'walk'")
    time = stride.periods(v, 3.0) if observation_time == "walk" else np.full(v.shape, 2.0 * (stride.aep0 - stride.pep0))
    return time + acceleration.duration(v) if acceleration else time


def steps_within(duration: ArrayLike, stride: Stride) -> np.ndarray:
    """Return the whole steps of a plan within an observation time [time units].

    Raises:
        InputError: the time is shorter than a step, or longer than `MOST_STEPS`.
    """
    duration, dt = numbers("duration", duration), stride.dt
    if (odd := duration[~((duration >= dt) & (duration <= MOST_STEPS * dt))]).size:
        raise InputError(f"duration = {odd[0]:g}; expected at least {dt:g} and at most {MOST_STEPS * dt:g} time units")
    return np.floor(duration / dt + 1e-6).astype(int)


def commanded_velocities(
    velocity: np.ndarray, done: int | np.ndarray, steps: int, stride: Stride, acceleration: Acceleration | None
) -> np.ndarray:
    """Return V_r during each of the `steps` after `done`, (step, start), by Eq. 11; V itself without an acceleration.

    Args:
        velocity: final V_r, (start,).
        done: steps since the acceleration began, (start,), or one number for all.
        steps: number of steps.
        stride: with the time step.
        acceleration: Eq. 11.
    """
    if acceleration is None:
        return np.broadcast_to(velocity, (steps, len(velocity)))
    step = done + np.arange(steps)[:, np.newaxis]
    now, before = (acceleration.start + acceleration.rate * (n * stride.dt) for n in (step, step - 1))
    return np.where(before < velocity, now, velocity)
