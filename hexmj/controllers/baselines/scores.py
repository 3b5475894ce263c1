"""Six scores, and the leg with the highest one begins a step: flygym's rule-based controller.

Source: flygym 1.2.1, examples/locomotion/rule_based_controller.py.  A leg that has begun a step goes through swing and
stance and then waits until it is selected; one leg at most is selected in a time step.  Rule 1: a leg is held while
the one behind it swings.  Rule 2: it is urged on by the one behind it and the one across early in their stance.
Rule 3: and by the one in front of it and the one across late in their stance.

Mapping: a stance goes from AEP_0 to PEP_0, and beyond PEP_0 a leg waits; waiting and swinging legs count only for the
first rule, as in the source. Fitted by us: nothing. Two things differ: of equal scores the rearmost tip steps, and not
one drawn by lot; the source's first step of a front or middle leg, drawn by lot because all its legs wait at time 0, is
left out because ours stand anywhere. Sensed: the tips, and which legs stand.

The source's waiting legs stand still; ours recede. They wait so long that from about V = 0.5 on most of them reach
PEP_min, where they swing without being selected, so that the rules no longer determine the gait.
"""

from dataclasses import dataclass

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, from_neighbour
from hexmj.legs import MIRROR, N2, N4


@dataclass(frozen=True)
class Scores(Lifted):
    """The three rules with the source's weights."""

    rule1: float = -10.0
    """Score while the leg behind swings; source."""
    rule2_ipsilateral: float = 2.5
    """Score as the leg behind begins its stance, falling to 0 at its end; source."""
    rule2_contralateral: float = 1.0
    """The same of the leg across; source."""
    rule3_ipsilateral: float = 3.0
    """Score as the leg in front ends its stance, growing from 0 at its beginning; source."""
    rule3_contralateral: float = 2.0
    """The same of the leg across; source."""
    margin: float = 0.001
    """Fraction of the highest score by which a score may be lower and still count as equal; source."""
    name: str = "flygym-rules"

    def at_start(self, legs: Legs) -> tuple[()]:
        """See `Lifted`: no state, since the states of the legs suffice."""
        return ()

    def lifts(self, state: tuple[()], legs: Legs) -> tuple[tuple[()], np.ndarray]:
        """See `Lifted`."""
        scores, waits = self.scores(legs), legs.stands & (legs.travel >= 1.0)
        highest = scores.max(axis=1, keepdims=True)  # also of legs that do not wait, as in the source
        eligible = waits & (scores > 0) & (scores >= highest - self.margin * np.abs(highest))
        rearmost = np.argmax(np.where(eligible, legs.travel, -np.inf), axis=1)
        return state, eligible & (np.arange(6) == rearmost[:, None])

    def scores(self, legs: Legs) -> np.ndarray:
        """Return the score of each leg by all rules, (start, leg)."""
        in_stance = legs.stands & (legs.travel > 0.0) & (legs.travel < 1.0)
        late = np.where(in_stance, legs.travel, 0.0)
        early = np.where(in_stance, 1.0 - legs.travel, 0.0)
        return (
            self.rule1 * from_neighbour(N2, ~legs.stands)
            + (self.rule2_ipsilateral * from_neighbour(N2, early) + self.rule2_contralateral * early[:, MIRROR])
            + (self.rule3_ipsilateral * from_neighbour(N4, late) + self.rule3_contralateral * late[:, MIRROR])
        )
