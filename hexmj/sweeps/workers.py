"""Processes that compute cells end with the one that began them, however that ends."""

import os
import signal
import sys
from contextlib import suppress
from multiprocessing import parent_process
from threading import Thread

from hexmj.files import WRITING


def end_with_parent() -> None:
    """Initializer of a pool's processes, which would wait for cells for ever if their parent was killed."""
    signal.signal(signal.SIGTERM, _leave)
    sys.stdout = sys.stderr  # what a user's code prints is no answer of the command
    Thread(target=_watch, daemon=True).start()


def _leave(*_: object) -> None:
    """End at once, without what is half written."""
    for part in list(WRITING):
        with suppress(OSError):
            part.unlink()
    os._exit(1)


def _watch() -> None:
    if parent := parent_process():
        parent.join()
        _leave()  # a run that goes on meanwhile takes what is being written for no leftover
