"""Progress of long work on standard error."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[float], None]
"""Receives the fraction of the work that was done since the last call."""

EVERY = 5.0
"""Time between two states of a bar that is not in a terminal, such as in a log file [s]."""

COMPILING = "the first run compiles, for up to a minute"


@contextmanager
def shown(progress: Progress | bool | None, label: str) -> Iterator[Progress | None]:
    """Provide the progress function of a block: the caller's, a bar for True, None for False or None."""
    if progress is True:
        with progress_bar(label) as advance:
            yield advance
    else:
        yield progress or None


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Show the progress of a block, which calls the function that this yields, from any thread."""
    from tqdm import tqdm

    how: Any = {"mininterval": 0.1} if sys.stderr.isatty() else {"mininterval": EVERY, "delay": EVERY}
    how |= {"bar_format": "{desc}: {percentage:.0f} %{bar}{elapsed}, {remaining} left", "leave": False}
    with tqdm(desc=f"{label} ({COMPILING})", total=1.0, smoothing=0.0, **how) as bar:

        def advance(done: float) -> None:
            with bar.get_lock():
                bar.desc = label
                bar.update(done)

        yield advance


def part_of(progress: Progress | None, part: float) -> Progress | None:
    """Return the progress function of a part of some work."""
    return progress and (lambda done: progress(part * done))
