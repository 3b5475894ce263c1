"""What supports a walking body: feet at the ground and feet that carry load."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexmj import LDVS, STICK_INSECT, Conditions, draw_starts, loss_time, physical_walk
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.settle import settle


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    """Some of these fall."""
    return physical_walk(draw_starts(12, 0), LDVS, 0.7, 60.0, conditions=Conditions(vp=50.0))


def test_the_higher_a_foot_may_hover_the_more_stand_and_the_later_is_a_loss(walked):
    walks = [replace(walked, height=walked.height / share).grounded for share in (0.2, 0.5, 1.0, 2.0)]
    for fewer, more in pairwise(walks):
        assert (more.stance >= fewer.stance).all()
        assert (loss_time(more) >= loss_time(fewer)).all()
    assert walks[-1].stance.sum() > walks[0].stance.sum()
    assert_array_equal(walked.outcomes.grounded_loss, loss_time(walked.grounded))


@pytest.mark.parametrize("conditions", [Conditions(), Conditions(ground="step", ground_at=45.0)])
def test_every_foot_that_the_ground_carries_is_at_the_ground(conditions):
    walk = physical_walk(draw_starts(3, 0), LDVS, 0.5, 100.0, conditions=conditions)
    assert walk.grounded.stance[walk.load > 0].all()


def test_until_the_plan_loses_stability_a_foot_stands_at_the_ground_once_it_has_landed():
    walk = physical_walk(draw_starts(12, 0), LDVS, 0.5, 60.0)
    landed, steps = walk.planned.stance.copy(), round(walk.conditions.landing_distance / walk.stride.dt)
    for late in range(1, steps + 1):
        landed[late:] &= walk.planned.stance[:-late]
    landed &= (walk.planned.time[:, None] < walk.outcomes.planned_loss)[..., None]
    assert walk.grounded.stance[landed].all()


def test_slow_walks_lose_the_feet_at_the_ground_about_as_often_as_the_planned_ones():
    lost = physical_walk(draw_starts(12, 0), LDVS, 0.5, 60.0, conditions=Conditions(vp=20.0)).outcomes
    planned, near, carried = np.isfinite([lost.planned_loss, lost.grounded_loss, lost.carried_loss]).mean(axis=1)
    assert abs(near - planned) < abs(carried - planned)


def test_it_is_the_same_for_a_body_of_another_size(walked):
    larger = replace(walked.conditions, standing_height=1.3 * walked.conditions.standing_height)
    again = replace(walked, height=1.3 * walked.height, conditions=larger)
    assert_array_equal(again.grounded.stance, walked.grounded.stance)


def test_after_a_fall_nothing_is_known(walked):
    fallen = np.isnan(walked.measured.x).any(axis=-1)
    assert fallen.any()
    assert not walked.grounded.stance[fallen].any()


@pytest.mark.slow
def test_feet_carry_the_weight_however_they_grasp():
    """Adhesion pulls feet and ground together, and carries nothing."""
    starts, weight = draw_starts(6, 0), STICK_INSECT.mass * 9810.0
    for grasp in (0.0, 1.0, 5.0):
        conditions = Conditions(vp=20.0, grasp=grasp)
        assert_allclose(settle(starts, conditions).load.sum(axis=1), weight, rtol=0.01)
        walk = physical_walk(starts, LDVS, 0.3, 60.0, conditions=conditions)
        assert_allclose(walk.load.sum(axis=-1).mean(), weight, rtol=0.02)
