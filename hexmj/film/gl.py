"""Rendering without a screen: which way MuJoCo takes, and whether it works here."""

import ctypes
import os
import textwrap
import warnings

LIBRARIES = ("libEGL.so.1", "libOpenGL.so.0")
PACKAGES = "libegl1 libgl1-mesa-dri libopengl0"
"""Packages of Debian and Ubuntu that bring the libraries and a software renderer."""


def prefer_egl() -> None:
    """Let MuJoCo render through EGL if there is no screen, EGL is installed and nothing else was asked for.

    Only works before MuJoCo is first imported.  MuJoCo cannot even be imported where EGL is asked for and its
    libraries are missing: then the wish is dropped, and `missing` says what to install.
    """
    wanted = os.environ.get("MUJOCO_GL")
    if wanted != "egl" and (wanted or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ)):
        return
    try:
        for library in LIBRARIES:
            ctypes.CDLL(library)
        os.environ["MUJOCO_GL"] = "egl"
    except OSError:
        os.environ.pop("MUJOCO_GL", None)


def missing() -> str | None:
    """Why nothing can be rendered here and what brings rendering, in one sentence; None if it works."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW only warns where there is no screen, and makes no context
            import mujoco

            context = mujoco.GLContext(16, 16)
            made = bool(context._context)
            context.free()
    except Exception as error:  # each library and driver raises another type of its own
        return _sentence(textwrap.shorten(str(error) or type(error).__name__, 160, placeholder=" [...]").rstrip("."))
    return None if made else _sentence("there is no screen, and MuJoCo was imported without MUJOCO_GL=egl")


def _sentence(reason: str) -> str:
    return f"Nothing can be rendered here ({reason}); on Debian and Ubuntu rendering takes the packages {PACKAGES}."
