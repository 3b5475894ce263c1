"""A controller that is written step by step: what a step may leave out, and what is refused of it."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.controllers.planning import first_losses
from hexmj.controllers.protocol import FeedbackPlan
from hexmj.legs import LEGS
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


def test_labelled_legs_of_a_step_may_come_in_any_order():
    x = np.arange(12.0).reshape(2, 6)
    table: Any = xr.DataArray(x, dims=("start", "leg"), coords={"leg": [*LEGS]}).to_pandas()
    shuffled = table[["R1", "L2", "R3", "L1", "L3", "R2"]]
    plan = stepwise(lambda v: Step(x=shuffled, stance=shuffled > 4.0), np.zeros((2, 6)), 0.5, STRIDE)
    walk = plan.advance(1)
    assert np.array_equal(walk.x[0], x) and np.array_equal(walk.stance[0], x > 4.0)
    plan = stepwise(lambda v: Step(x=table.rename(columns={"L1": "head"}), stance=True), np.zeros((2, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match="x of a step of the legs head, L2"):
        plan.advance(1)


def test_what_a_step_leaves_out_is_as_usual():
    walk = plan_of(hexmj.draw_starts(2, 0)).advance(5)
    assert same(walk, hexmj.walk(hexmj.draw_starts(2, 0), LDVS, 0.5, 0.5))


def test_a_step_may_be_worked_on_in_place():
    """What was planned stays as it was."""
    x = np.zeros((1, 6))

    def step(v):
        np.subtract(x, 1.0, out=x)
        return Step(x, True)

    walk = stepwise(step, np.zeros((1, 6)), 0.5, STRIDE).advance(3)
    assert np.array_equal(walk.x[:, 0, 0], [-1.0, -2.0, -3.0])


def test_a_refusal_names_the_step_of_the_walk_though_it_is_looked_at_in_parts():
    count = iter(range(1000))
    plan = stepwise(lambda v: Step(np.nan if next(count) == 777 else 0.0, True), np.zeros((1, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match="x is nan in step 777, start 0"):
        first_losses(plan, np.array([1000]))


def test_a_stepwise_plan_hears_what_it_is_told():
    told = []
    plan = stepwise(lambda v: Step(0.0, True), np.zeros((1, 6)), 0.5, STRIDE, sense=told.append)
    assert isinstance(plan, FeedbackPlan)
    sensed: Any = object()
    plan.sense(sensed)
    assert told == [sensed]


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (Step(np.zeros((2, 6)), True), r"x of a step has the shape \(2, 6\); expected \(start, leg\), \(3, 6\)"),
        (Step(0.0, np.ones(5, dtype=bool)), r"stance of a step has the shape \(5,\)"),
        (Step(0.0, 1.0), "stance of a step is of type float64; expected booleans"),
        (Step(True, True), "x of a step is of type bool; expected numbers"),
        (Step(None, True), "x of a step is of type object; expected numbers"),  # pyright: ignore[reportArgumentType]
        (Step(0.0, True, height="high"), "height of a step is of type"),  # pyright: ignore[reportArgumentType]
        (Step([[0.0], [0.0, 1.0]], True), "x of a step is .* expected one array"),  # pyright: ignore[reportArgumentType]
        (Step(np.ma.masked_array(np.zeros(6), [True] + 5 * [False]), True), "x of a step is masked in part; expected"),
        ((0.0, True), r"a step gave \(0.0, True\); expected a Step, such as Step\(x, stance\)"),
        ((np.zeros((40, 6)), True), r"a step gave \(array\(.[^\n]*; expected a Step, such as Step\(x, stance\)"),
    ],
)
def test_a_step_that_makes_no_sense(step, words):
    plan = stepwise(lambda v: step, np.zeros((3, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match=words):
        plan.advance(1)


def test_stepwise_checks_what_it_begins_with():
    with pytest.raises(hexmj.InputError, match="step range"):
        plan_of(np.full((1, 6), 50.0))
    with pytest.raises(hexmj.InputError, match="steps = 0"):
        plan_of(np.zeros((1, 6))).advance(0)
