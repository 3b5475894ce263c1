"""Sensory feedback in kinematic walks, where nothing is sensed."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import hexmj
from hexmj.controllers.feedback import SensedPlan
from hexmj.controllers.planning import first_losses, planned_losses
from stepwise_ldvs import Own, same

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS


@pytest.mark.parametrize("controller", [Own(), hexmj.SensoryFeedback(LDVS)])
def test_feedback_needs_steerable_plans_without_feedback(controller):
    with pytest.raises(hexmj.InputError, match="feedback"):
        hexmj.SensoryFeedback(controller).begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)


@pytest.mark.parametrize("acceleration", [None, hexmj.Acceleration(rate=0.01)])
@pytest.mark.parametrize("name", ["hws", "ldvs", "own"])
def test_feedback_changes_nothing_in_a_kinematic_walk(name, acceleration):
    """Neither the plan nor its losses, by either way to them."""
    controller, starts = hexmj.PRESETS[name], hexmj.draw_starts(20, 5)
    velocity, steps = np.linspace(0.1, 0.9, 20), np.full(20, 300)
    feedback = hexmj.SensoryFeedback(controller)
    inner, outer = (one.begin(starts, velocity, STRIDE, acceleration) for one in (controller, feedback))
    one, other = inner.advance(300), outer.advance(300)
    assert same(one, replace(other, aep=one.aep))
    begin = partial(feedback.begin, starts, velocity, STRIDE, acceleration)
    fast, general = first_losses(begin(), steps), planned_losses(begin(), steps)
    assert np.array_equal(fast, general)
    assert np.array_equal(fast, first_losses(controller.begin(starts, velocity, STRIDE, acceleration), steps))


def test_feedback_goes_on_from_the_legs_as_a_plan_begins_with_them():
    """One whose tripod is lifted at time 0, by what its controller has done to it."""
    starts, velocity, lifted = hexmj.draw_starts(20, 0), np.full(20, 0.5), np.arange(6) % 2 == 0
    plans = [LDVS.begin(starts, velocity, STRIDE) for _ in range(2)]
    for plan in plans:
        plan.see(plan.tips, np.tile(~lifted, (20, 1)))
    feedback, step = SensedPlan(plans[0]).advance(300), plans[1].advance(300)
    assert same(step, replace(feedback, aep=step.aep))
    assert not same(step, LDVS.begin(starts, velocity, STRIDE).advance(300))
