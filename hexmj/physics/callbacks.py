"""What MuJoCo calls for the whole process, while bodies step: its warnings are not logged, in batches its clock is
stopped, and nothing that would change the physics may be set.

MuJoCo's Python package times every part of every step for `mjData.timer`.  Nobody reads that while thousands of
insects walk, and without it they walk 5 % faster (measured), to the same bits.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import mujoco
from numba import cfunc

from hexmj.errors import InputError

CHANGING = "control", "passive", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias"
"""Callbacks of MuJoCo's that change the physics."""

_CHANGING = tuple(getattr(mujoco, f"get_mjcb_{name}") for name in CHANGING)


def check_no_callbacks() -> None:
    """Refuse to step where the user has set a callback that changes the physics; no result would tell of it.

    Raises:
        InputError: one is set.
    """
    for callback in _CHANGING:
        if callback() is not None:
            name = callback.__name__.removeprefix("get_")
            raise InputError(
                f"MuJoCo's callback {name} is set, which changes the physics; expected none: mujoco.set_{name}(None)"
            )


class Meanwhile:
    """A callback of the whole process is ours until the last thread has left; then it is the user's again."""

    def __init__(self, callback: str, ours: Any, over: bool) -> None:
        """By its name; `over` says whether one that the user has set is put aside, or stays."""
        self._get, self._put = getattr(mujoco, f"get_{callback}"), getattr(mujoco, f"set_{callback}")
        self._ours, self._over, self._users = ours, over, None
        self._one, self._within = Lock(), 0

    def __enter__(self) -> None:
        with self._one:
            self._within += 1
            now = self._get()
            if now is None or (self._over and now is not self._ours):
                self._users = now
                self._put(self._ours)

    def __exit__(self, *_: object) -> None:
        with self._one:
            self._within -= 1
            if not self._within and self._get() is self._ours:  # another thread may have set one meanwhile
                self._put(self._users)


def _unheard(warning: str) -> None:
    """Nothing."""


@cfunc("float64()")
def _midnight() -> float:
    return 0.0


STOPPED_CLOCK = Meanwhile("mjcb_time", _midnight.ctypes, over=True)
"""Meanwhile `mjData.timer` stands still in the whole process; batches take no clock in Python."""

UNLOGGED = Meanwhile("mju_user_warning", _unheard, over=False)
"""Meanwhile MuJoCo writes no warning to the terminal, nor a log file; those who step read what happened."""


@contextmanager
def batched() -> Iterator[None]:
    """Meanwhile batches may step.

    Raises:
        InputError: a callback is set that changes the physics.
    """
    check_no_callbacks()
    with STOPPED_CLOCK, UNLOGGED:
        yield
