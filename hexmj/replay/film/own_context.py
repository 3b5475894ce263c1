"""A renderer of MuJoCo that is freed without harm to the others of the process."""

import atexit

import mujoco


class Renderer(mujoco.Renderer):
    """Frees what it has drawn with in its own context: in another's, the same numbers are the other's textures."""

    def close(self) -> None:
        """Free it, or as the process ends where the thread that draws with it goes on: no other thread can."""
        try:
            if self._gl_context:
                self._gl_context.make_current()
        except Exception:  # each library raises its own
            atexit.register(super().close)
        else:
            super().close()
