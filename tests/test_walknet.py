"""Walknet: what each rule does to its receivers, as its sources print it, and the gaits that come of them."""

from dataclasses import replace

import numpy as np
import pytest

import hexmj
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.walknet import CURVE, REACOG, Constants, Walknet, sent_load
from hexmj.errors import InputError
from hexmj.gaits import gait
from hexmj.measures.kinematic import walk
from hexmj.phases import IPSILATERAL
from hexmj.timing import Stride

L1, L2, L3, R1, R2, R3 = range(6)

CURVE_SENDS: dict[tuple[int, str], dict[int, dict[int, float]]] = {
    (1, "swings"): {L1: {}, L2: {L1: -0.7}, L3: {L2: -0.7, R3: -0.7}},
    (1, "landed"): {L1: {}, L2: {L1: -0.2}, L3: {L2: -0.2, R3: -0.2}},
    (2, "stood"): {L1: {R1: 0.1375}, L2: {L1: 0.5375, R2: 0.1375}, L3: {L2: 0.5375, R3: 0.1375}},
    (3, "along"): {L1: {L2: 0.4}, L2: {L3: 0.4}, L3: {}},
    (3, "across"): {L1: {R1: 0.3125}, L2: {}, L3: {R3: 0.375}},
}
"""single_leg_controller.py: rule and what the sender does -> sender -> receiver -> shift [step lengths]."""

REACOG_SENDS: dict[tuple[int, str], dict[int, dict[int, float]]] = {
    (1, "swings"): {L1: {L2: -0.065, R1: -0.13}, L2: {L1: -0.2, L3: -0.13}, L3: {L2: -0.2, R3: -0.13}},
    (1, "landed"): {L1: {L2: -0.01625, R1: -0.0325}, L2: {L1: -0.05, L3: -0.0325}, L3: {L2: -0.05, R3: -0.0325}},
    (2, "stood"): {L1: {R1: 0.02}, L2: {L1: 0.08, R2: 0.02}, L3: {L2: 0.08, R3: 0.02}},
    (3, "along"): {L1: {L2: 0.045}, L2: {L3: 0.06}, L3: {}},
    (3, "across"): {L1: {R1: 0.1}, L2: {}, L3: {R3: 0.1 / 3}},
}
"""WalknetSettings.py: the same [m]."""

V = {"curve": 0.06, "reacog": 0.02}
"""The sources' own velocities [m/s]: the fastest of the one, the only one of the other."""

DOES = {
    "curve": {"landed": (0.26, 0.0), "stood": (0.3, 0.0), "along": (9.0, 0.8), "across": (9.0, 0.45)},
    "reacog": {"landed": (0.25, 0.0), "stood": (0.4, 0.0), "along": (9.0, 0.9), "across": (9.0, 0.5)},
}
"""Time since touchdown [s] and travel since AEP [step lengths], at these velocities."""


def shifts(constants: Constants, rule: int, leg: int, v: float, age: float = 9.0, travel: float = 0.0) -> np.ndarray:
    """What one leg does to all [step lengths]: it swings at `age` below 0, or has stood so long [s] and gone so far."""
    stride, alone = Stride(), np.arange(6) == leg
    x = np.where(alone, stride.aep0 - travel * (stride.aep0 - stride.pep0), stride.aep0)[None]
    stands = ~alone[None] | (age >= 0)
    second = constants.swing_speed / constants.step_length * (stride.aep0 - stride.pep0)
    ages = np.where(alone, age * second, np.inf)[None]
    legs = Legs(x, stands, np.zeros(x.shape), np.array([[v / constants.swing_speed]]), stride)
    return Walknet(constants=constants).shift(rule, legs, ages)[0]


@pytest.mark.parametrize(
    ("name", "constants", "sends"), [("curve", CURVE, CURVE_SENDS), ("reacog", REACOG, REACOG_SENDS)]
)
def test_each_rule_shifts_the_pep_of_the_legs_and_by_as_much_as_its_source_prints(name, constants, sends) -> None:
    unit = 1.0 if name == "curve" else constants.step_length
    for (rule, what), table in sends.items():
        age, travel = DOES[name].get(what, (-1.0, 0.5))
        for leg, received in table.items():
            expected = np.array([received.get(other, 0.0) for other in range(6)]) / unit
            assert np.allclose(shifts(constants, rule, leg, V[name], age, travel), expected), (rule, what, leg)
            mirrored = shifts(constants, rule, (leg + 3) % 6, V[name], age, travel)
            assert np.array_equal(np.roll(mirrored, 3), shifts(constants, rule, leg, V[name], age, travel))


