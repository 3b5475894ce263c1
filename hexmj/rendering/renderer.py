"""A renderer of MuJoCo that does no harm to whoever else draws in the process."""

import atexit
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import mujoco
import numpy as np


@contextmanager
def kept_current() -> Iterator[None]:
    """Leave that context of EGL current which was, or none: others, such as dm_control, take for granted that theirs
    still is, and where ours stays current, no thread but this one can free it.

    Nor does the display end before the process: it is one for all, and who draws frees its own at the exit.
    """
    egl: Any = sys.modules.get("OpenGL.EGL")
    before = _current(egl) if egl else None
    try:
        yield
    finally:
        if egl := sys.modules.get("OpenGL.EGL"):
            atexit.unregister(egl.eglTerminate)
            with suppress(Exception):  # it was freed meanwhile
                display, *ours = _current(egl)
                if before and before[-1]:
                    egl.eglMakeCurrent(*before)
                elif ours[-1]:
                    egl.eglMakeCurrent(display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)


def _current(egl: Any) -> tuple[Any, ...]:
    """What is drawn with: display, two surfaces and context."""
    surfaces = (egl.eglGetCurrentSurface(which) for which in (egl.EGL_DRAW, egl.EGL_READ))
    return egl.eglGetCurrentDisplay(), *surfaces, egl.eglGetCurrentContext()


class Renderer(mujoco.Renderer):
    """Frees what it has drawn with in its own context: in another's, the same numbers are the other's textures."""

    def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
        """See `mujoco.Renderer`."""
        with kept_current():
            super().__init__(model, height, width)

    def render(self, *, out: np.ndarray | None = None) -> np.ndarray:
        """See `mujoco.Renderer.render`."""
        with kept_current():
            return super().render(out=out)

    def close(self) -> None:
        """Free it, or as the process ends where the thread that draws with it goes on: no other thread can."""
        with kept_current():
            try:
                if self._gl_context:
                    self._gl_context.make_current()
            except Exception:  # each library raises its own
                atexit.register(super().close)
            else:
                super().close()
