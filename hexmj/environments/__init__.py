"""The insect as an environment for learning and control."""

import os
import warnings

import glfw

with warnings.catch_warnings():
    if "MUJOCO_GL" not in os.environ:  # without a screen GLFW only warns, and dm_control would never come to EGL
        warnings.simplefilter("error", glfw.GLFWError)
    import dm_control.mujoco  # noqa: F401
