"""Nothing is settled about rendering until something is drawn, and what the user has chosen stands."""

import ctypes
import os
import subprocess
import sys

import pytest

from drawing import drawing
from hexmj.rendering import gl
from tiers import few_of

KEPT = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}

FRAME = """
import os
import mujoco
before = dict(os.environ)
from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
import hexmj.measures.compare, hexmj.replay.recording, hexmj.replay.film.video
from hexmj.rendering import gl
assert dict(os.environ) == before, "changed by importing"
usual = mujoco.GLContext
assert usual.__module__ == "mujoco.glfw"
assert gl.missing() is None
model = compile_body(Conditions()).model
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
for _ in range(2):
    with gl.renderer(model, 48, 64) as renderer:
        renderer.update_scene(data, "side")
        assert renderer.render().std() > 5
assert mujoco.GLContext is usual is mujoco.rendering.classic.gl_context.GLContext
assert {name for name in os.environ if before.get(name) != os.environ[name]} <= {"PYOPENGL_PLATFORM"}
"""

ENVIRONMENT = """
import os
before = dict(os.environ)
from hexmj.environments import dm
changed = {name for name in os.environ if before.get(name) != os.environ[name]}
assert changed <= {"PYOPENGL_PLATFORM", "PYGAME_HIDE_SUPPORT_PROMPT"}  # the latter is Gymnasium's
walking = dm.load()
walking.reset()
assert walking.physics.render(48, 64, camera_id="side").std() > 5
walking.physics.free()
"""

THREADS = (
    FRAME.partition("model =")[0]
    + """
from concurrent.futures import ThreadPoolExecutor
model = compile_body(Conditions()).model

def drawn(_):
    with gl.renderer(model, 48, 64):
        return True

with ThreadPoolExecutor(4) as pool:
    assert all(pool.map(drawn, range(12)))
assert mujoco.rendering.classic.gl_context.GLContext is usual
"""
)

TRITON = """
import sys
assert not {"OpenGL", "mujoco.egl", "dm_control"} & {*sys.modules}, "there may be a context"
"""


FORKED = """
import multiprocessing
from hexmj.rendering import gl

def told(_):
    return gl.missing() or "drawn"

fork = multiprocessing.get_context("fork")
with fork.Pool(1) as pool:
    assert pool.map_async(told, [0]).get(30) == ["drawn"], "nobody had drawn before"
assert told(0) == "drawn"
with fork.Pool(1) as pool:
    assert "expected one that is spawned" in pool.map_async(told, [0]).get(30)[0]
assert told(0) == "drawn"
"""


@drawing
def test_a_child_that_was_forked_after_something_was_drawn_draws_nothing():
    """Mesa would wait for ever."""
    subprocess.run([sys.executable, "-c", FORKED], env=KEPT, check=True, timeout=120)


@pytest.mark.slow
@pytest.mark.parametrize("draws", few_of([FRAME, ENVIRONMENT], FRAME), ids=["frame", "dm_env"])
@drawing
def test_triton_is_there_before_a_context(draws, tmp_path):
    """Imported later it would end the process."""
    (tmp_path / "triton.py").write_text(TRITON)
    code = f"{draws}\nimport sys\nassert 'triton' in sys.modules"
    path = os.pathsep.join([str(tmp_path), *sys.path])
    subprocess.run([sys.executable, "-c", code], env=KEPT | {"PYTHONPATH": path}, check=True)


@pytest.fixture
def environment(monkeypatch):
    for name in gl.WISHES:
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


def without_libraries(name: str) -> None:
    raise OSError(f"{name}: cannot open shared object file")


@pytest.mark.slow
@drawing
@pytest.mark.parametrize("script", [FRAME, THREADS, ENVIRONMENT], ids=["film", "threads", "environment"])
def test_without_a_screen_frames_are_rendered_though_nobody_asked_for_egl(script):
    path = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=KEPT | path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "X11" not in done.stderr


