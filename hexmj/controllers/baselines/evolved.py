"""Evolved: a small neural network lifts the legs, in the way of Beer & Gallagher (1992).

Each leg has a continuous-time neuron, whose potential is y_i and whose output is s(y_i + theta):

    tau dy_i/dt = -y_i + sum_j w_ij s(y_j + theta) + I_i,    s(z) = 1 / (1 + exp(-GAIN z))

When its output rises through 1/2, the neuron lifts the leg. As in the source, neurons are connected to those of
neighbouring legs, sense the position of their own leg, and have the same constants in every leg; an evolutionary search
chooses the constants by walks from random starts. Unlike the source, a leg has one neuron and not five, since the swing
is given; the weights along the body have a direction; and V_r is an input, since one network walks at every velocity.
We know the source from the paper of 1998 and from code by others, not from its own paper.

Mapping: a leg's position is 0 at AEP_0 and 1 at PEP_0. Sensed: the own leg's position, and V_r. Fitted by us: all eight
constants, on falls of our insect at V = 0.3 to 0.7 (`evolved.toml`, with the command), beginning with uncoupled legs.
The result is a tripod with steps of 12 mm instead of 20 (at V = 0.5). At these velocities it falls less often than
LDVS; in kinematic walks it loses stability more often than LDVS up to V = 0.3.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.files import read_toml
from hexmj.legs import MIRROR, N2, N4

FOUND = Path(__file__).with_name("evolved.toml")
"""The constants that the search found, as it wrote them."""

GAIN = 8.0
"""Steepness of s; weights, biases and inputs are divided by it, so that their usual size is 1."""

TAU = 2.0
"""Unit of the time constant [time units]; a swing from PEP_0 to AEP_0 takes 20."""


@dataclass(frozen=True)
class Evolved(Lifted):
    """The equation; by default a leg is lifted soon after PEP_0, independently of the others."""

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

    mirrored = True

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted`: all potentials, (start, leg), are 0."""
        return np.zeros_like(legs.x)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted`: the equation, solved exactly for outputs and inputs that are constant over the step."""
        with np.errstate(over="ignore", divide="ignore"):  # there an exponential is 0 or 1
            decay = np.exp(-legs.stride.dt / (TAU * np.float64(2.0) ** self.tau))
            sent = 1.0 / (1.0 + np.exp(-GAIN * (state + self.theta)))
        drive = (
            self.own * sent
            + self.behind * from_neighbour(N2, sent)
            + self.ahead * from_neighbour(N4, sent)
            + self.across * sent[:, MIRROR]
            + self.position * legs.travel
            + self.velocity * legs.v
        )
        y = drive + (state - drive) * decay
        return y, (state <= -self.theta) & (y > -self.theta)


EVOLVED = Evolved(**read_toml(FOUND)["fields"])
"""The network with the constants that the search found."""
