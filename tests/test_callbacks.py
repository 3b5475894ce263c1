"""MuJoCo's callbacks: ours while a batch steps, the user's own otherwise, and none that changes the physics."""

from collections.abc import Generator
from time import perf_counter, sleep
from typing import Any, cast

import mujoco
import numpy as np
import pytest
from numba import cfunc

from hexmj.controllers.planning import begin
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.environments import dm
from hexmj.environments.gym import StickInsect
from hexmj.environments.vector import StickInsects
from hexmj.errors import InputError, SimulationError
from hexmj.physics.engine import CHANGING, STOPPED_CLOCK, UNLOGGED
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(24, 0))


def test_mujocos_clock_stops_only_while_a_batch_steps(settled):
    assert mujoco.get_mjcb_time() is None
    with STOPPED_CLOCK:
        assert mujoco.get_mjcb_time() is not None
    assert mujoco.get_mjcb_time() is None
    list(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 4.0))
    assert mujoco.get_mjcb_time() is None


@pytest.fixture
def unheard():
    others = mujoco.get_mju_user_warning()  # dm_control sets one, if it was imported
    mujoco.set_mju_user_warning(None)
    yield
    mujoco.set_mju_user_warning(others)


@pytest.mark.usefixtures("unheard")
def test_threads_that_overlap_share_a_callback_until_the_last_has_left():
    UNLOGGED.__enter__()
    with UNLOGGED:
        assert mujoco.get_mju_user_warning() is not None
    assert mujoco.get_mju_user_warning() is not None
    UNLOGGED.__exit__(None, None, None)
    assert mujoco.get_mju_user_warning() is None


@pytest.mark.slow
@pytest.mark.usefixtures("unheard")
@pytest.mark.parametrize("walking", [StickInsect(actions="tips"), StickInsects(1, actions="tips")], ids=["one", "many"])
def test_one_that_diverges_writes_nothing_and_says_what_happened(walking: Any, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    walking.reset()
    walking._walkers.bodies.qvel[0, 0] = 1e12
    with pytest.raises(SimulationError, match=r"acting, at 0 time units: mjWARN_BADQ[A-Z]+$"):
        walking.step(np.zeros(walking.action_space.shape))
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr().err == ""
    walking.reset()
    walking.step(np.zeros(walking.action_space.shape))


@pytest.mark.parametrize("ours", [perf_counter, cfunc("float64()")(lambda: 1.0).ctypes], ids=["Python", "C"])
def test_a_clock_of_the_users_own_goes_on_after_walks_and_resets(settled, ours):
    walking = StickInsect()
    walking.reset()
    mujoco.set_mjcb_time(ours)
    try:
        walking.reset()
        list(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 4.0))
        assert mujoco.get_mjcb_time() is ours
    finally:
        mujoco.set_mjcb_time(None)


@pytest.mark.parametrize("controller", [LDVS, SensoryFeedback(LDVS)], ids=lambda one: one.name)
@pytest.mark.parametrize("waits", [False, True], ids=["closes it", "keeps it"])
def test_who_walks_away_from_a_walk_leaves_no_clock_stopped(settled, controller, waits):
    """After the first chunk; the one that is being stepped meanwhile ends, and nothing goes on."""
    walking = drive(settled, begin(controller, settled.starts, 0.3, settled.stride), 40.0)
    next(walking)
    if waits:
        give_up, running = perf_counter() + 20.0, 0
        while running < 100:  # a chunk is stepped in several batches, and the clock runs between them
            running = 0 if mujoco.get_mjcb_time() else running + 1
            assert perf_counter() < give_up
            sleep(0.005)
    cast(Generator, walking).close()
    assert mujoco.get_mjcb_time() is None


@pytest.mark.parametrize("name", CHANGING)
def test_callbacks_that_would_change_the_physics_are_refused(name):
    walking = StickInsects(1)
    walking.reset()
    change = getattr(mujoco, f"set_mjcb_{name}")
    change(lambda *_: 0)
    try:
        for stepping in (walking.reset, lambda: settle(draw_starts(1, 0))):
            with pytest.raises(InputError, match=f"mjcb_{name} is set, .*; expected none: mujoco.set_mjcb_{name}.None"):
                stepping()
    finally:
        change(None)
    settle(draw_starts(1, 0))


@pytest.mark.parametrize("walking", [StickInsect(actions="tips"), dm.load(actions="tips")], ids=["gym", "dm"])
def test_an_insect_alone_does_not_step_under_them_either(walking: Any):
    """Nor goes on with a step that was planned and never taken."""
    walking.reset()
    mujoco.set_mjcb_passive(lambda *_: None)
    try:
        with pytest.raises(InputError, match="mjcb_passive is set"):
            walking.step(np.zeros(18))
    finally:
        mujoco.set_mjcb_passive(None)
    with pytest.raises(InputError, match="after a step or a reset that failed"):
        walking.step(np.zeros(18))
    walking.reset()
    walking.step(np.zeros(18))
