"""Laws of static stability: the margin changes sign exactly where stability is lost."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import plain_network as plain
from hexmj.controllers.cruse1998 import HWS, LDVS, UNCOORDINATED
from hexmj.legs import FIG1, MIRROR
from hexmj.measures.kinematic import first_loss, walk
from hexmj.stability import loss_time, stability_margin, support_polygon, walk_margin
from hexmj.timing import Stride


def planned_feet(x: np.ndarray) -> np.ndarray:
    return np.stack([x + np.array(FIG1.origin), np.broadcast_to(FIG1.y, x.shape)], axis=-1)


def test_sign_of_the_margin_is_the_closed_form():
    """Two independent criteria on 20,000 random postures; they may differ only on the very edge."""
    rng = np.random.default_rng(0)
    x, stance = rng.uniform(-30.0, 30.0, (20_000, 6)), rng.random((20_000, 6)) < 0.55
    margin = stability_margin(planned_feet(x), stance)
    closed = np.array([plain.stable(list(a), list(s), Stride()) for a, s in zip(x, stance, strict=True)])
    decided = ~(np.abs(margin) < 1e-9)
    assert decided.mean() > 0.99
    assert np.array_equal((margin > 0)[decided], closed[decided])
    assert closed.any()
    assert not closed.all()


@pytest.mark.parametrize("controller", [HWS, LDVS, UNCOORDINATED])
def test_compiled_first_loss_is_the_first_sign_change_of_the_margin(controller):
    starts = np.random.default_rng(1).uniform(-10.0, 10.0, (300, 6))
    polygon = loss_time(walk(starts, controller, 0.4, 60.0))
    assert np.array_equal(polygon, first_loss(starts, controller, 0.4, 60.0))
    assert np.isfinite(polygon).any()


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32 - 1), st.integers(3, 6))
def test_inside_the_margin_is_the_distance_to_the_hull(seed, standing):
    """SciPy's hull gives each edge as a unit normal and an offset: the least distance of the origin to them."""
    rng = np.random.default_rng(seed)
    feet = rng.normal(0.0, 20.0, (6, 2))
    stance = np.isin(np.arange(6), rng.permutation(6)[:standing])
    margin = stability_margin(feet, stance)
    offsets = ConvexHull(feet[stance]).equations[:, 2]
    if (offsets < 0).all():
        assert margin == pytest.approx(-offsets.max(), abs=1e-9)
    else:
        assert margin <= 0
        nearest = min(np.hypot(*(feet[i] * (1 - a) + feet[j] * a)) for i in np.flatnonzero(stance)
                      for j in np.flatnonzero(stance) for a in np.linspace(0, 1, 101))  # fmt: skip
        assert -margin <= nearest + 1e-9
        assert -margin == pytest.approx(nearest, abs=1.5)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1000.0), st.floats(-3.0, 3.0))
def test_margin_scales_with_units_and_does_not_depend_on_heading_or_leg_order(seed, unit, angle):
    rng = np.random.default_rng(seed)
    feet, stance = rng.normal(0.0, 20.0, (6, 2)), rng.random(6) < 0.7
    margin = stability_margin(feet, stance)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    order = rng.permutation(6)
    other = stability_margin(unit * (feet @ turn.T)[order], stance[order])
    assert other == pytest.approx(unit * margin, rel=1e-9, abs=1e-9 * unit)


def test_few_feet_are_never_stable():
    feet = planned_feet(np.zeros(6))
    assert stability_margin(feet, np.zeros(6, dtype=bool)) == -np.inf
    one, two = np.arange(6) == 1, np.isin(np.arange(6), [1, 4])
    assert stability_margin(feet, one) == pytest.approx(-np.hypot(4.0, 20.0))
    assert stability_margin(feet, two) == pytest.approx(-4.0)
    on_the_edge = feet - np.array([4.0, 0.0])
    assert stability_margin(on_the_edge, two) == 0.0
    assert len(support_polygon(feet, two)) == 2


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.sampled_from([0.0, 2.0]))
def test_feet_in_a_line_are_never_stable(seed, standing, beside):
    """They have no polygon, and the margin is the distance to the nearest point of their line."""
    rng = np.random.default_rng(seed)
    along, angle = rng.integers(-20, 20, 6), rng.integers(4) * np.pi / 2
    turn = np.round([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    feet, stance = np.stack([along, np.full(6, beside)], axis=1) @ turn, np.arange(6) < standing
    first, last = along[stance].min(), along[stance].max()
    off = max(first, -last, 0)
    assert stability_margin(feet, stance) == pytest.approx(-np.hypot(off, beside))
    assert np.array_equal(support_polygon(feet, stance), feet[stance])


def test_feet_in_a_slanted_line_are_never_stable():
    """Such as rounding leaves them: a polygon so thin that the signs of its corners are not known."""
    rng = np.random.default_rng(1)
    along, beside, slope = rng.normal(0.0, 10.0, (100_000, 6)), rng.normal(0.0, 1.0, (100_000, 1)), rng.normal()
    feet = np.stack([along, slope * along + beside], axis=-1)
    stance = np.arange(6) < rng.integers(3, 7, (100_000, 1))
    distance = np.abs(beside[:, 0]) / np.hypot(1.0, slope)
    margin = stability_margin(feet, stance)
    assert (margin <= -distance * (1.0 - 1e-9) + 1e-12).all()


def test_feet_in_one_place():
    corners = np.array([[10.0, 10.0], [10.0, -10.0], [-10.0, -10.0], [-10.0, 10.0], [10.0, 10.0], [0.0, 1.0]])
    assert stability_margin(corners, np.ones(6, dtype=bool)) == pytest.approx(10.0)
    assert stability_margin(np.full((6, 2), 3.0), np.ones(6, dtype=bool)) == pytest.approx(-np.hypot(3.0, 3.0))


@pytest.mark.parametrize("standing", [[0, 1, 3], [0, 2, 4], [1, 2, 4, 5], [0, 1, 2, 3, 4, 5]])
def test_support_polygon_is_the_hull_counter_clockwise(standing):
    feet, stance = planned_feet(np.zeros(6)), np.isin(np.arange(6), standing)
    for mirrored in (feet, feet * [1.0, -1.0]):
        x, y = support_polygon(mirrored, stance).T
        assert 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)) == pytest.approx(ConvexHull(feet[stance]).volume)


def test_mirrored_postures_have_equal_margins():
    rng = np.random.default_rng(2)
    x, stance = rng.uniform(-20.0, 10.0, (500, 6)), rng.random((500, 6)) < 0.6
    mirrored = stability_margin(planned_feet(x[:, MIRROR]), stance[:, MIRROR])
    assert stability_margin(planned_feet(x), stance) == pytest.approx(mirrored, abs=1e-12)


def test_unknown_after_a_fall():
    walked = walk(np.zeros((2, 6)), LDVS, 0.3, 10.0)
    walked.x[50:, 1], walked.stance[50:, 1] = np.nan, False
    margin = walk_margin(walked)
    assert np.isnan(margin[50:, 1]).all()
    assert not np.isnan(margin[:, 0]).any()


def test_a_foot_that_does_not_stand_may_be_unknown():
    walked = walk(np.zeros((1, 6)), LDVS, 0.5, 30.0)
    margin = walk_margin(walked)
    walked.x[~walked.stance] = np.nan
    assert np.array_equal(walk_margin(walked), margin)
    walked.stance[:] = False
    nowhere = replace(walked, y=np.full_like(walked.y, np.nan))
    assert np.isnan(walk_margin(nowhere)).all()
