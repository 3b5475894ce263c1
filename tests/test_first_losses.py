"""First losses of static stability: the fast and the general way, of the network and of any other plan."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers.cruse1998.network import NetworkPlan
from hexmj.controllers.planning import first_losses, planned_losses
from hexmj.walks import PlannedWalk
from stepwise_ldvs import Own
from tiers import few_of

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS


@pytest.mark.slow
@pytest.mark.parametrize("order", few_of(["printed", "undelayed", "sequential"], "printed"))
@pytest.mark.parametrize("name", hexmj.PRESETS)
def test_fast_losses_are_those_of_the_plan(name, order):
    """To the last bit, for every preset and order, with an acceleration and without."""
    controller = replace(hexmj.PRESETS[name], order=order)
    starts, rng = hexmj.draw_starts(70, seed=3), np.random.default_rng(3)
    velocity, steps = rng.uniform(0.1, 0.9, 70), rng.integers(1, 500, 70)
    for acceleration in (None, hexmj.Acceleration(rate=0.05)):
        begin = partial(controller.begin, starts, velocity, STRIDE, acceleration)
        fast, planned = begin().first_losses(steps), planned_losses(begin(), steps)
        assert np.array_equal(fast, planned)
        assert 0 < (fast > 0).sum() < 70


@pytest.mark.parametrize("held", [350, 49])
def test_a_foreign_controller_has_the_same_losses_whatever_is_held_at_a_time(held, monkeypatch):
    """Seven steps, or one, and none beyond what was asked for."""
    starts, velocity, steps = hexmj.draw_starts(50, 0), np.full(50, 0.5), np.full(50, 400)
    whole = first_losses(Own().begin(starts, velocity, STRIDE), steps)
    monkeypatch.setattr("hexmj.controllers.planning.HELD", held)
    plan = Own().begin(starts, velocity, STRIDE)
    assert np.array_equal(first_losses(plan, steps), whole)
    assert (whole == 0).any()
    assert plan.done == 400
    assert np.array_equal(whole, LDVS.begin(starts, velocity, STRIDE).first_losses(steps))
    assert hexmj.flss(Own(), [0.5], n_starts=50).equals(hexmj.flss(LDVS, [0.5], n_starts=50))


def test_a_loss_in_the_last_step_that_is_looked_at_counts():
    starts, velocity = hexmj.draw_starts(40, 4), np.full(40, 0.6)
    lost = planned_losses(LDVS.begin(starts, velocity, STRIDE), np.array([300]))
    late = starts[lost > 1]
    assert len(late) > 10
    for less, expected in ((0, lost[lost > 1]), (1, np.zeros(len(late)))):
        plan = LDVS.begin(late, velocity[lost > 1], STRIDE)
        assert np.array_equal(planned_losses(plan, lost[lost > 1] - less), expected)


def test_a_centre_of_mass_on_the_edge_is_lost():
    """From the third step on L2 and R2, the last that stand, are exactly beside O; then they may be anywhere."""

    def on_the_edge(walk: PlannedWalk, done: int) -> dict[str, Any]:
        middle = {3: -4.0}.get(done, -5.0)
        return {"x": np.array([0.0, middle, 0.0, 0.0, middle, 0.0]), "stance": np.array(2 * [True, True, False])}

    plan = Own(on_the_edge).begin(np.zeros((2, 6)), np.zeros(2), STRIDE)
    assert np.array_equal(planned_losses(plan, np.array([9, 2])), [3, 0])


@pytest.mark.parametrize("how", ["legs in the air", "advanced"])
def test_losses_of_a_plan_that_was_put_elsewhere_are_of_where_it_is(how):
    def begun() -> NetworkPlan:
        plan = LDVS.begin(hexmj.draw_starts(20, 0), np.full(20, 0.3), STRIDE)
        if how == "advanced":
            plan.advance(700)
            plan.done = 0
        else:
            plan.see(plan.tips, np.arange(6) > np.ones((20, 1)))
        return plan

    steps, plain = np.full(20, 900), LDVS.begin(hexmj.draw_starts(20, 0), np.full(20, 0.3), STRIDE)
    losses = first_losses(begun(), steps)
    assert np.array_equal(losses, planned_losses(begun(), steps))
    assert not np.array_equal(losses, first_losses(plain, steps))
