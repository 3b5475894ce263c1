"""What makes walking harder in the league's trials: a lost leg, poor senses, a load, a step."""

from dataclasses import replace

import numpy as np
import pytest

import hexmj
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.wrappers import RISE, LegLost, PoorSenses
from hexmj.errors import InputError
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.studies.league import DISTURBED, GROUNDS, League, distance_to_cross
from hexmj.studies.standings import TRIALS
from hexmj.timing import Stride

ONE = {"ldvs": hexmj.LDVS}
LARGER = replace(STICK_INSECT, lengths=STICK_INSECT.lengths.scaled(1.5), standing_height=15.0)


def test_trials_are_what_they_say() -> None:
    league, walked = League(ONE), [name for name in TRIALS if name not in DISTURBED]
    found = {name: trial for name in walked if (trial := league.trial_settings(name, ONE["ldvs"]))}
    assert list(found) == walked
    assert found["load"]["conditions"].load == 1.0
    assert found["step"]["conditions"].ground_height == 3.0
    assert found["lost 2"]["controller"] == LegLost(hexmj.LDVS, 1)
    assert found["late"]["controller"] == PoorSenses(SensoryFeedback(hexmj.LDVS), delay=1.6)


def test_grounds_lie_as_the_body_is_large() -> None:
    for body, sizes in ((STICK_INSECT, (3.0, 45.0, 75.0)), (LARGER, (4.5, 67.5, 112.5))):
        usual = Conditions(body=body)
        for name in GROUNDS:
            trial = League(ONE, conditions=usual).trial_settings(name, ONE["ldvs"])
            assert trial and trial["conditions"].ground == name
            ground = trial["conditions"]
            assert (ground.ground_height, ground.ground_at, distance_to_cross(usual)) == pytest.approx(sizes, rel=1e-12)


def test_grounds_that_no_leg_of_a_larger_body_gets_to_are_no_trials() -> None:
    for body, expected in ((STICK_INSECT, True), (LARGER, False)):
        league = League(ONE, observation_time=300.0, conditions=Conditions(body=body))
        tried = [question for _, question in league.named_cells()]
        assert ("step" in tried, "load" in tried) == (expected, True), "90 mm are walked"


@pytest.mark.parametrize("leg", [0, 4])
def test_a_lost_leg_is_in_neither_measure(leg: int) -> None:
    starts, lame = hexmj.draw_starts(3, 1), LegLost(hexmj.LDVS, leg)
    planned = walk(starts, lame, 0.3, 30.0)
    assert not planned.stance[..., leg].any()
    whole = walk(starts, hexmj.LDVS, 0.3, 30.0)
    others = np.arange(6) != leg
    assert np.array_equal(planned.stance[..., others], whole.stance[..., others])
    assert np.array_equal(planned.x, whole.x)
    walked = physical_walk(starts, lame, 0.3, 30.0)
    raised = walked.measured.time > 2 * lame.held / RISE
    upright = np.isfinite(walked.height[raised][..., leg])
    assert not walked.measured.stance[raised][..., leg].any()
    assert (walked.height[raised][..., leg][upright] > lame.held / 3).mean() > 0.9


def test_a_lost_leg_is_held_above_the_standing_height_however_short_the_steps() -> None:
    high = []
    short = Stride(aep0=2.0, pep0=-2.0, pep_min=-4.0)
    tall = Conditions(standing_height=14.0)
    for conditions, stride in ((Conditions(), short), (Conditions(body=LARGER), Stride()), (tall, Stride())):
        trial = League(ONE, conditions=conditions, stride=stride).trial_settings("lost 1", ONE["ldvs"])
        assert trial is not None
        plan = trial["controller"].begin(hexmj.draw_starts(2, 1, stride), np.full(2, 0.3), stride)
        high.append(np.nanmax(plan.advance(300).height[..., 0]))
    assert high == pytest.approx([12.0, 18.0, 16.8])
    with pytest.raises(InputError):
        LegLost(hexmj.LDVS, 0, 0.0)


@pytest.mark.slow
def test_lame_controllers_and_those_with_poor_senses_keep_the_protocol() -> None:
    check_controller(LegLost(hexmj.LDVS, 2))
    check_controller(LegLost(SensoryFeedback(hexmj.LDVS), 2))
    check_controller(PoorSenses(SensoryFeedback(hexmj.HWS), 0.1, 1.6))
    with pytest.raises(InputError):
        hexmj.flss(PoorSenses(hexmj.LDVS, 0.1), [0.5], n_starts=2)
    with pytest.raises(InputError):
        PoorSenses(hexmj.LDVS, -1.0)


@pytest.mark.slow
def test_poor_senses_that_are_perfect_change_nothing_and_errors_are_a_starts_own() -> None:
    starts, model_variant = hexmj.draw_starts(3, 2), SensoryFeedback(hexmj.LDVS)
    plain, perfect = (physical_walk(starts, one, 0.5, 40.0).qpos for one in (model_variant, PoorSenses(model_variant)))
    assert np.array_equal(plain, perfect, equal_nan=True)
    noisy = PoorSenses(model_variant, noise=0.1)
    together, alone = (physical_walk(some, noisy, 0.5, 40.0).qpos for some in (starts, starts[2:]))
    assert np.array_equal(together[:, 2:], alone, equal_nan=True)
    assert not np.array_equal(together, plain, equal_nan=True)
    late = physical_walk(starts, PoorSenses(model_variant, delay=2.0), 0.5, 40.0).qpos
    assert not np.array_equal(late, plain, equal_nan=True)


def test_a_delay_that_is_no_step_is_refused_and_no_trial() -> None:
    late = PoorSenses(SensoryFeedback(hexmj.LDVS), delay=0.04)
    with pytest.raises(InputError):
        late.begin(hexmj.draw_starts(1, 0), np.array([0.5]), Stride())
    slow = League(ONE, conditions=Conditions(vp=2.0))
    assert slow.trial_settings("late", ONE["ldvs"]) is None and slow.trial_settings("noise", ONE["ldvs"])
