"""Commands: how a body shall move, straight ahead, sideways and turning, constant or changing over time.

A command is a twist of the body frame, whose x axis points forward, y to the left and z up. Its velocities are
fractions of V_p, so that it means the same at every V_p: a time unit is 1 mm / V_p.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.validate import numbers

NAMES = ("forward", "left", "turn")
"""Names of the components of a command."""

FASTEST_TURN = 0.1
"""Maximum magnitude of `turn` [rad / time unit]: at it, every leg of an insect moves faster than V_p."""


@dataclass(frozen=True)
class Command:
    """A commanded walk: one number for each component, or for each of its parts, which begin at `times`."""

    forward: float | Sequence[float] = 0.3
    """Velocity forward as a fraction of V_p; negative backward."""
    left: float | Sequence[float] = 0.0
    """Velocity to the left as a fraction of V_p; negative to the right."""
    turn: float | Sequence[float] = 0.0
    """Yaw rate, counterclockwise seen from above [rad / time unit]."""
    times: Sequence[float] = (0.0,)
    """Time at which each part begins, 0 for the first [time units]."""

    def __post_init__(self) -> None:
        times = np.atleast_1d(numbers("times", self.times))
        if times.ndim != 1 or not len(times) or times[0] != 0.0 or not (np.diff(times) > 0).all():
            raise InputError(f"times = {self.times}; expected times that begin with 0 and increase")
        object.__setattr__(self, "times", tuple(times.tolist()))
        for name in NAMES:
            values, most = numbers(name, getattr(self, name)), FASTEST_TURN if name == "turn" else 1.0
            if values.shape not in ((), times.shape):
                raise InputError(f"{name} has the shape {values.shape}; expected one number or one for each of times")
            if not (np.abs(values) <= most).all():
                raise InputError(f"{name} = {values.tolist()}; expected magnitudes of at most {most:g}")
            object.__setattr__(self, name, values.item() if not values.ndim else tuple(values.tolist()))

    @classmethod
    def twist(
        cls,
        vx: float | Sequence[float],
        vy: float | Sequence[float] = 0.0,
        yaw_rate: float | Sequence[float] = 0.0,
        vp: float = 80.0,
        times: Sequence[float] = (0.0,),
    ) -> "Command":
        """Return the command of a twist in the body frame: x forward, y left, z up.

        Args:
            vx: velocity forward [mm/s].
            vy: velocity to the left [mm/s].
            yaw_rate: yaw rate, counterclockwise seen from above [rad/s].
            vp: velocity V_p of a swinging foot in the walk [mm/s].
            times: time at which each part begins [s].
        """
        forward, left, turn = ((numbers("twist", rate) / vp).tolist() for rate in (vx, vy, yaw_rate))
        return cls(forward, left, turn, (numbers("times", times) * vp).tolist())

    @property
    def parts(self) -> np.ndarray:
        """(part, 3) forward, left and turn of each part."""
        return np.stack([np.broadcast_to(getattr(self, name), len(self.times)) for name in NAMES], axis=1)

    @property
    def velocity(self) -> float | None:
        """V_r of a command that is straight ahead and constant; None for other commands."""
        forward, left, turn = self.parts[0]
        return float(forward) if len(self.times) == 1 and left == turn == 0.0 and 0 <= forward < 1 else None

    def changes(self, stride: Stride) -> dict[int, np.ndarray]:
        """Return the step of a plan at whose beginning each part begins -> forward, left and turn, (3,)."""
        steps = np.round(np.array(self.times) / stride.dt).astype(int)
        return dict(zip(steps.tolist(), self.parts, strict=True))

    def path(self, time: np.ndarray) -> np.ndarray:
        """Return the commanded pose at some times.

        Args:
            time: (step,) times [time units].

        Returns:
            (step, 3) x and y of O in the frame of time 0 [mm], and heading, not wrapped [rad].
        """
        ends, poses = np.append(self.times[1:], np.inf), np.zeros((len(time), 3))
        pose, index = np.zeros(3), np.searchsorted(self.times, time, side="right") - 1
        for part, (begin, end, twist) in enumerate(zip(self.times, ends, self.parts, strict=True)):
            here = index == part
            poses[here] = _moved(pose, twist, time[here] - begin)
            if np.isfinite(end):
                pose = _moved(pose, twist, np.array([end - begin]))[0]
        return poses


def _moved(pose: np.ndarray, twist: np.ndarray, duration: np.ndarray) -> np.ndarray:
    """Return the poses, (n, 3), after a body has moved from a pose, (3,), by a twist, (3,), for durations, (n,)."""
    forward, left, turn = twist
    angle = turn * duration
    half = 0.5 * angle
    chord = duration * np.sinc(half / np.pi)  # length of the way over that of the twist's velocity
    cosine, sine = np.cos(pose[2] + half), np.sin(pose[2] + half)
    x = pose[0] + chord * (forward * cosine - left * sine)
    y = pose[1] + chord * (forward * sine + left * cosine)
    return np.stack([x, y, pose[2] + angle], axis=1)
