"""Dynamic stability: a pendulum on the edge of the support polygon tips over, or the next foot catches it.

While the centre of mass is outside the support polygon, the trunk tips over the nearest edge like an inverted pendulum,
a point mass at the standing height h.  Its excursion z from the planned position, away from the polygon, obeys

    z'' = (g / h) (z - m(t)),    z >= 0,

where m(t) is the stability margin, negative outside the polygon.  The pendulum is at rest, z = z' = 0, until the margin
becomes negative, and again as soon as z is back at 0.  z either returns or grows exponentially, at the rate
sqrt(g / h); a loss of dynamic stability is the first time at which z exceeds h, an angle of 45 degrees.  The linearised
pendulum is that of the extrapolated centre of mass (Hof, Gazendam and Sinke, J. Biomech. 38, 2005).
"""

from typing import Any, NamedTuple

import numpy as np

from hexmj.jitted import inlined, jitted

GRAVITY = 9810.0
"""Gravity g [mm/s^2]."""

NO_FOOT = -30.0
"""Margin while no foot stands, and minimum of the margin [mm]: no standing foot is farther from O."""


class Pendulum(NamedTuple):
    """Constants of the pendulum, for one explicit step in each step of a plan."""

    gain: float
    """g / h times the square of the plan's time step."""
    height: float
    """Height h, and the excursion at which dynamic stability is lost [mm]."""

    @classmethod
    def of(cls, height: float, seconds: float) -> "Pendulum":
        """Return the pendulum of a height [mm] for a plan with steps of `seconds`."""
        return cls(GRAVITY / height * seconds**2, height)


STATIC = Pendulum(0.0, 0.0)
"""A pendulum without weight, with which only static stability is followed."""


class Losses(NamedTuple):
    """What the plans of some starts lose; steps are counted from 1, and 0 stands for no loss."""

    static: np.ndarray
    """(start,) step of the first loss of static stability."""
    dynamic: np.ndarray
    """(start,) step of the first loss of dynamic stability; a plan is not followed beyond it."""
    excursion: np.ndarray
    """(start,) greatest excursion z [mm]."""

    @classmethod
    def none(cls, n_starts: int) -> "Losses":
        """Return the record of starts before their first step."""
        return cls(np.zeros(n_starts, dtype=int), np.zeros(n_starts, dtype=int), np.zeros(n_starts))


class LossesSoFar:
    """Pendulums of all starts, which follow the stability margins of successive parts of a plan."""

    def __init__(self, pendulum: Pendulum, n_starts: int) -> None:
        """Begin with pendulums at rest."""
        self.losses, self._pendulum, self._done = Losses.none(n_starts), pendulum, 0
        self._state = np.zeros((n_starts, 2))

    def add(self, margin: np.ndarray, steps: np.ndarray) -> None:
        """Follow the margins of the next steps, (step, start) [mm]; `steps`, (start,), is each start's last step."""
        # plain tuples: numba's cache on disk refers to classes by name
        _follow(margin, self._done, steps, tuple(self._pendulum), self._state, tuple(self.losses))
        self._done += len(margin)


@inlined
def pendulum_step(margin, excursion, speed, gain):
    """Return excursion and speed [mm, mm per step] after one explicit step of the pendulum."""
    margin = margin if margin > NO_FOOT else NO_FOOT
    speed = speed + gain * (excursion - margin)
    excursion = excursion + speed
    return (excursion, speed) if excursion > 0.0 else (0.0, 0.0)


@jitted
def _follow(margin: Any, done: int, steps: Any, pendulum: Any, state: Any, losses: Any) -> None:
    gain, height = pendulum
    static, dynamic, most = losses
    for i in range(len(steps)):
        z, speed = state[i]
        for n in range(len(margin)):
            if dynamic[i] != 0 or done + n >= steps[i]:
                break
            if margin[n, i] <= 0.0 and static[i] == 0:
                static[i] = done + n + 1
            z, speed = pendulum_step(margin[n, i], z, speed, gain)
            most[i] = max(most[i], z)
            if z > height:
                dynamic[i] = done + n + 1
        state[i, 0], state[i, 1] = z, speed
