"""Evolved: a small neural network that says when legs are lifted, in the way of Beer & Gallagher (1992).

Every leg has two continuous-time neurons, `foot` and `inner`.  Neuron i with the potential y_i sends s(y_i + theta_i):

    tau_i dy_i/dt = -y_i + sum_j w_ij s(y_j + theta_j) + I_i,    s(z) = 1 / (1 + exp(-z))

The foot neuron lifts the leg when its output rises through 1/2.  As there, a neuron hears both neurons of its leg and
the one like it in each neighbour, senses how far its leg is back, and has the same constants in every leg.  Ours are:
two neurons instead of five, for the swing itself is given; weights of its own for each direction along the body; and a
sense of V_r, for one network shall walk at every velocity.  Nothing but the constants is fitted (`evolved.toml`).

How it maps: a leg is 0 back at AEP_0 and 1 at PEP_0.  Sensed: this, of the own leg, and V_r.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hexmj.controllers.rivals.lifted import Legs, Lifted
from hexmj.files import read_toml
from hexmj.legs import MIRROR

TAU = 2.0
"""Time constant of a neuron that is neither slow nor fast [time units]; a swing of the usual stride takes 20."""

REAR, FRONT = (1, 2, 6, 4, 5, 6), (6, 0, 1, 6, 3, 4)
"""Indices of the ipsilateral neighbours, (leg,); 6 where there is none."""


class Potentials(NamedTuple):
    """What the network remembers."""

    y: np.ndarray
    """(start, neuron, leg), foot before inner."""


class Constants(NamedTuple):
    """Of both neurons, (neuron, 1) each, foot before inner."""

    theta: np.ndarray
    slow: np.ndarray
    travel: np.ndarray
    velocity: np.ndarray
    foot: np.ndarray
    inner: np.ndarray
    rear: np.ndarray
    front: np.ndarray
    across: np.ndarray


@dataclass(frozen=True)
class Evolved(Lifted):
    """Eighteen constants; as long as all are 0, a leg is lifted at PEP_min only."""

    theta_foot: float = 0.0
    """Bias theta of the foot neuron."""
    theta_inner: float = 0.0
    """Bias theta of the inner neuron."""
    slow_foot: float = 0.0
    """log2 of the foot neuron's tau / `TAU`."""
    slow_inner: float = 0.0
    """log2 of the inner neuron's tau / `TAU`."""
    travel_foot: float = 0.0
    """Input of the foot neuron from a leg at PEP_0."""
    travel_inner: float = 0.0
    """Input of the inner neuron from a leg at PEP_0."""
    velocity_foot: float = 0.0
    """Input of the foot neuron at V_r = V_p."""
    velocity_inner: float = 0.0
    """Input of the inner neuron at V_r = V_p."""
    foot_foot: float = 0.0
    """Weight w of the foot neuron's own output."""
    foot_inner: float = 0.0
    """From the foot neuron to the inner one."""
    inner_foot: float = 0.0
    """From the inner neuron to the foot neuron."""
    inner_inner: float = 0.0
    """Of the inner neuron's own output."""
    rear_foot: float = 0.0
    """From the foot neuron of the leg behind."""
    rear_inner: float = 0.0
    """From the inner neuron of the leg behind."""
    front_foot: float = 0.0
    """From the foot neuron of the leg in front."""
    front_inner: float = 0.0
    """From the inner neuron of the leg in front."""
    across_foot: float = 0.0
    """From the foot neuron of the contralateral leg."""
    across_inner: float = 0.0
    """From the inner neuron of the contralateral leg."""
    name: str = "evolved"

    mirrored = True

    def at_start(self, legs: Legs) -> Potentials:
        """All at 0."""
        return Potentials(np.zeros((len(legs.x), 2, 6)))

    def lifts(self, state: Potentials, legs: Legs) -> tuple[Potentials, np.ndarray]:
        """The equation, solved over a step in which outputs and senses stay as they are."""
        one, y = self._constants, state.y
        sent = 1.0 / (1.0 + np.exp(-(y + one.theta)))
        beside = np.concatenate([sent, np.zeros((len(y), 2, 1))], axis=-1)
        told = one.foot * sent[:, :1] + one.inner * sent[:, 1:]
        told = told + one.rear * beside[..., REAR] + one.front * beside[..., FRONT] + one.across * sent[..., MIRROR]
        told = told + one.travel * legs.travel[:, None] + one.velocity * legs.v[:, None]
        after = told + (y - told) * np.exp(-legs.stride.dt / (TAU * 2.0**one.slow))
        threshold = -one.theta[0]
        return Potentials(after), (y[:, 0] <= threshold) & (after[:, 0] > threshold)

    @cached_property
    def _constants(self) -> Constants:
        return Constants(*(np.array([[getattr(self, f"{name}_{to}")] for to in ("foot", "inner")]) for name in Constants._fields))
