"""Evolved: a small neural network says when legs are lifted, in the way of Beer & Gallagher (1992).

Each leg has a continuous-time neuron, whose potential is y_i and whose output is s(y_i + theta):

    tau dy_i/dt = -y_i + sum_j w_ij s(y_j + theta) + I_i,    s(z) = 1 / (1 + exp(-GAIN z))

When its output rises through 1/2, it lifts the leg.  As there, neurons are joined to those of neighbouring legs, sense
the position of their own leg, and have the same constants in every leg; an evolutionary search chooses the constants by
walks from random starts.  Otherwise than there, a leg has one neuron and not five, since how it swings is given; the
weights along the body have a direction; and the neuron is told V_r, for one network shall walk at every velocity.  We
know their network from the paper of 1998 and from code by others, not from its own paper.

How it maps: a leg's position is 0 at AEP_0 and 1 at PEP_0.  Sensed: that of the own leg, and V_r.  Fitted by us: all
eight constants, on falls of our insect at V = 0.3 to 0.7 (`evolved.toml`, with the command), from legs that step by
themselves.  What came out is a tripod with steps of 12 mm instead of 20 (at V = 0.5).  At these velocities it falls
less often than LDVS; on paper it loses stability more often than LDVS up to V = 0.3.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, check_numbers, from_neighbour
from hexmj.errors import InputError
from hexmj.files import read_toml
from hexmj.legs import MIRROR, N2, N4

FOUND = Path(__file__).with_name("evolved.toml")
"""The constants that were found, and how; as the search wrote them."""

GAIN = 8.0
"""Steepness of s; divides weights, biases and inputs, so that 1 is a usual size of each."""

TAU = 2.0
"""Unit of the time constant [time units]; a swing from PEP_0 to AEP_0 takes 20."""


LONGEST = 1000
"""Greatest log2 of the time constant; beyond it, numbers of double precision end."""


class Potentials(NamedTuple):
    """What the network remembers."""

    y: np.ndarray
    """(start, leg)."""


@dataclass(frozen=True)
class Evolved(Lifted):
    """Unless told otherwise a leg is lifted soon after PEP_0, and does not know of the others."""

    theta: float = -1.0
    """Bias."""
    tau: float = 0.0
    """log2 of the time constant in `TAU`."""
    position: float = 1.0
    """Input from a leg at PEP_0."""
    velocity: float = 0.0
    """Input at V_r = V_p."""
    own: float = 0.0
    """Weight of the neuron's own output."""
    behind: float = 0.0
    """Weight of the output of the leg behind."""
    ahead: float = 0.0
    """Weight of the output of the leg in front."""
    across: float = 0.0
    """Weight of the output of the contralateral leg."""
    name: str = "evolved"

    def __post_init__(self) -> None:
        check_numbers(self)
        if not abs(self.tau) <= LONGEST:
            raise InputError(f"{self.name}: tau = {self.tau}; expected {-LONGEST} to {LONGEST}")

    mirrored = True

    def at_start(self, legs: Legs) -> Potentials:
        """All at 0."""
        return Potentials(np.zeros_like(legs.x))

    def lifts(self, state: Potentials, legs: Legs) -> tuple[Potentials, np.ndarray]:
        """The equation, solved exactly for outputs and inputs that last for the step."""
        before = state.y
        with np.errstate(over="ignore"):  # where nothing is sent
            sent = 1.0 / (1.0 + np.exp(-GAIN * (before + self.theta)))
        told = (
            self.own * sent
            + self.behind * from_neighbour(N2, sent)
            + self.ahead * from_neighbour(N4, sent)
            + self.across * sent[:, MIRROR]
            + self.position * legs.travel
            + self.velocity * legs.v
        )
        y = told + (before - told) * np.exp(-legs.stride.dt / (TAU * 2.0**self.tau))
        return Potentials(y), (before <= -self.theta) & (y > -self.theta)


EVOLVED = Evolved(**read_toml(FOUND)["fields"])
"""With the constants that were found."""
