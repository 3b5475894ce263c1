"""Re-planning after the announced loss of a leg: stable gaits on five legs, and the change to them."""

import numpy as np
import pytest

import hexmj
from hexmj import LDVS, InputError, LegLost, Task, load_controller
from hexmj.controllers.baselines.replanning import FiveLegs, Replanning, five_legged_gaits
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.wrappers import LegLost as WithoutLeg
from hexmj.stability import walk_margin
from hexmj.tasks.runner import TaskWalks
from hexmj.timing import Stride

STARTS, V = hexmj.draw_starts(8, 3), 0.3


def test_the_interface_is_kept_and_starts_do_not_depend_on_each_other() -> None:
    check_controller(Replanning(LDVS))
    walks = [hexmj.walk(starts, FiveLegs(2), V, 50.0) for starts in (STARTS, STARTS[5:6])]
    assert np.array_equal(walks[0].x[:, 5], walks[1].x[:, 0])


def test_without_a_lost_leg_nothing_changes() -> None:
    plain, same = (hexmj.walk(STARTS, controller, V, 40.0) for controller in (LDVS, load_controller("ldvs-replans")))
    assert np.array_equal(plain.x, same.x) and np.array_equal(plain.stance, same.stance)


def test_the_gaits_after_the_loss_of_a_front_leg_are_stable() -> None:
    lengths, gaits = five_legged_gaits(0, V, Stride())
    assert gaits.shape == (len(lengths), 6) and not gaits[:, 0].any()
    walk = hexmj.walk(STARTS, WithoutLeg(FiveLegs(0), 0), V, 350.0)
    stable = (walk_margin(walk)[-1000:] > 0).all(axis=0)
    assert stable.mean() > 0.5


@pytest.mark.parametrize("leg", [0, 4])
def test_the_plan_changes_when_the_leg_is_lost(leg: int) -> None:
    controller = Replanning(LDVS).after_loss(leg, 30.0)
    whole, plain = (hexmj.walk(STARTS, one, V, 60.0) for one in (controller, LDVS))
    assert np.array_equal(whole.x[:300], plain.x[:300]) and not np.array_equal(whole.x[300:], plain.x[300:])
    assert np.abs(np.diff(whole.x, axis=0)).max() < Stride().dt + 1e-9
    plan = controller.begin(STARTS, np.full(8, V), Stride())
    parts = np.concatenate([plan.advance(steps).x for steps in (250, 100, 250)])
    assert np.array_equal(parts, whole.x)


def test_an_announced_loss_is_survived_more_often() -> None:
    task = Task("t", V, events=(LegLost(0, announced=True),), duration=120.0)
    fell = [
        np.isfinite(TaskWalks(one, task, 20, 17, Stride()).outcomes().fall).mean()
        for one in (LDVS, load_controller("ldvs-replans"))
    ]
    assert fell[1] < fell[0]


def test_only_steerable_controllers_can_be_wrapped() -> None:
    with pytest.raises(InputError, match="lost"):
        Replanning(LDVS, 6)
    with pytest.raises(InputError, match="lost"):
        FiveLegs(-1)