@pytest.mark.parametrize(
    ("constants", "v", "delay"), [(CURVE, 0.05, 0.27), (CURVE, 0.107, 0.2), (REACOG, 0.02, 0.26), (REACOG, 0.035, 0.11)]
)
def test_rule_1_lasts_after_touchdown_for_a_time_that_falls_with_velocity(constants, v, delay) -> None:
    assert shifts(constants, 1, L2, v, delay - 0.005)[L1] < 0 == shifts(constants, 1, L2, v, delay + 0.005)[L1]


@pytest.mark.parametrize(("constants", "begin", "end"), [(CURVE, 0.27, 0.32), (REACOG, 0.37, 0.42)])
def test_rule_2_acts_within_its_window_of_time(constants, begin, end) -> None:
    found = [
        shifts(constants, 2, L2, 0.02, age)[L1] > 0 for age in (begin - 0.01, begin + 0.01, end - 0.01, end + 0.01)
    ]
    assert found == [False, True, True, False]


@pytest.mark.parametrize(
    ("constants", "v", "ipsilateral", "contralateral"),
    [
        (CURVE, 0.02, (0.9627, 1.0627), (0.47, 0.57)),
        (CURVE, 0.085, (0.5, 0.6), (0.3725, 0.4725)),
        (REACOG, 0.02, (0.724, 1.0365), (0.38, 0.5675)),
        (REACOG, 0.005, (0.901, 1.2135), (0.47, 0.6575)),
    ],
)
def test_rule_3_acts_within_its_window_of_travel(constants, v, ipsilateral, contralateral) -> None:
    for receiver, (begin, end) in ((L2, ipsilateral), (R1, contralateral)):
        at = (begin - 0.01, begin + 0.01, end - 0.01, end + 0.01)
        found = [shifts(constants, 3, L1, v, 9.0, travel)[receiver] > 0 for travel in at]
        assert found == [False, True, True, False]


def test_rule_5_delays_the_neighbours_of_a_loaded_leg_above_its_threshold() -> None:
    assert np.allclose(sent_load(np.array([0.0, 0.4 / 3, 1 / 6, 1 / 3, 1.0])), [0.0, 0.0, 0.1, 0.6, 0.6])
    stride, load = Stride(), np.array([[0.0, 1 / 3, 0.0, 0.0, 0.0, 0.0]])
    legs = Legs(np.full((1, 6), stride.aep0), load == 0, load, np.array([[0.3]]), stride)
    found = BASELINES["walknet-load"].shift(5, legs, np.full((1, 6), np.inf))  # pyright: ignore[reportAttributeAccessIssue]
    assert np.allclose(found, [[-0.12, 0.0, -0.12, 0.0, -0.06, 0.0]])


@pytest.mark.parametrize(("rules", "earliest", "latest"), [((), 0, 0), ((1,), 0, -1), ((2,), 1, 0), ((3,), 1, 0)])
def test_in_a_walk_rule_1_only_delays_swings_and_rules_2_and_3_only_hasten_them(rules, earliest, latest) -> None:
    stride = Stride()
    found = walk(hexmj.draw_starts(10, 4), Walknet(rules=rules), 0.4, 3 * stride.periods(0.4))
    peps = found.x[:-1][found.stance[:-1] & ~found.stance[1:]]
    for pep, expected in ((peps.max(), earliest), (peps.min(), latest)):
        assert (abs(pep - stride.pep0) < 0.1) if not expected else (expected * (pep - stride.pep0) > 1.0)


@pytest.mark.parametrize(("v", "along"), [(0.2, 0.75), (0.5, 0.5)])
def test_swings_run_from_hind_to_front_when_slow_and_in_tripods_when_faster(v: float, along: float) -> None:
    stride = Stride(dt=0.5)
    found = gait(walk(hexmj.draw_starts(6, 1, stride), Walknet(), v, 18 * stride.periods(v), stride=stride))
    expected = np.where(np.arange(7) < IPSILATERAL.stop, along, 0.5)
    assert (np.abs(found.phase - expected) < 0.06).all(axis=1).mean() > 0.8  # a start may end in another regime
    assert found.stable.mean() > 0.8


def test_no_step_is_shorter_than_the_least() -> None:
    starts, stride = hexmj.draw_starts(20, 2), Stride()
    for constants in (CURVE, REACOG):
        found = walk(starts, Walknet(constants=constants), 0.8, 3 * stride.periods(0.8))
        lifted = found.stance[:-1] & ~found.stance[1:]
        assert found.x[:-1][lifted].max() < stride.aep0 - 20 * constants.least_step


def test_a_rule_is_left_out_by_name_and_others_are_refused() -> None:
    one = Walknet().without(2)
    assert (one.name, one.rules) == ("walknet-without-2", (1, 3))
    assert BASELINES["walknet-load"].reads_load  # pyright: ignore[reportAttributeAccessIssue]
    assert not one.reads_load
    with pytest.raises(InputError, match="expected some of 1, 2, 3 and 5"):
        replace(one, rules=(4,))
