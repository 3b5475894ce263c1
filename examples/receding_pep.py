"""A set for V = 0.1 made by an argument: a PEP that gives way to a neighbour, and comes back if it has to wait.

What other sets lose at V = 0.1 are mostly starts in which two neighbours are lifted within the same step, so that each
hears of the other one step late.  Mechanism 3 can prevent that.  Where a leg comes to its PEP, let the PEP of the leg
behind it recede, four times as fast as legs retract: hardly any then crosses its PEP just when the neighbour is lifted.
While the neighbour protracts, mechanism 3 is silent and the PEP stays back by 4 mm, Eq. 4's cap; the leg moves 2 mm.

But a neighbour that has to wait is lifted late, and a leg that had been waiting for it would run out of its 4 mm.  So
after 1 mm the PEP comes back at once, the leg is lifted, and now the neighbour waits (mechanism 1).  On 80,000 starts
this set loses 0.0005; with PEPs that stay back 0.0036, and 0.0019 at the slope that is best for them, 0.8.

Of two opposite legs only one gives way, or both would recede together.  The numbers of the hind legs were chosen by
hand, on other starts than those of seed 1998.
"""

from pathlib import Path

import numpy as np

import hexmj
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.cruse1998.weights import NEIGHBOURS
from hexmj.legs import MIRROR

V = 0.1
AEP, PEP = hexmj.Stride().aep0, hexmj.Stride().pep0
CAP = 4.0  # the greatest shift of mechanism 3, Eq. 4 [mm]
BEFORE = 0.08  # so far before a neighbour's PEP the own one begins to recede [mm]
SLOPE = 4.0  # of a receding PEP
AT_ONCE = 50.0  # slope of a PEP that comes back
HELD = 14.0  # P^1 [mm]: no leg is lifted while the leg behind it or opposite it protracts
FAR = 1000.0  # a neutral position that no leg reaches: a shift that is the same wherever the other leg stands
HIND_LEFT = -6.5, -4.0  # shift of L3 where R3 is at its AEP, and at its PEP [mm]
HIND_RIGHT = -6.0  # shift of R3 where L3 is at its AEP [mm]
HIND_RIGHT_FROM = -9.0  # where L3 is when the PEP of R3 begins to recede [mm]
L1, L2, L3, R1, R2, R3 = range(6)


def coupled() -> hexmj.Weights:
    """The general weights."""
    w = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}

    def mechanism_3(d: int, e: int, neutral: float, ahead: float, behind: float) -> None:
        w["p31"][d, e], w["p33"][d, e], w["p32"][d, e] = neutral, ahead, behind

    for front, middle, hind in ((L1, L2, L3), (R1, R2, R3)):
        for leg, neighbour in ((middle, front), (hind, middle)):
            mechanism_3(leg, neighbour, PEP + BEFORE - CAP / SLOPE, -SLOPE, AT_ONCE)
        mechanism_3(middle, MIRROR[middle], FAR, 0.0, -CAP / FAR)
        w["p1"][middle, MIRROR[middle]] = CAP
        for leg, other in ((front, middle), (middle, hind), (front, MIRROR[front]), (hind, MIRROR[hind])):
            w["p1"][leg, other] = HELD

    mechanism_3(L1, R1, PEP + BEFORE, 0.0, -SLOPE)
    at_aep, at_pep = HIND_LEFT
    slope = (at_pep - at_aep) / (AEP - PEP)
    mechanism_3(L3, R3, AEP + at_aep / slope, slope, slope)
    mechanism_3(R3, L3, HIND_RIGHT_FROM, HIND_RIGHT / (HIND_RIGHT_FROM - AEP), -SLOPE)
    return hexmj.Weights(**w)


def main() -> None:
    """The FLSS of the set and of the hard-wired system, and the set as a parameter file."""
    giving_way = hexmj.Cruse1998(coupled(), name="PEPs that give way")
    for one in (hexmj.HWS, giving_way):
        result = hexmj.flss(one, [V], n_starts=20000, seed=1998).isel(velocity=0)
        print(f"{one.name}: FLSS {result.flss:.5f} ({result.low:.5f}-{result.high:.5f}) at V = {V}")
    path = Path("results/examples/receding_pep.toml")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(network_toml(giving_way), encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
