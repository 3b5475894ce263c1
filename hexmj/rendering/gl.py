"""How MuJoCo renders: settled when something is drawn, never by importing this package.

MuJoCo settles it when it is imported, by MUJOCO_GL, and takes a screen unless told.  Where nobody has told it and there
is no screen, its renderers are handed contexts of EGL, which needs none.
"""

import ctypes
import os
import sys
import textwrap
import warnings
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from threading import Lock
from typing import TYPE_CHECKING, Any

from hexmj.errors import RenderingError

if TYPE_CHECKING:
    import mujoco

LIBRARIES = ("libEGL.so.1", "libOpenGL.so.0")
PACKAGES = "libegl1 libgl1-mesa-dri libopengl0"
"""Packages of Debian and Ubuntu that bring the libraries and a software renderer."""

SURE, NONE = ("glfw", "glx", "enable", "enabled", "on", "true", "1"), ("disable", "disabled", "off", "false", "0")
"""What MUJOCO_GL may be, besides EGL and OSMesa, which may not be there: what MuJoCo brings along, and nothing."""

_VAIN: list[str] = []
"""What was asked for in vain."""

_DRAWERS: set[int] = set()
"""The process that has drawn, if it has; a child that was forked since inherits it."""

_SWAPPED = Lock()
"""Held while MuJoCo's type of contexts is another one, by one thread at a time."""

FORKED = (
    "this process was forked from one that had drawn, and its GL would wait for ever; expected one that is spawned, as"
    " by multiprocessing.get_context('spawn')"
)

WISHES = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")
"""Variables of the environment by which a GL has been chosen, or a screen is there."""


@cache
def import_what_clashes() -> None:
    """Import Triton, which torch brings, before there is a context: after Mesa has made one, whoever asked for it, that
    import ends the process by a segmentation fault."""
    if find_spec("triton"):
        with suppress(Exception):  # of whatever it lacks; it is nothing to us
            import_module("triton")


def check_not_forked() -> None:
    """Refuse to draw in a child of a process that had drawn.

    Raises:
        RenderingError: it is one.
    """
    if _DRAWERS and os.getpid() not in _DRAWERS:
        raise RenderingError(FORKED)


def renderer(model: "mujoco.MjModel", height: int, width: int) -> "mujoco.Renderer":
    """A renderer for frames of this many pixels, with a context of `context_type`.

    Raises:
        RenderingError: see `check_not_forked`.
    """
    from mujoco.rendering.classic import gl_context

    from hexmj.rendering.renderer import Renderer

    check_not_forked()
    wanted = context_type()
    with _SWAPPED:
        usual, gl_context.GLContext = gl_context.GLContext, wanted
        try:
            return Renderer(model, height, width)
        finally:
            gl_context.GLContext = usual


def context_type() -> Any:
    """What GL contexts are made by: MuJoCo's choice, or EGL where nothing was chosen and there is no screen.

    Raises:
        OSError, AttributeError and others, of each library: nothing can be rendered.
    """
    import_what_clashes()
    _DRAWERS.add(os.getpid())
    if not _unasked():
        import mujoco

        return mujoco.GLContext
    _load_libraries()
    from mujoco.egl import GLContext

    return GLContext


def drop_vain_wish() -> None:
    """Let a command that draws nothing go on where a GL is asked for that is not there: MuJoCo cannot be imported then.

    For a program of our own only, before MuJoCo is imported; `missing` then says what to install.
    """
    wish = _wish()
    if sys.platform != "linux" or wish in ("", *SURE, *NONE):
        return
    if wish == "egl":
        try:
            _load_libraries()
        except OSError:
            del os.environ["MUJOCO_GL"]
    elif wish != "osmesa" or not find_library("OSMesa"):
        _VAIN.append(wish)
        os.environ["MUJOCO_GL"] = NONE[0]


def vain_wish() -> str | None:
    """What is asked for that draws nothing; None if something is, or anything will do."""
    if _VAIN:
        return f"MUJOCO_GL = {_VAIN[0]:.80} is not there; expected one of egl, glfw and osmesa that is"
    if (wish := "egl" if _unasked() else _wish()) in NONE:
        return "MUJOCO_GL asks for nothing"
    platform = os.environ.get("PYOPENGL_PLATFORM") or wish
    if wish in ("egl", "osmesa") and platform != wish:
        return f"PYOPENGL_PLATFORM = {platform:.80}; expected {wish}, or none"
    return None


def _wish() -> str:
    return os.environ.get("MUJOCO_GL", "").lower().strip()


def _unasked() -> bool:
    """Whether nobody has asked for a GL, and there is no screen: then EGL is taken."""
    return sys.platform == "linux" and not any(map(os.environ.get, WISHES))


def missing() -> str | None:
    """Why nothing can be rendered here and what brings rendering, in one sentence; None if it works."""
    if told := vain_wish():
        return _sentence(told)
    try:
        check_not_forked()
        import mujoco

        if not hasattr(mujoco, "Renderer"):
            return _sentence("MuJoCo found no GLFW, as where PYGLFW_LIBRARY leads to none")
        from hexmj.rendering.renderer import kept_current

        with kept_current(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW only warns where there is no screen, and makes no context
            context = context_type()(16, 16)
            made = bool(context._context)
            context.free()
    except RenderingError as error:
        return str(error)
    except Exception as error:  # each library and driver raises another type of its own
        return _sentence(textwrap.shorten(str(error) or type(error).__name__, 160, placeholder=" [...]").rstrip("."))
    wanted = os.environ.get("MUJOCO_GL")
    return None if made else _sentence(f"MUJOCO_GL = {wanted}" if wanted else "the screen gives no context")


def _load_libraries() -> None:
    for library in LIBRARIES:
        ctypes.CDLL(library)


def _sentence(reason: str) -> str:
    return f"Nothing can be rendered here ({reason}); on Debian and Ubuntu rendering takes the packages {PACKAGES}."
