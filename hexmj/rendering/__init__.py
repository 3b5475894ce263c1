"""Rendering: OpenGL, marks in scenes of MuJoCo, and bodies as triangles."""

import ctypes
import os
import sys


def use_egl_without_display() -> None:
    """Set MUJOCO_GL=egl in this process if it is unset, there is no display and EGL is installed.

    Call it before MuJoCo is imported. Without EGL, the import of MuJoCo would fail with this setting.
    """
    if sys.platform == "linux" and not any(map(os.environ.get, ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY"))):
        try:
            for library in ("libEGL.so.1", "libOpenGL.so.0"):
                ctypes.CDLL(library)
        except OSError:
            return
        os.environ["MUJOCO_GL"] = "egl"
