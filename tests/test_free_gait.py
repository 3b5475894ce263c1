"""The free gait lifts only legs that the body can spare."""

from typing import Any

import pytest

import hexmj
from hexmj.controllers.baselines.free_gait import FreeGait
from hexmj.controllers.conformance import check_controller
from hexmj.errors import InputError

STRIDE, STARTS, FREE = hexmj.Stride(), hexmj.draw_starts(100, 67), FreeGait()


def test_the_interface():
    check_controller(FREE)


@pytest.mark.parametrize("v", [0.05, 0.2, 0.3])
def test_slow_walks_keep_their_stability_margin(v):
    walk = hexmj.walk(STARTS, FREE, v, STRIDE.periods(v, 2.0))
    lifted = (~walk.stance).any(axis=2)
    assert lifted.any(axis=0).all() and hexmj.walk_margin(walk)[lifted].min() >= FREE.margin - 0.1


def test_legs_step_at_least_the_least_step_unless_they_reach_their_end():
    walk = hexmj.walk(STARTS, FREE, 0.3, 200.0)
    lifted = walk.stance[:-1] & ~walk.stance[1:]
    x = walk.x[1:][lifted]
    assert ((x <= STRIDE.aep0 - FREE.least_step + 1e-9) | (x <= STRIDE.pep_min)).all() and len(x) > 100


@pytest.mark.parametrize("settings", [{"margin": -1.0}, {"least_step": 0.0}], ids=lambda values: next(iter(values)))
def test_impossible_settings_are_refused(settings: dict[str, Any]):
    with pytest.raises(InputError, match=next(iter(settings))):
        FreeGait(**settings)
