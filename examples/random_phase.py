"""Why Graham's clock leads the league: its first step lifts one tripod while the other tripod carries the body.

A Graham clock with a random initial phase loses static stability and falls more often than LDVS.
"""

from dataclasses import dataclass

import numpy as np

import hexmj
from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.metronomes import Clock, Metronome


@dataclass(frozen=True)
class RandomPhase(Metronome):
    """A metronome that begins at a phase which depends on the start, and lifts each leg at its next beat."""

    def at_start(self, legs: Legs) -> Clock:
        """Begin at the fractional part of the first tip's position in units of 0.1 um."""
        phase = legs.x[:, :1] * 1e4 % 1.0
        return Clock(phase, np.floor(phase - self._lag(legs.v)))


def main() -> None:
    """Print the kinematic FLSS of 1000 starts and the frequency of falls of 100 starts."""
    for controller in (hexmj.load_controller("graham"), RandomPhase("graham", "graham, random phase"), hexmj.LDVS):
        flss = hexmj.flss(controller, [0.5], n_starts=1000, seed=17).flss.item()
        falls = hexmj.physical_flss(controller, [0.5], n_starts=100, seed=17).flss.item()
        print(f"{controller.name}: FLSS {flss:.3f}, falls {falls:.2f}")


if __name__ == "__main__":
    main()
