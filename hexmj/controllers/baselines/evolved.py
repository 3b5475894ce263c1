"""A small evolved neural network that lifts the legs, after Beer & Gallagher (1992).

Each leg has a continuous-time neuron, whose potential is y_i and whose output is s(y_i + theta):

    tau dy_i/dt = -y_i + sum_j w_ij s(y_j + theta) + I_i,    s(z) = 1 / (1 + exp(-GAIN z))

When its output rises above 1/2, the neuron lifts the leg. As in the source, each neuron receives the outputs of the
neighbouring legs' neurons and the position of its own leg, and all legs have the same constants, which an evolutionary
search chooses by walks from random starts. Unlike the source, a leg has one neuron instead of five, since the swing is
given; the leg behind and the leg in front have different weights; and V_r is an input, so that one network walks at
every velocity. We know the source from the paper of 1998 and from code by others, not from its own text.

Mapping: a leg's position is 0 at AEP_0 and 1 at PEP_0. Sensed: the own leg's position, and V_r. Fitted by us: all eight
constants, by a search for few falls of our insect at V = 0.3 to 0.7 that began with uncoupled legs (`evolved.toml`).
The result is a tripod with steps of 12 mm instead of 20 mm (at V = 0.5). At these velocities it falls less often than
LDVS; in kinematic walks up to V = 0.3 it loses static stability more often than LDVS.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.files import read_toml
from hexmj.legs import MIRROR, N2, N4

FOUND = Path(__file__).with_name("evolved.toml")
"""File of the constants, as the search wrote it."""

GAIN = 8.0
"""Steepness of s; the fields below are weights, biases and inputs divided by it, so that their typical size is 1."""

TAU = 2.0
"""Unit of the neuron's time constant [time units]; a swing from PEP_0 to AEP_0 takes 20 time units."""


@dataclass(frozen=True)
class Evolved(Lifted):
    """One neuron per leg; by default each leg is lifted soon after PEP_0, independently of the other legs."""

    theta: float = -1.0
    """Bias of the neuron."""
    tau: float = 0.0
    """Logarithm to base 2 of the time constant in units of `TAU`."""
    position: float = 1.0
    """Input to the neuron while its leg is at PEP_0."""
    velocity: float = 0.0
    """Input to the neuron at V_r = V_p."""
    own: float = 0.0
    """Weight of the neuron's own output in its input."""
    behind: float = 0.0
    """Weight of the output of the ipsilateral leg behind."""
    ahead: float = 0.0
    """Weight of the output of the ipsilateral leg in front."""
    across: float = 0.0
    """Weight of the output of the contralateral leg."""
    name: str = "evolved"

    mirrored = True

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted.at_start`: all potentials, (start, leg), are 0."""
        return np.zeros_like(legs.x)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted.lifts`: solves the equation exactly for outputs and inputs that are constant over the step."""
        with np.errstate(over="ignore", divide="ignore"):  # the limits 0 and 1 are right
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
"""The baseline `evolved`: the network with the constants that the search found."""
