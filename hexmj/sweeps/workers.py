"""Processes that compute cells end with the one that began them, however that ends."""

import os
from multiprocessing import parent_process
from threading import Thread


def end_with_parent() -> None:
    """Initializer of a pool's processes, which would wait for cells for ever if their parent was killed."""
    Thread(target=_watch, daemon=True).start()


def _watch() -> None:
    if parent := parent_process():
        parent.join()
        os._exit(1)
