"""Metronomes: a clock without sensory feedback lifts the legs, in two gaits of insects (paper, Section 5.3).

Wilson's metachronal wave: on each side swings follow each other from hind to front without delay. A swing takes the
same time at every velocity, so that each leg lags V / (1 + V) of a period behind the leg to its rear; the sides move
in anti-phase.  Graham's Gait I: the tripod at every velocity.

Mapping: the period is (AEP_0 - PEP_0) (1 + 1/V), in which a swing goes from PEP_0 to AEP_0 at V_p. Fitted by us:
nothing. Sensed: nothing, not even the tips at time 0. The clock is at 0 when the walk begins, and the first step lifts
each leg whose swing has begun by then. With a random phase, the clock begins at a time that depends on the start, and
lifts each leg at its next beat.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted

BEHIND = np.array([2.0, 1.0, 0.0, 2.0, 1.0, 0.0])
"""(leg,) number of swings of the same side that precede the leg's swing."""

RIGHT = np.array([0.0, 0.0, 0.0, 0.5, 0.5, 0.5])
"""(leg,) lag of the right side behind the left side [periods]."""


class Clock(NamedTuple):
    """State of a metronome."""

    time: np.ndarray
    """(start, 1) time since the walk began [periods]."""
    swings: np.ndarray
    """(start, leg) number of the swing that began last."""


@dataclass(frozen=True)
class Metronome(Lifted):
    """A clock that lifts each leg with a fixed lag."""

    wave: Literal["wilson", "graham"] = "wilson"
    """Gait: 'wilson', swings from hind to front; 'graham', two tripods."""
    name: str = "wilson"

    def at_start(self, legs: Legs) -> Clock:
        """See `Lifted.at_start`."""
        phase = -self._lag(legs.v)
        swings = phase % 1.0 < _swing_part(legs.v)
        return Clock(np.zeros_like(legs.v), np.floor(phase) - swings)

    def lifts(self, state: Clock, legs: Legs) -> tuple[Clock, np.ndarray]:
        """See `Lifted.lifts`."""
        span = legs.stride.aep0 - legs.stride.pep0
        time = state.time + legs.stride.dt / span * _swing_part(legs.v)
        swings = np.floor(time - self._lag(legs.v))
        return Clock(time, np.maximum(swings, state.swings)), swings > state.swings

    def _lag(self, v: np.ndarray) -> np.ndarray:
        """Return the lag of each leg behind the clock, (start, leg) [periods]."""
        behind = np.full_like(v, 0.5) if self.wave == "graham" else _swing_part(v)
        return BEHIND * behind + RIGHT


@dataclass(frozen=True)
class RandomPhase(Metronome):
    """A metronome that begins at a phase which depends on the start, and lifts each leg at its next beat."""

    def at_start(self, legs: Legs) -> Clock:
        """Begin at the fractional part of the first tip's position in units of 0.1 um; see `Lifted.at_start`."""
        phase = legs.x[:, :1] * 1e4 % 1.0
        return Clock(phase, np.floor(phase - self._lag(legs.v)))


def _swing_part(v: np.ndarray) -> np.ndarray:
    """Return the fraction of the period in which a leg swings, at V_r."""
    return v / (1.0 + v)
