"""The current folder, which a user's code may change or remove."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import current_thread, get_ident, main_thread
from typing import Any

_MOVED = set[int]()
"""Threads that have changed it within their block."""


@contextmanager
def kept_folder() -> Iterator[None]:
    """Change the folder back if the block changes it.

    It is the whole program's: what changes it beside another thread than the main one is left alone.
    """
    here, thread = _folder(), get_ident()
    outside = thread in _MOVED
    _MOVED.discard(thread)
    try:
        yield
    finally:
        moved = _folder() != here if current_thread() is main_thread() else thread in _MOVED
        if here and moved:
            with suppress(FileNotFoundError):  # it was removed meanwhile
                os.chdir(here)
        (_MOVED.add if outside else _MOVED.discard)(thread)


def _folder() -> str:
    """The current folder; empty where it was removed, and nobody may need it."""
    with suppress(FileNotFoundError):
        return os.getcwd()
    return ""


def _hear(event: str, _: tuple[Any, ...]) -> None:
    if event == "os.chdir":
        _MOVED.add(get_ident())


sys.addaudithook(_hear)
