"""What MuJoCo calls for the whole process, while batches step: its clock is stopped, its warnings are not logged, and
nothing that would change the physics may be set.

MuJoCo's Python package times every part of every step for `mjData.timer`.  Nobody reads that while thousands of
insects walk, and without it they walk 5 % faster (measured), to the same bits.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Lock
from typing import Any

import mujoco
from numba import cfunc

from hexmj.errors import InputError

CHANGING = "control", "passive", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias"
"""Callbacks of MuJoCo's that change the physics."""

_ONE, _WITHIN = Lock(), Counter[str]()
"""How many threads need each callback of ours."""


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


def stopped_clock() -> AbstractContextManager[None]:
    """Meanwhile `mjData.timer` stands still in the whole process; a clock that the user has set is left alone."""
    return _meanwhile("mjcb_time", _midnight.ctypes)


def unlogged() -> AbstractContextManager[None]:
    """Meanwhile MuJoCo writes no warning to the terminal, nor a log file; those who step read what happened."""
    return _meanwhile("mju_user_warning", _unheard)


@contextmanager
def _meanwhile(callback: str, ours: Any) -> Iterator[None]:
    """A callback of the whole process is ours until the last thread has left; one that the user has set stays."""
    get, put = getattr(mujoco, f"get_{callback}"), getattr(mujoco, f"set_{callback}")
    with _ONE:
        _WITHIN[callback] += 1
        if get() is None:
            put(ours)
    try:
        yield
    finally:
        with _ONE:
            _WITHIN[callback] -= 1
            if not _WITHIN[callback] and get() is ours:  # another thread may have set one meanwhile
                put(None)


def _unheard(warning: str) -> None:
    """Nothing."""


@cfunc("float64()", cache=True)
def _midnight() -> float:
    return 0.0
