"""flygym's rule-based controller: each leg has a score, and the leg with the highest score begins a step.

Source: flygym 1.2.1, examples/locomotion/rule_based_controller.py.  A leg that has begun a step goes through swing and
stance and then waits until it is selected; a time step selects at most one leg.  Rule 1: the score of a leg falls
while the leg behind it swings.  Rule 2: its score rises while the leg behind it or the contralateral leg is early in
stance.  Rule 3: its score rises while the leg in front of it or the contralateral leg is late in stance.

Mapping: a stance goes from AEP_0 to PEP_0, and beyond PEP_0 a leg waits; waiting and swinging legs count only for the
first rule, as in the source. Fitted by us: nothing. Two things differ. Of legs with equal scores we select the rearmost
tip, the source selects at random. The source also begins with a front or middle leg chosen at random, because all its
legs wait at time 0; ours begin anywhere in stance. Sensed: the tips, and which legs stand.

In the source waiting legs stand still; ours keep moving to the rear. From about V = 0.5 on, most of them reach PEP_min,
where they swing without being selected, so that the rules no longer determine the gait.
"""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.legs import MIRROR, N2, N4


@dataclass(frozen=True)
class Scores(Lifted):
    """The three rules, with the source's weights as defaults."""

    rule1: float = -10.0
    """Rule 1: score while the leg behind swings; from the source."""
    rule2_ipsilateral: float = 2.5
    """Rule 2: score when the leg behind begins its stance, falling to 0 at the end of it; from the source."""
    rule2_contralateral: float = 1.0
    """Rule 2: score when the contralateral leg begins its stance, falling to 0 at the end of it; from the source."""
    rule3_ipsilateral: float = 3.0
    """Rule 3: score when the leg in front ends its stance, growing from 0 at the beginning of it; from the source."""
    rule3_contralateral: float = 2.0
    """Rule 3: score when the contralateral leg ends its stance, growing from 0 at its beginning; from the source."""
    margin: float = 0.001
    """Scores lower than the highest score by at most this fraction of it count as equal; from the source."""
    name: str = "flygym-rules"

    def at_start(self, legs: Legs) -> tuple[()]:
        """See `Lifted.at_start`: the rules have no state besides the legs."""
        return ()

    def lifts(self, state: tuple[()], legs: Legs) -> tuple[tuple[()], np.ndarray]:
        """See `Lifted.lifts`."""
        scores, waits = self.scores(legs), legs.stands & (legs.travel >= 1.0)
        highest = scores.max(axis=1, keepdims=True)  # of all legs, waiting or not, as in the source
        eligible = waits & (scores > 0) & (scores >= highest - self.margin * np.abs(highest))
        rearmost = np.argmax(np.where(eligible, legs.travel, -np.inf), axis=1)
        return state, eligible & (np.arange(6) == rearmost[:, None])

    def scores(self, legs: Legs) -> np.ndarray:
        """Return the score of each leg, summed over all rules, (start, leg)."""
        in_stance = legs.stands & (legs.travel > 0.0) & (legs.travel < 1.0)
        late = np.where(in_stance, legs.travel, 0.0)
        early = np.where(in_stance, 1.0 - legs.travel, 0.0)
        return (
            self.rule1 * from_neighbour(N2, ~legs.stands)
            + (self.rule2_ipsilateral * from_neighbour(N2, early) + self.rule2_contralateral * early[:, MIRROR])
            + (self.rule3_ipsilateral * from_neighbour(N4, late) + self.rule3_contralateral * late[:, MIRROR])
        )
