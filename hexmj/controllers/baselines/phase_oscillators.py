"""Coupled phase oscillators, one per leg, without sensory feedback: flygym's central pattern generator (CPG).

Source: flygym 1.2.1, examples/locomotion/cpg_controller.py (`calculate_ddt`) and preprogrammed.py (`get_cpg_biases`):
    d theta_i / dt = 2 pi nu + sum_j r_j w_ij sin(theta_j - theta_i - phi_ij)     (1)
    d r_i / dt = alpha (R - r_i)                                                  (2)

Mapping: 1 / nu is one period (AEP_0 - PEP_0) (1 + 1/V) of a leg, and w and alpha keep their ratio to nu. The swing is
the first V / (1 + V) of the phase: without coupling a swing lasts (AEP_0 - PEP_0) / V_p and a stance (AEP_0 - PEP_0) /
V_r. A leg is lifted when its phase reaches the swing. In the source r is the size of the step too; here legs step over
the whole range, and r only scales the coupling. Fitted by us: nothing. Sensed: the tips at time 0, which set the phases
(the source draws them at random); nothing afterwards.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, sum_of_legs

NU = 12.0
"""Intrinsic frequency of the source [Hz]; w and alpha are scaled by nu / `NU`."""

AHEAD = {"tripod": (2, (0, 1, 0, 1, 0, 1)), "tetrapod": (3, (0, 1, 2, 2, 0, 1)), "wave": (6, (0, 1, 2, 3, 4, 5))}
"""Gait -> number of equal parts of its period, and the lead of each leg over leg 1 in these parts."""

BIASES = {gait: -np.subtract.outer(ahead, ahead) % parts / parts for gait, (parts, ahead) in AHEAD.items()}
"""Gait -> phi_ij / 2 pi: the lead of leg j over leg i [periods], (leg i, leg j)."""


class Oscillators(NamedTuple):
    """State of the oscillators."""

    phase: np.ndarray
    """(start, leg) phase theta / 2 pi [periods]; a swing begins at each whole number."""
    amplitude: np.ndarray
    """(start, 1) amplitude r, which is the same for all legs, since they begin with the same r."""


@dataclass(frozen=True)
class PhaseOscillators(Lifted):
    """Six coupled oscillators, Eqs. 1 and 2, with the source's constants as defaults."""

    gait: Literal["tripod", "tetrapod", "wave"] = "tripod"
    """Gait whose phase differences, `BIASES`, the coupling stabilises."""
    coupling: float = 10.0
    """w_ij where phi_ij > 0 [1/s at `NU`], from the source; w_ij is 0 elsewhere."""
    convergence: float = 20.0
    """alpha, rate at which r approaches R [1/s at `NU`]; from the source."""
    amplitude: float = 1.0
    """R, final amplitude; from the source."""
    amplitude_at_start: float = 0.0
    """r at time 0; from the source."""
    name: str = "cpg-tripod"

    @property
    def mirrored(self) -> bool:
        """Whether mirrored starts give mirrored walks: only in the tripod, which treats both sides alike."""
        return self.gait == "tripod"

    def at_start(self, legs: Legs) -> Oscillators:
        """See `Lifted.at_start`."""
        swing = 1.0 - legs.stance_part
        phase = swing + legs.stance_part * np.clip(legs.travel, 0.0, 1.0)
        return Oscillators(phase, np.full_like(legs.v, self.amplitude_at_start))

    def lifts(self, state: Oscillators, legs: Legs) -> tuple[Oscillators, np.ndarray]:
        """See `Lifted.lifts`."""
        span = legs.stride.aep0 - legs.stride.pep0
        periods = legs.stride.dt / span * (1.0 - legs.stance_part)  # nu dt
        phase, r = state
        bias = BIASES[self.gait]
        ahead = phase[:, None, :] - phase[:, :, None] - bias  # (start, leg i, leg j)
        pulls = sum_of_legs(np.where(bias > 0, np.sin(2.0 * np.pi * ahead), 0.0))  # the sum of Eq. 1
        pull = r * self.coupling / NU * pulls / (2.0 * np.pi)
        after = phase + periods * (1.0 + pull)  # Eq. 1, Euler as in the source
        r = r + periods * self.convergence / NU * (self.amplitude - r)  # Eq. 2
        return Oscillators(after, r), np.ceil(after) > np.ceil(phase)
