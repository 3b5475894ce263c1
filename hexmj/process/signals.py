"""What stops a program: each is a KeyboardInterrupt, of which code that it falls into may make another exception."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Timer
from typing import Any

STOPS = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
"""Ctrl-C, a polite end, and a terminal that closes."""

SWALLOWED = 5.0
"""A stop after which the program goes on for so long was swallowed by somebody's code, and comes once more [s]."""

_HEARD: list[int] = []


def hear_stops() -> None:
    """Each of `STOPS` is a KeyboardInterrupt from now on, but for those that are ignored, as under `nohup`."""
    sys.unraisablehook = _unheard
    for one in STOPS:
        if signal.getsignal(one) != signal.SIG_IGN:
            signal.signal(one, _stop)


def ignore_stops() -> None:
    """None of `STOPS` has any effect from now on."""
    for one in STOPS:
        signal.signal(one, signal.SIG_IGN)


def of_stop(error: BaseException) -> bool:
    """Whether an exception comes of a stop: C code, imports and classes that are being made raise others instead."""
    return bool(_HEARD) or isinstance(error, KeyboardInterrupt)


@contextmanager
def unheard_by_children(*stops: int) -> Iterator[None]:
    """Programs that are started meanwhile take no Ctrl-C, or none of `stops`, where the system has such masks; this one
    does afterwards.

    Ctrl-C reaches every program of a terminal, and so does its closing.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, stops or {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)


@contextmanager
def stops_wait() -> Iterator[None]:
    """A stop that comes while the block runs, which would be left in pieces, comes at its end."""
    came = list[int]()
    for one in (heard := [one for one in STOPS if signal.getsignal(one) is _stop]):
        signal.signal(one, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for one in heard:
            signal.signal(one, _stop)
        if came:
            os.kill(os.getpid(), came[0])


def _stop(number: int, frame: Any) -> None:
    _HEARD.append(number)
    _comes_again(SWALLOWED)
    raise KeyboardInterrupt


def _unheard(ignored: Any) -> None:
    """A stop that C code swallows, as while numba loads what it has compiled, comes once more."""
    if _HEARD and ignored.exc_type is KeyboardInterrupt:
        _comes_again(0.1)
    else:
        sys.__unraisablehook__(ignored)


def _comes_again(seconds: float) -> None:
    again = Timer(seconds, os.kill, (os.getpid(), _HEARD[-1]))
    again.daemon = True
    with suppress(RuntimeError):  # the interpreter is ending
        again.start()
