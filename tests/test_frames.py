"""Frames of environments: freed with them, and nothing else with it."""

import gc
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor

import gymnasium
import numpy as np
import pytest

from drawing import drawing
from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.environments.frames import Frames
from hexmj.errors import RenderingError


@drawing
def test_frames_that_nobody_closes_are_freed_when_they_are_dropped():
    frames = Frames(Conditions())
    frames.draw(compile_body(Conditions()).model.qpos0)
    renderer = weakref.ref(frames._renderer)
    del frames
    gc.collect()
    assert renderer() is None


@pytest.mark.slow
@drawing
def test_who_goes_takes_nothing_with_it_that_others_draw_with():
    one, other, third = (gymnasium.make("hexmj/StickInsect-v0", render_mode="rgb_array") for _ in range(3))
    for walking in (one, other, third):
        walking.reset(seed=0)
        walking.render()
    before = third.render()
    one.close()
    np.testing.assert_array_equal(third.render(), before)
    del other
    gc.collect()
    np.testing.assert_array_equal(third.render(), before)
    with ThreadPoolExecutor(1) as elsewhere:
        frames = Frames(Conditions())
        elsewhere.submit(frames.draw, compile_body(Conditions()).model.qpos0).result()
        third.render()
        del frames  # while the thread that drew goes on
        gc.collect()
        np.testing.assert_array_equal(third.render(), before)


@drawing
def test_what_a_thread_has_drawn_with_any_other_may_free():
    frames = Frames(Conditions())
    with ThreadPoolExecutor(1) as elsewhere:
        elsewhere.submit(frames.draw, compile_body(Conditions()).model.qpos0).result()
        context = frames._renderer._gl_context  # pyright: ignore[reportOptionalMemberAccess]
        frames.close()
        assert context._context is None  # pyright: ignore[reportAttributeAccessIssue]


def test_frames_that_cannot_be_drawn_are_refused(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with pytest.raises(RenderingError, match="MUJOCO_GL asks for nothing"):
        Frames(Conditions()).draw(compile_body(Conditions()).model.qpos0)


@pytest.mark.slow
def test_a_drawn_insect_that_nobody_closes_ends_in_silence():
    program = """
import gymnasium
walking = gymnasium.make("hexmj.environments:hexmj/StickInsectTips-v0", render_mode="rgb_array")
walking.reset(seed=0)
walking.render()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr == ""
