"""Tegotae-based control: phase oscillators without direct coupling, whose feedback keeps a loaded leg in stance.

Source: D. Owaki, M. Goda, S. Miyazawa, A. Ishiguro, A minimal model describing hexapedal interlimb coordination: the
Tegotae-based approach, Front. Neurorobot. 11:29, 2017:
    d phi_i / dt = omega - sigma_1 N_i cos phi_i + sigma_2 (1 / n_i sum_j K_ij N_j) cos phi_i      (1)
with the swing at 0 < phi < pi, and N the load on a foot. The paper was not available. The first feedback term, with its
sign, is from its first author's public code; the second term (opposite sign, j are neighbours) is from memory. Without
the second term at most 13 % of the starts end in a stable steady-state gait. We did not find values of sigma and K.

Mapping: omega is pi V_p / (AEP_0 - PEP_0) while a leg swings and pi V_r / (AEP_0 - PEP_0) while it stands; a phase does
not run backward.  The tips at time 0 set the phases; a leg is lifted when its phase passes 2 pi.  Chosen by us: the
neighbours are the legs in front, behind and across, K_ij = 1; sigma_1 = sigma_2, so that the feedback of six equally
loaded legs cancels; sigma W / 6 = omega / 2, with which a leg that carries a third of the weight just stops at the end
of its stance if its neighbours carry nothing.  Of gains sigma W / (6 omega) from 0.3 to 1 (200 starts), higher gains
lose static stability less often up to V = 0.5, but let all legs wait until PEP_min in fast walks: with 0.5 from V = 0.9
on, with 0.7 from V = 0.7 on, with 0.3 never.  A public code for modular robots uses omega / 2 too.
Sensed: the load on each foot.
"""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.legs import MIRROR, N2, N4

NEIGHBOURS = np.array(2 * [2.0, 3.0, 2.0])
"""(leg,) number n_i of neighbours: legs in front, behind and across."""


@dataclass(frozen=True)
class Tegotae(Lifted):
    """Six phase oscillators with load feedback, Eq. 1."""

    own: float = 0.5
    """sigma_1 W / (6 omega), chosen by us: feedback of a leg's own load, W / 6 (W: weight), as a share of omega."""
    neighbours: float = 0.5
    """sigma_2 W / (6 omega), chosen by us: feedback of neighbours that each carry W / 6, as a share of omega."""
    name: str = "tegotae"

    reads_load = True
    mirrored = True

    def at_start(self, legs: Legs) -> np.ndarray:
        """See `Lifted.at_start`: phases phi / 2 pi, (start, leg) [periods]; a swing begins at each whole number."""
        return 0.5 + 0.5 * np.clip(legs.travel, 0.0, 1.0)

    def lifts(self, state: np.ndarray, legs: Legs) -> tuple[np.ndarray, np.ndarray]:
        """See `Lifted.lifts`."""
        span = legs.stride.aep0 - legs.stride.pep0
        omega = 0.5 * legs.stride.dt / span * np.where(legs.stands, legs.v, 1.0)  # omega dt [periods]
        load = 6.0 * legs.load
        received = from_neighbour(N2, load) + from_neighbour(N4, load) + load[:, MIRROR]
        feedback = self.neighbours * (received / NEIGHBOURS) - self.own * load
        after = state + omega * np.maximum(1.0 + feedback * np.cos(2.0 * np.pi * state), 0.0)  # Eq. 1
        return after, np.ceil(after) > np.ceil(state)
