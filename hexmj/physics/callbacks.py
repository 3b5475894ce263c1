"""What MuJoCo calls for the whole process, while batches step: its clock is stopped, its warnings are not logged, and
nothing that would change the physics may be set.

MuJoCo's Python package times every part of every step for `mjData.timer`.  Nobody reads that while thousands of
insects walk, and without it they walk 5 % faster (measured), to the same bits.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
from numba import cfunc

from hexmj.errors import InputError

CHANGING = "control", "passive", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias"
"""Callbacks of MuJoCo's that change the physics."""


def check_no_callbacks() -> None:
    """Refuse to step where the user has set a callback that changes the physics; no result would tell of it.

    Raises:
        InputError: one is set.
    """
    for name in CHANGING:
        if getattr(mujoco, f"get_mjcb_{name}")() is not None:
            raise InputError(
                f"MuJoCo's callback mjcb_{name} is set, which changes the physics; expected none:"
                f" mujoco.set_mjcb_{name}(None)"
            )


@contextmanager
def stopped_clock() -> Iterator[None]:
    """Meanwhile `mjData.timer` stands still in the whole process; a clock that the user has set is left alone."""
    if mujoco.get_mjcb_time() is not None:
        yield
        return
    mujoco.set_mjcb_time(_midnight.ctypes)
    try:
        yield
    finally:
        if mujoco.get_mjcb_time() is _midnight.ctypes:  # another thread may have set one meanwhile
            mujoco.set_mjcb_time(None)


@contextmanager
def unlogged() -> Iterator[None]:
    """Meanwhile MuJoCo writes no warning to the terminal, nor a log file; those who step read what happened."""
    if mujoco.get_mju_user_warning() is not None:
        yield
        return
    mujoco.set_mju_user_warning(_unheard)
    try:
        yield
    finally:
        if mujoco.get_mju_user_warning() is _unheard:
            mujoco.set_mju_user_warning(None)


def _unheard(warning: str) -> None:
    """Nothing."""


@cfunc("float64()", cache=True)
def _midnight() -> float:
    return 0.0