@pytest.mark.parametrize(("name", "value"), [("MUJOCO_GL", "osmesa"), ("DISPLAY", ":0"), ("WAYLAND_DISPLAY", "w")])
@drawing
def test_other_wishes_stand(environment, name, value):
    """MuJoCo was imported with them, or with none."""
    import mujoco

    environment.setattr(mujoco, "GLContext", wish := object())
    environment.setenv(name, value)
    assert gl.context_type() is wish
    environment.delenv(name)
    assert gl.context_type() is not wish


@drawing
def test_elsewhere_mujoco_knows_best(environment):
    import mujoco

    environment.setattr(mujoco, "GLContext", usual := object())
    environment.setattr(gl.sys, "platform", "darwin")
    assert gl.context_type() is usual


def test_without_the_libraries_it_is_said_what_brings_them(environment):
    environment.setattr(ctypes, "CDLL", without_libraries)
    assert "libEGL.so.1: cannot open shared object file); on Debian and Ubuntu" in str(gl.missing())


@pytest.mark.parametrize("wish", [None, "egl"])
@pytest.mark.skipif(sys.platform != "linux", reason="EGL")
def test_another_platform_of_opengl_is_told(environment, wish):
    if wish:
        environment.setenv("MUJOCO_GL", wish)
    environment.setenv("PYOPENGL_PLATFORM", "glx")
    told = "Nothing can be rendered here (PYOPENGL_PLATFORM = glx; expected egl, or none); on Debian and Ubuntu "
    assert str(gl.missing()).startswith(told)


@pytest.mark.parametrize(
    ("wish", "left"),
    [(None, None), ("egl", None), ("glfw", "glfw"), ("off", "off"), ("osmesa", "disable"), ("nonsense", "disable")],
)
def test_a_command_drops_a_wish_that_would_keep_mujoco_from_being_imported(environment, wish, left):
    if wish:
        environment.setenv("MUJOCO_GL", wish)
    environment.setattr(ctypes, "CDLL", without_libraries)
    environment.setattr(gl, "find_library", lambda name: None)
    environment.setattr(gl, "_VAIN", [])
    gl.drop_vain_wish()
    assert os.environ.get("MUJOCO_GL") == left
    if left == "disable":
        assert f"MUJOCO_GL = {wish} is not there; expected one of egl, glfw and osmesa that is" in str(gl.missing())


def test_with_the_libraries_the_wish_for_egl_stands(environment):
    environment.setenv("MUJOCO_GL", "egl")
    environment.setattr(ctypes, "CDLL", lambda name: None)
    gl.drop_vain_wish()
    assert os.environ["MUJOCO_GL"] == "egl"


TOGETHER = """
import gc
import sys

import gymnasium
import numpy as np

import hexmj
from hexmj.environments import dm

def theirs():
    return walking.physics.render(120, 160, camera_id=0)

walking = dm.load(velocity=0.5, actions="tips", seed=2)
walking.reset()
theirs()
first = theirs()
other = gymnasium.make("hexmj.environments:hexmj/StickInsect-v0", render_mode="rgb_array")
other.reset(seed=0)
ours = [other.render()]
assert (theirs() == first).all(), "drawn"
ours += [other.render()]
recording = hexmj.record(hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 1.0))
hexmj.render([recording], sys.argv[1])
assert (theirs() == first).all(), "filmed"
assert (other.render() == ours[1]).all()
other.close()
assert (theirs() == first).all(), "closed"
other.reset(seed=0)
other.render()
del other
gc.collect()
assert (theirs() == first).all(), "dropped"
"""


@pytest.mark.thorough
@drawing
def test_dm_control_films_and_environments_draw_in_one_program(tmp_path):
    """dm_control takes for granted that its context is current, and frees it at the exit."""
    done = subprocess.run(
        [sys.executable, "-c", TOGETHER, tmp_path / "film.mp4"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
