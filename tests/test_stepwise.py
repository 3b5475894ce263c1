"""Plans from a function of one step: what a step may leave out, and which steps are refused."""

from typing import Any, cast

import numpy as np
import pytest

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.controllers.planning import first_losses
from hexmj.controllers.protocol import FeedbackPlan
from stepwise_ldvs import plan_of, same

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS


def test_a_step_is_broadcast_to_starts_and_legs():
    starts = hexmj.draw_starts(3, 0)
    plan = stepwise(lambda v: Step(x=np.zeros((3, 1)), stance=True, y=np.arange(6), aep=4), starts, 0.5, STRIDE)
    walk = plan.advance(2)
    assert walk.x.shape == walk.stance.shape == walk.height.shape == (2, 3, 6)
    assert walk.stance.all()
    assert walk.stance.dtype == bool
    assert (walk.y == np.arange(6)).all()
    assert (walk.aep == 4.0).all()
    assert np.isnan(walk.height).all()
    assert plan.done == 2
    assert not isinstance(plan, FeedbackPlan)


def test_what_a_step_leaves_out_is_as_usual():
    walk = plan_of(hexmj.draw_starts(2, 0)).advance(5)
    assert same(walk, hexmj.walk(hexmj.draw_starts(2, 0), LDVS, 0.5, 0.5))


def test_a_refusal_names_the_step_of_the_walk_though_it_is_looked_at_in_parts():
    count = iter(range(1000))
    plan = stepwise(lambda v: Step(np.nan if next(count) == 777 else 0.0, True), np.zeros((1, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match="step 777, start 0"):
        first_losses(plan, np.array([1000]))


def test_a_stepwise_plan_passes_on_what_is_sensed():
    received = []
    plan = stepwise(lambda v: Step(0.0, True), np.zeros((1, 6)), 0.5, STRIDE, sense=received.append)
    assert isinstance(plan, FeedbackPlan)
    sensed: Any = object()
    plan.sense(sensed)
    assert received == [sensed]


@pytest.mark.parametrize(
    ("name", "step"),
    [
        ("x", Step(np.zeros((2, 6)), True)),
        ("stance", Step(0.0, 1.0)),
        ("height", Step(0.0, True, height=cast(Any, "high"))),
        ("Step", (0.0, True)),
    ],
)
def test_an_invalid_step_is_refused(name, step):
    plan = stepwise(lambda v: step, np.zeros((3, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match=name):
        plan.advance(1)
