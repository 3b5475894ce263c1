"""A controller that reads its legs, on paper, where there is nothing to be read."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

import hexmj
from hexmj.controllers.planning import first_losses, planned_losses
from hexmj.controllers.feedback import SensedPlan
from hexmj.environments.learned import WithOffsets
from stepwise_ldvs import Own, same

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS


def test_feedback_needs_plans_that_can_be_steered():
    model_variant = hexmj.SensoryFeedback(Own())
    with pytest.raises(hexmj.InputError, match="feedback around own; expected a controller whose plans can go on"):
        model_variant.begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)
    with pytest.raises(
        hexmj.InputError, match=r"feedback around .*; expected another: this one reads the legs already"
    ):
        hexmj.SensoryFeedback(hexmj.SensoryFeedback(LDVS)).begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)


@pytest.mark.parametrize("acceleration", [None, hexmj.Acceleration(rate=0.01)])
@pytest.mark.parametrize("name", ["hws", "ldvs", "own"])
def test_on_paper_reading_the_legs_changes_nothing(name, acceleration):
    """Neither the plan nor its losses, by either way to them."""
    controller, starts = hexmj.PRESETS[name], hexmj.draw_starts(20, 5)
    velocity, steps = np.linspace(0.1, 0.9, 20), np.full(20, 300)
    model_variant = hexmj.SensoryFeedback(controller)
    inner, outer = (one.begin(starts, velocity, STRIDE, acceleration) for one in (controller, model_variant))
    one, other = inner.advance(300), outer.advance(300)
    assert same(one, replace(other, aep=one.aep))
    begin = partial(model_variant.begin, starts, velocity, STRIDE, acceleration)
    fast, general = first_losses(begin(), steps), planned_losses(begin(), steps)
    assert np.array_equal(fast, general)
    assert np.array_equal(fast, first_losses(controller.begin(starts, velocity, STRIDE, acceleration), steps))


def test_feedback_goes_on_from_the_legs_as_a_plan_begins_with_them():
    """One whose tripod is lifted at time 0, by what its controller has done to it."""
    starts, velocity, lifted = hexmj.draw_starts(20, 0), np.full(20, 0.5), np.arange(6) % 2 == 0
    plans = [LDVS.begin(starts, velocity, STRIDE) for _ in range(2)]
    for plan in plans:
        plan.see(plan.tips, np.tile(~lifted, (20, 1)))
    model_variant, step = SensedPlan(plans[0]).advance(300), plans[1].advance(300)
    assert same(step, replace(model_variant, aep=step.aep))
    assert not same(step, LDVS.begin(starts, velocity, STRIDE).advance(300))


def test_feedback_keeps_what_it_remembers_from_plans_that_go_on_in_what_they_see(monkeypatch):
    """A plan may step on in the very arrays that it was told."""
    starts, velocity = hexmj.draw_starts(5, 0), np.full(5, 0.5)
    usual, plan = LDVS.begin(starts, velocity, STRIDE).advance(100), LDVS.begin(starts, velocity, STRIDE)
    see = type(plan).see

    def seen(plan, tips, standing):
        see(plan, tips.copy(), standing.copy())
        tips -= 1.0
        standing[:] = False

    monkeypatch.setattr(type(plan), "see", seen)
    walked = SensedPlan(plan).advance(100)
    assert same(usual, replace(walked, aep=usual.aep))


def test_feedback_copies_steps_of_plans_that_fill_the_same_arrays_again(monkeypatch):
    starts, velocity = hexmj.draw_starts(5, 0), np.full(5, 0.5)
    usual, plan = LDVS.begin(starts, velocity, STRIDE).advance(100), LDVS.begin(starts, velocity, STRIDE)
    own, advance = plan.advance(0), type(plan).advance

    def refilled(plan, steps):
        nonlocal own
        walk = advance(plan, steps)
        if len(own.time) != steps:
            own = walk
        for name in ("time", "x", "stance"):
            getattr(own, name)[:] = getattr(walk, name)
        return own

    monkeypatch.setattr(type(plan), "advance", refilled)
    for wrapped in (SensedPlan(plan).advance(100), WithOffsets(Still()).begin(starts, velocity, STRIDE).advance(100)):
        assert np.array_equal(wrapped.stance, usual.stance)
        assert np.array_equal(wrapped.time, usual.time)


def test_steps_of_feedback_are_whosever_asked_for_them():
    starts, velocity = hexmj.draw_starts(5, 0), np.full(5, 0.5)
    plan, other = (hexmj.SensoryFeedback(LDVS).begin(starts, velocity, STRIDE) for _ in range(2))
    for _ in range(50):
        usual, step = other.advance(1), plan.advance(1)
        assert np.array_equal(step.x, usual.x) and np.array_equal(step.stance, usual.stance)
        step.x[:], step.stance[:] = 0.0, False


@dataclass(frozen=True)
class Still:
    """A policy that does nothing."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        return np.zeros((len(felt), 18))
