"""Who differs from whom: differences on the same starts, and ranks where intervals separate."""

import numpy as np
from numpy.testing import assert_allclose

from hexmj.stats import paired_difference
from hexmj.studies.standings import ranks


def test_a_difference_leaves_out_starts_that_are_not_known_and_takes_parts_of_walks() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.uniform(size=(2, 50)) < [[0.3], [0.5]]
    known = rng.uniform(size=50) < 0.8
    blanked = np.where(known, one, np.nan)
    assert np.array_equal(paired_difference(blanked, other), paired_difference(one[known], other[known]))
    assert np.isnan(paired_difference(np.full(50, np.nan), other)).all()
    middle, low, high = paired_difference(one / 2, other / 2)
    whole = paired_difference(one, other)
    assert np.isclose(middle, whole[0] / 2) and low < middle < high and high - low < whole[2] - whole[1]


def test_ranks_are_given_only_where_intervals_separate() -> None:
    rng = np.random.default_rng(0)
    often, rarely, seldom = (rng.uniform(size=200) < p for p in (0.8, 0.2, 0.22))
    best, worst = ranks(np.array([often, rarely, seldom, np.full(200, np.nan)], dtype=float))
    assert best.tolist() == [3, 1, 1, 0]
    assert worst.tolist() == [3, 2, 2, 0]
    few = np.array([[0.0, 0.0], [1.0, 1.0]])  # two starts separate nobody
    assert [one.tolist() for one in ranks(few)] == [[1, 1], [2, 2]]


def test_paired_differences():
    rng = np.random.default_rng(0)
    one, other = rng.random((2, 5, 4000)) < np.array([0.5, 0.3])[:, None, None]
    middle, low, high = paired_difference(one, other)
    assert_allclose(middle, one.mean(axis=1) - other.mean(axis=1))
    back, back_low, back_high = paired_difference(other, one)
    assert_allclose([back, back_low, back_high], [-middle, -high, -low])
    spread = (one.astype(float) - other).std(axis=1) / np.sqrt(4000)  # of the mean, for many starts
    assert_allclose(high - low, 2 * 1.96 * spread, rtol=0.01)
    same, low, high = paired_difference(one, one)
    assert_allclose(same, 0.0)
    assert (low < 0).all() and (high > 0).all()
