"""View of a live walk or a recording in MuJoCo's own viewer, whose camera follows the insect."""

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from itertools import takewhile
from queue import SimpleQueue
from textwrap import fill
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.mjcf import compile_body
from hexmj.command import Command
from hexmj.conditions import Conditions
from hexmj.errors import RenderingError
from hexmj.rendering.scene_marks import mark_centre_of_mass, mark_planned_tips, mark_support
from hexmj.replay.take import Take, margin_in_words, support_on_ground
from hexmj.view.session import IMPULSE, LYING_TIME, LiveSession, ticks

PAUSE = "space pauses"
KEYS = (
    f"{PAUSE}; W and S change the velocity forward, A and D that to the left, Q and E the yaw rate; X halts; left and"
    " right push; enter takes the next start"
)
"""Help on the keys of a recording (PAUSE) and of a live walk (KEYS)."""

SPACE, ENTER, RIGHT, LEFT = 32, 257, 262, 263
"""GLFW's codes of the keys; those of letters are their characters."""

MOST = np.array([0.95, 0.5, 0.02])
"""Maximum of each component of the command."""

STEERS: dict[str, tuple[float, float, float]] = {
    **{"W": (0.05, 0.0, 0.0), "A": (0.0, 0.05, 0.0), "Q": (0.0, 0.0, 0.001)},
    **{"S": (-0.05, 0.0, 0.0), "D": (0.0, -0.05, 0.0), "E": (0.0, 0.0, -0.001)},
}
"""Key -> change of the command."""


def screen() -> bool:
    """Return whether there is a screen on which a window can open."""
    return sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))


def view_live(session: LiveSession) -> None:
    """Show a live walk until the window is closed."""
    walk = session.walk
    for window, passed in _opened(walk.conditions, lambda key: session.attempt(partial(_press, session, key))):
        moment = session.tick(passed)
        seen = moment.feet[:, :2], moment.stance, moment.centre_of_mass, moment.planned_tips
        text = "forward {:.2f}, left {:.2f}, turn {:.4f}".format(*walk.command.parts[0])
        text = ", ".join(filter(None, (text, walk.loss_in_words, margin_in_words(moment.margin))))
        _show(window, walk.conditions, moment.qpos, moment.margin, seen, text, session.message)


def view_recording(take: Take) -> None:
    """Play a recording in an endless loop at half speed until the window is closed."""
    seconds, paused = 0.0, False

    def pause(key: int) -> None:
        nonlocal paused
        paused ^= key == SPACE

    for window, passed in _opened(take.conditions, pause):
        if not paused:
            seconds = (seconds + passed / 2) % (take.end - take.begin + LYING_TIME)
        row = take.row(take.begin + seconds)
        seen = take.feet[row], take.stance[row], take.centre_of_mass[row], take.planned_tip[row]
        text = f"{take.title}, half speed, {margin_in_words(take.margin[row])}"
        _show(window, take.conditions, take.qpos[row], take.margin[row], seen, text)


def _opened(conditions: Conditions, press: Callable[[int], object]) -> Iterator[tuple[Any, float]]:
    """Open a window, and yield it with the time since the last frame [s] until it is closed; pass keys to `press`."""
    keys = SimpleQueue[int]()
    with _window(conditions, keys.put) as window:
        for passed in takewhile(lambda _: window.is_running(), ticks()):
            while not keys.empty():
                press(keys.get())
            yield window, passed


def _press(session: LiveSession, key: int) -> None:
    """Change the live walk as the pressed key asks for, see `KEYS`."""
    walk, change = session.walk, STEERS.get(chr(key))
    if key == SPACE:
        session.speed = 0.0 if session.speed else 1.0
    elif key == ENTER:
        session.begin_next()
    elif chr(key) == "X":
        walk.steer(Command(0.0))
    elif change:
        walk.steer(Command(*np.clip(walk.command.parts[0] + change, -MOST, MOST).tolist()))
    elif key in (LEFT, RIGHT):
        walk.push(IMPULSE if key == LEFT else -IMPULSE)


def _window(conditions: Conditions, on_key: Callable[[int], None]) -> Any:
    """Open MuJoCo's viewer of a body; the caller closes it.

    Raises:
        RenderingError: no window can be opened.
    """
    import glfw
    import mujoco.viewer

    compiled = compile_body(conditions)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without a display GLFW warns, and MuJoCo would exit
            if not glfw.init():
                raise RuntimeError("no display")
        window = mujoco.viewer.launch_passive(
            compiled.model, mujoco.MjData(compiled.model), key_callback=on_key, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # macOS needs mjpython to open a window
        raise RenderingError(f"No window can be opened: {error}. Use --browser.") from None
    window.cam.type, window.cam.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, compiled.root
    window.cam.distance, window.cam.azimuth = 5 * conditions.body.lengths.shortest_leg, 60.0
    window.cam.elevation = -25.0
    return window


def _show(
    window: Any, conditions: Conditions, qpos: np.ndarray, margin: float, seen: tuple, text: str, message: str = ""
) -> None:
    """Show a pose, its support polygon, centre of mass and planned tips, and texts in two corners."""
    (feet, stance, centre, tips), marks, scene = seen, conditions.body.marks, window.user_scn
    stable = bool(margin > 0.0)
    with window.lock():
        window.d.qpos[:] = qpos
        mujoco.mj_forward(window.m, window.d)
        polygon, level = support_on_ground(conditions, feet, stance, centre)
        scene.ngeom = 0
        mark_support(scene, marks, polygon, level, stable)
        mark_centre_of_mass(scene, marks, centre, level, stable)
        mark_planned_tips(scene, marks, tips)
    text += ", within the polygon" if stable else ", NOT within the polygon"
    font, corner = mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos
    window.set_texts([(font, corner.mjGRID_TOPLEFT, text, ""), (font, corner.mjGRID_BOTTOMLEFT, fill(message, 80), "")])
    window.sync()
