"""A walk or a recording in MuJoCo's own viewer, whose camera follows the insect."""

import os
import sys
import warnings
from collections.abc import Callable
from functools import partial
from itertools import takewhile
from queue import SimpleQueue
from textwrap import fill
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.errors import RenderingError
from hexmj.rendering.scene_marks import mark_centre_of_mass, mark_planned_tips, mark_support
from hexmj.replay.take import margin_in_words, support_on_ground
from hexmj.view.session import IMPULSE, LiveSession, ReplaySession, ticks

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
"""Variables of the environment that name one."""

REMEDY = "--browser shows it in a browser"

PAUSE = "space pauses"
KEYS = f"{PAUSE}, up and down change V, left and right push, enter takes the next start"
"""What the keyboard does, while a recording plays and while an insect walks."""

SPACE, ENTER, RIGHT, LEFT, DOWN, UP = 32, 257, 262, 263, 264, 265
"""Keys as GLFW numbers them."""


def screen() -> bool:
    """Whether there is a screen to open a window on."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS)


def view_live(session: LiveSession) -> None:
    """Walk until the window is closed."""
    walk, wishes = session.walk, SimpleQueue[int]()
    with _window(walk.conditions, wishes.put) as window:
        for passed in takewhile(lambda _: window.is_running(), ticks()):
            while not wishes.empty():
                session.attempt(partial(_obey, session, wishes.get()))
            moment = session.tick(passed)
            seen = moment.feet[:, :2], moment.stance, moment.centre_of_mass, moment.planned_tips
            state = f"fell on {walk.fell_on}" if walk.fell_on else margin_in_words(moment.margin)
            text = f"V = {walk.velocity:.2f}, {state}"
            _show(window, walk.conditions, moment.qpos, moment.margin, seen, text, session.told)


def view_recording(session: ReplaySession) -> None:
    """Play until the window is closed."""
    take, wishes = session.take, SimpleQueue[int]()
    with _window(take.conditions, wishes.put) as window:
        for passed in takewhile(lambda _: window.is_running(), ticks()):
            while not wishes.empty():
                session.paused ^= wishes.get() == SPACE
            row = session.tick(passed)
            seen = take.feet[row], take.stance[row], take.centre_of_mass[row], take.planned_tip[row]
            text = f"{take.title}, half speed, {margin_in_words(take.margin[row])}"
            _show(window, take.conditions, take.qpos[row], take.margin[row], seen, text)


def _obey(session: LiveSession, key: int) -> None:
    """Do what a key stands for."""
    walk, faster = session.walk, {UP: 0.05, DOWN: -0.05}.get(key)
    if key == SPACE:
        session.paused = not session.paused
    elif key == ENTER:
        session.begin_next()
    elif faster:
        walk.steer(velocity=float(np.clip(walk.velocity + faster, 0.0, 0.95)))
    elif key in (LEFT, RIGHT):
        walk.push(IMPULSE if key == LEFT else -IMPULSE)


def _window(conditions: Conditions, on_key: Callable[[int], None]) -> Any:
    """MuJoCo's viewer of a body, to be closed by whoever opened it.

    Raises:
        RenderingError: no window can be opened.
    """
    import glfw
    import mujoco.viewer

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW only warns, and MuJoCo would then end the program
        if not glfw.init():
            screens = " and ".join(f"{name} = {os.environ[name]}" for name in SCREENS if os.environ.get(name))
            raise RenderingError(f"no window can be opened ({screens or 'no screen'}); {REMEDY}")
    compiled = compile_body(conditions)
    try:
        window = mujoco.viewer.launch_passive(
            compiled.model, mujoco.MjData(compiled.model), key_callback=on_key, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # as on macOS, where only mjpython may open it
        raise RenderingError(f"no window can be opened ({error}); {REMEDY}") from None
    size = conditions.body.lengths.shortest_leg
    window.cam.type, window.cam.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, compiled.root
    window.cam.distance, window.cam.azimuth, window.cam.elevation = 5 * size, 60.0, -25.0
    return window


def _show(
    window: Any, conditions: Conditions, qpos: np.ndarray, margin: float, seen: tuple, text: str, told: str = ""
) -> None:
    """Put the body into a pose, the marks of a film beside it, and words into two corners."""
    (feet, stance, centre, tips), body, scene = seen, conditions.body, window.user_scn
    with window.lock():
        window.d.qpos[:] = qpos
        mujoco.mj_forward(window.m, window.d)
        (polygon, level), stable = support_on_ground(conditions, feet, stance, centre), bool(margin > 0.0)
        scene.ngeom = 0
        mark_support(scene, body.marks, polygon, level, stable)
        mark_centre_of_mass(scene, body.marks, centre, level, stable)
        mark_planned_tips(scene, body.marks, tips)
    sign = "within the polygon" if stable else "NOT within the polygon"
    font, at = mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos
    seen_above, told_below = f"{text}, {sign}", fill(told, 80)
    window.set_texts([(font, at.mjGRID_TOPLEFT, seen_above, ""), (font, at.mjGRID_BOTTOMLEFT, told_below, "")])
    window.sync()
