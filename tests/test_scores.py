"""flygym's rules: what each does to the leg that receives it, and which leg steps."""

import numpy as np
import pytest

from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.scores import Scores
from hexmj.timing import Stride

RULES = Scores()


def legs(travel: dict[int, float], swings: tuple[int, ...] = ()) -> Legs:
    """One start in which these legs have come this far in their stance, some swing and all others wait at PEP_0."""
    stride, far, stands = Stride(), np.ones((1, 6)), np.ones((1, 6), dtype=bool)
    for leg, part in travel.items():
        far[0, leg] = part
    stands[0, list(swings)] = False
    x = stride.aep0 - far * (stride.aep0 - stride.pep0)
    return Legs(x, stands, stands / 6.0, np.array([[0.5]]), stride)


def lifted(state: Legs) -> list[int]:
    return np.flatnonzero(RULES.lifts((), state)[1][0]).tolist()


@pytest.mark.parametrize(
    ("sender", "late", "received"),
    [  # stance nearly over: rule 3 with 3 to the leg behind, 2 across; just begun: rule 2 with 2.5 ahead, 1 across
        (0, True, {1: 3.0, 3: 2.0}),
        (1, True, {2: 3.0, 4: 2.0}),
        (2, True, {5: 2.0}),
        (0, False, {3: 1.0}),
        (1, False, {0: 2.5, 4: 1.0}),
        (5, False, {4: 2.5, 2: 1.0}),
    ],
)
def test_rules_2_and_3_reach_whom_the_source_says_with_its_weights(sender, late, received) -> None:
    expected = np.array([[received.get(leg, 0.0) for leg in range(6)]])
    assert np.allclose(RULES.scores(legs({sender: 1 - 1e-6 if late else 1e-6})), expected, atol=1e-5)


@pytest.mark.parametrize(("sender", "receiver"), [(1, 0), (2, 1), (4, 3), (5, 4)])
def test_rule_1_holds_the_leg_in_front_of_one_that_swings(sender, receiver) -> None:
    expected = np.where(np.arange(6) == receiver, -10.0, 0.0)
    assert np.array_equal(RULES.scores(legs({sender: 0.5}, (sender,)))[0], expected)


def test_the_leg_with_the_highest_score_steps_and_no_leg_does_in_mid_stance_or_without_a_score() -> None:
    assert lifted(legs({0: 0.9})) == [1]  # rule 3: 2.7 for the leg behind, 1.8 across
    assert lifted(legs({0: 0.9, 1: 0.5})) == []  # the highest of all scores is that of the second leg, in mid stance
    assert lifted(legs({0: 0.9, 2: 0.5}, (2,))) == [3]  # rule 1 holds the second leg
    assert lifted(legs({})) == []


def test_of_equal_scores_the_rearmost_tip_steps() -> None:
    assert lifted(legs({0: 0.9, 3: 0.9, 1: 1.1, 4: 1.2})) == [4]
    assert lifted(legs({0: 0.9, 3: 0.9, 1: 1.2, 4: 1.1})) == [1]
