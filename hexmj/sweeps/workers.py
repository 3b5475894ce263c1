"""Processes that compute cells end with the one that began them, however that ends."""

import os
import signal
import sys
import time
from contextlib import suppress
from multiprocessing import parent_process
from threading import Thread

from hexmj.process.signals import STOPS
from hexmj.storage.files import WRITING

GRACE = 0.5
"""Time from a stop to the end, and from the parent's end as long as something is being written [s]."""


def end_with_parent() -> None:
    """Initializer of a pool's processes, which would wait for cells for ever if their parent was killed."""
    for one in set(STOPS) - {signal.SIGINT}:
        signal.signal(one, _leave_later)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})  # by which the parent ends it
    sys.stdout = sys.stderr  # what a user's code prints is no answer of the command
    Thread(target=_watch, daemon=True).start()


def _leave_later(*_: object) -> None:
    """A stop of the whole group is heard by the parent meanwhile, which then waits for nobody."""
    time.sleep(GRACE)
    _leave()


def _leave() -> None:
    """End at once, without what is half written."""
    for part in list(WRITING):
        with suppress(OSError):
            part.unlink()
    os._exit(1)


def _watch() -> None:
    if parent := parent_process():
        parent.join()
        end = time.monotonic() + GRACE
        while WRITING and time.monotonic() < end:  # to take a file away just before it is made would leave it
            time.sleep(0.001)
        _leave()
