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


class Bar:
    """Progress function of a progress bar, which any thread may call.

    The clock of the estimate starts with the first progress, so that it leaves out the compilation.
    """

    def __init__(self, bar: Any, label: str) -> None:
        """Begin with the label of a `tqdm` bar, to which notes are added."""
        self._bar, self._label, self._note = bar, label, ""

    def __call__(self, done: float) -> None:
        """Show that a fraction of the work is done."""
        with self._bar.get_lock():
            if not self._bar.initial:
                self._bar.initial, self._bar.start_t, self._bar.delay = done, time.time(), 0.0
                self._bar.desc = self._label + self._note
            self._bar.update(min(done, self._bar.total - self._bar.n))

    def note(self, text: str) -> None:
        """Show a text after the label."""
        self._note = f", {text}" if text else ""
        if self._bar.initial:
            self._bar.desc = self._label + self._note


@contextmanager
def progress_bar(label: str) -> Iterator[Bar]:
    """Show a progress bar during a block, and provide its progress function."""
    from tqdm import tqdm

    screen = sys.stderr.isatty()
    style: Any = {"mininterval": 0.1, "leave": False} if screen else {"mininterval": EVERY, "delay": EVERY}
    style |= {"bar_format": "{desc}: {percentage:.0f} %{bar}{elapsed}, {remaining} left"}
    with tqdm(desc=f"{label} ({COMPILING})", total=1.0, smoothing=0.0, **style) as bar:
        yield Bar(bar, label)


def part_of(progress: Progress | None, part: float) -> Progress | None:
    """Return a progress function for work that is the fraction `part` of the work of `progress`."""
    return progress and (lambda done: progress(part * done))
