"""Frames of an insect, drawn without a screen; a GL is chosen when the first one is drawn.

The body is compiled at once, so that files edited later do not change what is seen.
"""

import atexit
import weakref
from threading import get_ident
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.errors import InputError, RenderingError
from hexmj.rendering import gl

if TYPE_CHECKING:
    from mujoco import Renderer

SIZE = 480, 640
"""Height and width [pixels]."""


class Frames:
    """Draws a body wherever it is, by the camera that is first in its description, which follows the stick insect."""

    def __init__(self, conditions: Conditions) -> None:
        """Nothing is drawn yet."""
        self._cameras, self._renderer = conditions.body.cameras[:1], None
        self._model = compile_body(conditions).model
        self._model.vis.global_.offheight, self._model.vis.global_.offwidth = SIZE

    def draw(self, qpos: np.ndarray) -> np.ndarray:
        """The body at some `qpos`, (height, width, 3) of uint8.

        Raises:
            InputError: another thread has drawn before, and the environment was not closed since.
            RenderingError: nothing can be rendered here, or the process was forked from one that had drawn.
        """
        renderer = self._begun()
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(renderer.model, self._data)
        mujoco.mj_comPos(renderer.model, self._data)
        mujoco.mj_camlight(renderer.model, self._data)
        renderer.update_scene(self._data, *self._cameras)
        return renderer.render()

    def close(self) -> None:
        """Free the GL; it may be called again."""
        if self._renderer:
            self._renderer.close()
        self._renderer = None

    def _begun(self) -> "Renderer":
        gl.check_not_forked()
        if self._renderer is None:
            if reason := gl.missing():
                raise RenderingError(reason)
            self._data, self._renderer = mujoco.MjData(self._model), gl.renderer(self._model, *SIZE)
            atexit.register(_close, weakref.ref(self._renderer))  # before the GL goes, though nobody closes it
            self._thread = get_ident()
        if self._thread != get_ident():
            raise InputError("another thread has drawn this environment; expected one that draws all of its frames")
        return self._renderer


def _close(renderer: "weakref.ref[Renderer]") -> None:
    if one := renderer():
        one.close()
