"""Uncoupled phase oscillators that hold a loaded leg on the ground: Tegotae-based control.

Source: D. Owaki, M. Goda, S. Miyazawa, A. Ishiguro, A minimal model describing hexapedal interlimb coordination: the
Tegotae-based approach, Front. Neurorobot. 11:29, 2017:
    d phi_i / dt = omega - sigma_1 N_i cos phi_i + sigma_2 (1 / n_i sum_j K_ij N_j) cos phi_i      (1)
with the swing at 0 < phi < pi, and N the load on a foot. The paper was not available. The first feedback, with its
sign, is that of its first author's public code; that the second has the opposite sign, and neighbours for j, is from
memory, and without it hardly any start (at most 13 %) ends in a stable regime; values of sigma and K were not found.

Mapping: a leg's own rate is pi V_p / (AEP_0 - PEP_0) while it swings and pi V_r / (AEP_0 - PEP_0) while it stands,
and a phase does not run backward.  The tips at time 0 set the phases; a leg is lifted as its phase passes 2 pi.  Ours:
the neighbours are the legs in front, behind and across, K_ij = 1; sigma_1 = sigma_2, so that six legs that carry equal
parts do not hold each other; sigma W / 6 is half of omega, at which a leg that carries a third of the weight, and its
neighbours nothing, is just brought to a halt at the end of its stance.  From 0.3 to 1 (200 starts) greater gains lose
static stability from fewer starts up to V = 0.5, and let all legs of fast walks wait until PEP_min: from V = 0.9 on at
0.5, from 0.7 on at 0.7; at 0.3 none.  A public code for modular robots takes half of omega too.
Sensed: the load on each foot.
"""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.legs import MIRROR, N2, N4

NEIGHBOURS = np.array(2 * [2.0, 3.0, 2.0])
"""Number of legs in front, behind and across, (leg,)."""


@dataclass(frozen=True)
class Tegotae(Lifted):
    """Eq. 1."""

    own: float = 0.5
    """sigma_1 W / (6 omega), feedback of a leg that carries a sixth of the weight W over its own rate; ours."""
    neighbours: float = 0.5
    """sigma_2 W / (6 omega), the same of its neighbours; ours."""
    name: str = "tegotae"

    reads_load = True
    mirrored = True

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted`: phi / 2 pi, (start, leg) [periods]; a swing begins at each whole number."""
        return 0.5 + 0.5 * np.clip(legs.travel, 0.0, 1.0)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted`."""
        span = legs.stride.aep0 - legs.stride.pep0
        omega = 0.5 * legs.stride.dt / span * np.where(legs.stands, legs.v, 1.0)  # omega dt [periods]
        load = 6.0 * legs.load
        received = from_neighbour(N2, load) + from_neighbour(N4, load) + load[:, MIRROR]
        feedback = self.neighbours * (received / NEIGHBOURS) - self.own * load
        after = state + omega * np.maximum(1.0 + feedback * np.cos(2.0 * np.pi * state), 0.0)  # Eq. 1
        return after, np.ceil(after) > np.ceil(state)
