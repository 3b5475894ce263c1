"""Where a command's answer goes, and where what else is printed meanwhile, as by a user's controller."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from typing import TextIO

from hexmj.errors import InputError

ANSWERS: ContextVar[TextIO | None] = ContextVar("answers", default=None)
"""To which an answer is written; None is standard output, wherever it leads."""


@contextmanager
def alone() -> Iterator[None]:
    """While the block runs, nothing but the answer goes to standard output; the rest goes to standard error.

    Raises:
        InputError: standard output is closed.
    """
    if sys.stdout is None:
        raise InputError("standard output is closed; expected it open, for the answer")
    before = ANSWERS.set(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        ANSWERS.reset(before)
