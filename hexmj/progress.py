"""Progress bars of long work, on standard error."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[float], None]
"""Progress function: it is called with the fraction of the work that was done since its last call."""

EVERY = 5.0
"""Time between two updates of a progress bar outside a terminal, such as in a log file [s]."""

COMPILING = "the first run compiles, for up to a minute"


@contextmanager
def shown(progress: Progress | bool | None, label: str) -> Iterator[Progress | None]:
    """Provide the progress function of a block: `progress` if it is a function, a new bar for True, otherwise None."""
    if progress is True:
        with progress_bar(label) as advance:
            yield advance
    else:
        yield progress or None


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Show a progress bar during a block, and provide its progress function, which any thread may call.

    The clock of the estimate starts with the first progress, so that it leaves out the compilation.
    """
    from tqdm import tqdm

    screen = sys.stderr.isatty()
    style: Any = {"mininterval": 0.1, "leave": False} if screen else {"mininterval": EVERY, "delay": EVERY}
    style |= {"bar_format": "{desc}: {percentage:.0f} %{bar}{elapsed}, {remaining} left"}
    with tqdm(desc=f"{label} ({COMPILING})", total=1.0, smoothing=0.0, **style) as bar:

        def advance(done: float) -> None:
            with bar.get_lock():
                if not bar.initial:
                    bar.initial, bar.start_t, bar.delay, bar.desc = done, time.time(), 0.0, label
                bar.update(min(done, bar.total - bar.n))

        yield advance


def part_of(progress: Progress | None, part: float) -> Progress | None:
    """Return a progress function for work that is the fraction `part` of the work of `progress`."""
    return progress and (lambda done: progress(part * done))
