"""What is felt and counted of a walk, substep by substep, against numbers that can be reckoned in the head."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj.conditions import Conditions
from hexmj.physics.outcomes import _count_misses, _percentile
from hexmj.physics.rollout import Senses
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts

STILL = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(3, 0))


def sensors(settled, touch):
    """Sensors of starts whose feet are touched with these forces, (n, substep, leg)."""
    values = np.zeros((*touch.shape[:2], settled.compiled.model.nsensordata))
    values[:, :, settled.compiled.columns.touch] = touch
    return values


@pytest.mark.parametrize(("gap", "stands"), [(0.0, 0), (0.9995, 0), (1.0005, 1), (1.9995, 1), (2.0005, 2)])
def test_a_foot_stands_for_the_gap_after_it_was_last_carried(gap, stands):
    """The gap is told in physics steps; the foot is carried in the first of them, and never again."""
    milliseconds = gap * settle(draw_starts(1, 0)).compiled.model.opt.timestep * 1000.0
    settled = settle(draw_starts(1, 0), Conditions(contact_gap=milliseconds))
    touch = np.zeros((1, 5, 6))
    touch[:, 0] = 0.1
    senses, force = Senses(settled), np.zeros((1, 5, settled.compiled.joints))
    standing, _ = senses.feel(np.array([0]), sensors(settled, touch), force)
    assert np.array_equal(standing[0, :, 0], np.arange(5) <= stands)
    assert not senses.standing(np.array([0])).any()


@pytest.mark.parametrize(
    ("conditions", "substeps"),
    [({"contact_gap": 15.0, "vp": 120.0}, 36), ({"contact_gap": 15.0, "longest_substep": 0.5}, 36)],
)
def test_a_gap_of_whole_physics_steps_lasts_for_all_of_them(conditions, substeps):
    settled = settle(draw_starts(1, 0), Conditions(**conditions))
    touch = np.zeros((1, substeps + 9, 6))
    touch[:, 0] = 0.1
    still = np.zeros((1, 1, settled.compiled.joints))
    standing, _ = Senses(settled).feel(np.array([0]), sensors(settled, touch), still)
    assert standing[0, :, 0].sum() == 1 + substeps


def test_adhesion_is_no_load_where_a_foot_touches():
    """Below 0 where it holds a foot that pulls, and the foot stands; above the ground it holds nothing."""
    settled = settle(draw_starts(1, 0), Conditions(grasp=1.0, contact_gap=0.0))
    touch, force = np.array([[[30.0, 10.0, 0.0, 0.0, 5.0, 20.0]]]), np.full((1, 1, settled.compiled.model.nu), 20.0)
    standing, load = Senses(settled).feel(np.array([0]), sensors(settled, touch), force)
    assert load.tolist() == [[[10.0, -10.0, 0.0, 0.0, -15.0, 0.0]]]
    assert np.array_equal(standing, touch > 0)


def test_what_is_felt_last_is_what_is_known(settled):
    rng, ids = np.random.default_rng(0), np.array([2, 0])
    touch, force = rng.uniform(1, 2, (2, 4, 6)), rng.uniform(-1, 1, (2, 4, settled.compiled.joints))
    senses = Senses(settled)
    senses.feel(ids, sensors(settled, touch), force)
    known = senses.sensed(ids, settled.qpos[ids], np.zeros((2, settled.compiled.model.nv)))
    assert np.array_equal(known.load, touch[:, 3])
    assert np.array_equal(known.torques.reshape(2, -1), force[:, 3])


@pytest.mark.parametrize("heading", [0.0, np.pi / 2, -2.0])
def test_velocities_are_those_of_the_root_as_seen_from_its_heading(settled, heading):
    """Ahead, to the left and up of the root's linear velocity in the world; the turning is the root's own."""
    qpos, qvel = settled.qpos[:1].copy(), np.arange(1.0, settled.compiled.model.nv + 1)[None]
    qpos[:, 3:7] = np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)
    known = Senses(settled).sensed(np.array([0]), qpos, qvel)
    cos, sin = np.cos(heading), np.sin(heading)
    assert_allclose(known.velocity[0], [cos + 2.0 * sin, 2.0 * cos - sin, 3.0])
    assert np.array_equal(known.turning[0], [4.0, 5.0, 6.0])
    assert_allclose(known.tilt, 0.0, atol=1e-12)


@pytest.mark.parametrize(("distance", "place"), [(0.0, 0), (0.24, 0), (0.26, 1), (0.74, 2), (0.76, 3), (1e9, 3)])
def test_a_miss_is_counted_once_in_its_bin(distance, place):
    """Three bins of 0.25 mm and an open one; targets above the ground are not counted."""
    targets, feet, qpos = np.zeros((6, 3)), np.zeros(18), np.array([5.0, -3.0, 1.0, *STILL])
    targets[:, 2], targets[1:, 2] = -12.0, -11.0
    counts = np.zeros(4, dtype=np.uint32)
    for axis in range(3):
        feet[:3] = targets[0] + qpos[:3]
        feet[axis] -= distance
        _count_misses(qpos, feet, targets, (-12.0, 0.25), counts)
    assert np.array_equal(counts, 3 * (np.arange(4) == place))


def test_a_percentile_is_the_end_of_the_bin_that_holds_it():
    counts = np.array([[19, 1, 0], [18, 2, 0], [0, 0, 3], [0, 0, 0]])
    assert_allclose(_percentile(counts, 0.95, 0.25), [0.25, 0.5, np.inf, np.nan])
