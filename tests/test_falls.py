"""Two answers to whether an insect falls: its trunk touches the ground, or tilts too far, whatever the direction."""

import numpy as np
import pytest

from hexmj import LDVS, Conditions, compare, draw_starts, physical_walk
from hexmj.measures.compare import physical_flss
from hexmj.physics.outcomes import TOPPLED
from hexmj.rotations import lean

FEW = {"n_starts": 20, "observation_time": 60.0}


@pytest.fixture(scope="module")
def compared():
    return compare(LDVS, [0.5, 0.8], **FEW).isel(controller=0)


def test_who_falls_has_toppled_before(compared):
    """On flat ground: of 71 falls the first tilted by 6 degrees as the trunk touched."""
    fell, toppled = compared.fall < np.inf, compared.topple < np.inf
    assert fell.sum() > 10
    assert (compared.topple < compared.fall).values[fell].all()
    assert (toppled.sum("start") >= fell.sum("start")).all()


def test_to_topple_is_to_tilt_by_so_much_in_any_direction(compared):
    assert TOPPLED == 0.1
    assert ((compared.tilt > TOPPLED) == (compared.topple < np.inf)).all()
    assert (compared.toppled == (compared.tilt > TOPPLED).mean("start")).all()
    assert ((compared.toppled_low <= compared.toppled) & (compared.toppled <= compared.toppled_high)).all()


def test_a_walk_that_is_caught_nose_down_does_not_fall_but_topples():
    """Seen step by step: at V_p = 20 mm/s start 28 leans 15 degrees ahead and 13 to the left, onto its left front foot.

    Start 1 touches the ground 7 degrees nose-up, as most that fall do.
    """
    walk = physical_walk(draw_starts(100, 0)[[28, 1]], LDVS, 0.5, 45.0, conditions=Conditions(vp=20.0))
    leans, tilt = lean(walk.qpos[..., 3:7])
    furthest = np.degrees(leans[np.nanargmax(tilt, axis=0), [0, 1]])
    assert furthest[0] == pytest.approx([15.1, 13.3], abs=1.0)
    assert furthest[1] == pytest.approx([-6.7, 5.9], abs=1.0)
    assert np.isfinite(walk.outcomes.topple).all()
    assert np.isfinite(walk.outcomes.fall).tolist() == [False, True]


def test_physical_flss_counts_falls_and_tells_the_other_beside_it(compared):
    table = physical_flss(LDVS, [0.5, 0.8], **FEW)
    assert np.array_equal(table.flss, compared.physical)
    for name in ("toppled", "toppled_low", "toppled_high", "topple"):
        assert np.array_equal(table[name], compared[name])
