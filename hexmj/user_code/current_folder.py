"""The current folder, which a user's code may change or remove."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import get_ident
from typing import Any

_MOVED = set[int]()
"""Threads that have changed it within their block; it is the whole program's, and another one may do so meanwhile."""


@contextmanager
def kept_folder() -> Iterator[None]:
    """Change the folder back if the block changes it, in its own thread."""
    here, thread = _folder(), get_ident()
    outside = thread in _MOVED
    _MOVED.discard(thread)
    try:
        yield
    finally:
        if here and thread in _MOVED:
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
