"""What makes walking harder in the league's trials: a lost leg, poor senses, a load, a step."""

from dataclasses import replace

import numpy as np
import pytest

import hexmj
from coarse_steps import COARSE
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.leg_lost import RISE, LegLost
from hexmj.controllers.poor_senses import PoorSenses
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.errors import InputError
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.studies.entrants import Entrant
from hexmj.studies.league import League
from hexmj.studies.standings import DISTURBED, GROUNDS, TRIALS, crossed, walking
from hexmj.timing import Stride

LARGER = replace(STICK_INSECT, lengths=STICK_INSECT.lengths.scaled(1.5), standing_height=15.0)


def test_trials_are_what_they_say() -> None:
    entrant, usual = Entrant(hexmj.LDVS), Conditions()
    walked = [name for name in TRIALS if name not in DISTURBED]
    found = {name: one for name in walked if (one := walking(name, entrant, usual, 0.3, Stride()))}
    assert list(found) == walked
    assert found["load"].conditions.load == 1.0
    assert found["step"].conditions.ground_height == 3.0
    assert found["lost 2"].controller == LegLost(hexmj.LDVS, 1)
    assert found["late"].controller == PoorSenses(SensoryFeedback(hexmj.LDVS), delay=1.6)


def test_whether_it_reads_is_asked_of_walks_that_are_asked_for() -> None:
    """Of one that plans at no other velocity, and with no other time step."""
    coarse = Entrant(COARSE)
    league = League({"coarse": coarse}, [0.2], 4, 2, 1, 0.4, accelerating=False, stride=Stride(dt=0.2))
    tried = {name for name, *_ in league._tried(coarse)}
    assert {"load", "lost 1"} <= tried and "reads" not in tried


def test_grounds_lie_as_the_body_is_large() -> None:
    for body, sizes in ((STICK_INSECT, (3.0, 45.0, 75.0)), (LARGER, (4.5, 67.5, 112.5))):
        usual = Conditions(body=body)
        for name in GROUNDS:
            met = walking(name, Entrant(hexmj.LDVS), usual, 0.3, Stride())
            assert met and met.conditions.ground == name
            ground = met.conditions.ground
            assert (ground.ground_height, ground.ground_at, crossed(usual)) == pytest.approx(sizes, rel=1e-12)


def test_grounds_that_no_leg_of_a_larger_body_gets_to_are_no_trials() -> None:
    for body, expected in ((STICK_INSECT, True), (LARGER, False)):
        league = League({"ldvs": Entrant(hexmj.LDVS)}, observation_time=300.0, conditions=Conditions(body=body))
        tried = [name for name, *_ in league._tried(Entrant(hexmj.LDVS))]
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
        trial = walking("lost 1", Entrant(hexmj.LDVS), conditions, 0.3, stride)
        assert trial is not None
        plan = trial.controller.begin(hexmj.draw_starts(2, 1, stride), np.full(2, 0.3), stride)
        high.append(np.nanmax(plan.advance(300).height[..., 0]))
    assert high == pytest.approx([12.0, 18.0, 16.8])
    with pytest.raises(InputError, match=r"held = 0.0; expected a height above 0 mm"):
        LegLost(hexmj.LDVS, 0, 0.0)


@pytest.mark.thorough
def test_lame_controllers_and_those_with_poor_senses_keep_the_protocol() -> None:
    check_controller(LegLost(hexmj.LDVS, 2))
    check_controller(LegLost(SensoryFeedback(hexmj.LDVS), 2))
    check_controller(PoorSenses(SensoryFeedback(hexmj.HWS), 0.1, 1.6))
    with pytest.raises(InputError, match="poor senses of ldvs"):
        hexmj.flss(PoorSenses(hexmj.LDVS, 0.1), [0.5], n_starts=2)
    with pytest.raises(InputError, match="noise = -1"):
        PoorSenses(hexmj.LDVS, -1.0)


@pytest.mark.thorough
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
    with pytest.raises(InputError, match=r"delay = 0.04 with steps of 0.1 time units; expected at least one step"):
        late.begin(hexmj.draw_starts(1, 0), np.array([0.5]), Stride())
    assert walking("late", Entrant(hexmj.LDVS), Conditions(vp=2.0), 0.3, Stride()) is None
    assert walking("noise", Entrant(hexmj.LDVS), Conditions(vp=2.0), 0.3, Stride())
