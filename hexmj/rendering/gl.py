"""Rendering by MuJoCo with OpenGL. Without a display, MUJOCO_GL=egl must be set before MuJoCo is imported."""

import textwrap
import warnings

import mujoco

from hexmj.errors import RenderingError


class Renderer(mujoco.Renderer):
    """MuJoCo's renderer, except that `close` frees the textures in the renderer's own OpenGL context."""

    def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
        """Prepare frames of height x width pixels.

        Raises:
            RenderingError: nothing can be rendered on this machine.
        """
        if reason := missing():
            raise RenderingError(reason)
        super().__init__(model, height, width)

    def close(self) -> None:
        """Free the renderer's resources; further calls have no effect."""
        if self._gl_context:
            self._gl_context.make_current()
        super().close()


def missing() -> str | None:
    """Return why this machine cannot render and what to install; None if it can."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW only warns if there is no display, and makes no context
            context = mujoco.GLContext(16, 16)
        if context._context:
            context.free()
            return None
        reason = "no display"
    except Exception as error:  # OpenGL libraries and drivers raise errors of their own types
        reason = textwrap.shorten(str(error) or type(error).__name__, 160, placeholder=" [...]").rstrip(".")
    return (
        f"This machine cannot render ({reason}). Without a display, set MUJOCO_GL=egl; on Debian and Ubuntu, EGL needs"
        " the packages libegl1, libgl1-mesa-dri and libopengl0."
    )
