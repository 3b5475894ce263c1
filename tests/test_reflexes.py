"""Reflexes adapt the heights of the feet to the ground and change nothing in the plan itself."""

import numpy as np
import pytest

import hexmj
from hexmj import LDVS, InputError, Task, Terrain, load_controller
from hexmj.controllers.baselines.reflexes import Reflexes
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Sensed
from hexmj.tasks.runner import TaskWalks
from hexmj.timing import Stride

STARTS, STRIDE = hexmj.draw_starts(4, 3), Stride()


def sensed(tips: np.ndarray, contact: np.ndarray, gained: np.ndarray, tilt=(0.0, 0.0)) -> Sensed:
    """Return what all starts sense: tips in the root frame, (start, leg, 3) [mm], contacts and tilt [rad]."""
    nothing: np.ndarray = np.zeros(0)
    still = {"load": nothing, "joints": nothing, "torques": nothing, "velocity": nothing, "turning": nothing}
    return Sensed(np.arange(4), tips, contact, gained, ~gained, tilt=np.tile(tilt, (4, 1)), **still)


def standing(plan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the tips at rest at a standing height of 10 mm, and contacts of all legs, of which none is gained."""
    x, y = plan.starts + np.array(STRIDE.geometry.origin), np.broadcast_to(STRIDE.geometry.y, plan.starts.shape)
    return np.stack([x, y, np.full_like(x, -10.0)], axis=-1), np.ones(x.shape, bool), np.zeros(x.shape, bool)


@pytest.mark.slow
def test_the_interface_is_kept() -> None:
    check_controller(load_controller("ldvs-reflexes"))


def test_kinematic_walks_are_those_of_the_controller() -> None:
    plain, reflexes = (hexmj.walk(STARTS, controller, 0.4, 60.0) for controller in (LDVS, Reflexes(LDVS)))
    assert np.array_equal(plain.stance, reflexes.stance)
    np.testing.assert_allclose(plain.x, reflexes.x, atol=1e-9)


def test_legs_search_for_the_ground_and_extend_where_the_body_sinks() -> None:
    plan = begin(Reflexes(LDVS), STARTS, 0.3, STRIDE)
    tips, contact, none = standing(plan)
    plan.sense(sensed(tips, contact, none))  # pyright: ignore[reportAttributeAccessIssue]
    assert not plan.advance(1).level.any()
    contact[:, 1] = False
    plan.sense(sensed(tips, contact, none))  # pyright: ignore[reportAttributeAccessIssue]
    level = plan.advance(1).level[0]
    assert (level[:, 1] < 0).all() and (np.delete(level, 1, axis=1) >= 0).all()
    plan = begin(Reflexes(LDVS), STARTS, 0.3, STRIDE)
    tips, contact, none = standing(plan)
    plan.sense(sensed(tips, contact, none, tilt=(0.1, 0.0)))  # pyright: ignore[reportAttributeAccessIssue]
    level = plan.advance(1).level[0]
    assert (level[:, [0, 3]] < 0).all() and (level[:, [2, 5]] > 0).all()  # nose down: front legs push


def test_reflexes_halve_the_falls_at_a_step() -> None:
    task = Task("t", 0.3, Terrain.step(5.0), duration=300.0)
    fell = [
        np.isfinite(TaskWalks(one, task, 16, 17, Stride(dt=0.2)).outcomes().fall).mean()
        for one in (LDVS, Reflexes(LDVS))
    ]
    assert fell[1] <= fell[0] / 2


@pytest.mark.parametrize("name", ["lowest", "searching", "elevation", "near", "relaxing", "levelling"])
def test_impossible_settings_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=name):
        Reflexes(LDVS, **{name: -1.0})
