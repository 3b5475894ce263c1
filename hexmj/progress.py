"""Progress of long work on standard error: a bar in a terminal or a notebook, a line every few seconds elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import Any

Progress = Callable[[float], None]
"""Receives the fraction of the work that was done since the last call."""

EVERY = 5.0
"""Time between two lines where there is no bar [s]."""

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
    """Show the progress of a block, which calls the function that this yields."""
    elsewhere = _in_notebook if "ipykernel" in sys.modules else _in_lines
    bar = _in_terminal if sys.stderr.isatty() else elsewhere
    with bar(label) as advance:
        yield advance


def part_of(progress: Progress | None, part: float) -> Progress | None:
    """Return the progress function of a part of some work."""
    return progress and (lambda done: progress(part * done))


@contextmanager
def _in_terminal(label: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda done: bar.advance(task, done)


@contextmanager
def _in_notebook(label: str) -> Iterator[Progress]:
    """The browser's own bar, which needs no widgets."""
    from html import escape

    from IPython.display import HTML, display

    total, drawn = 0.0, monotonic()
    bar: Any = display(HTML(f"{escape(label)}: {COMPILING}"), display_id=True)

    def draw() -> None:
        bar.update(HTML(f'{escape(label)} <progress max="1" value="{total:.3f}"></progress> {total:.0%}'))

    def advance(done: float) -> None:
        nonlocal total, drawn
        total += done
        if monotonic() - drawn > 0.2:
            draw()
            drawn = monotonic()

    yield advance
    draw()


@contextmanager
def _in_lines(label: str) -> Iterator[Progress]:
    total, begin, over = 0.0, monotonic(), Event()

    def advance(done: float) -> None:
        nonlocal total
        total += done

    def report() -> None:
        while not over.wait(EVERY):
            elapsed = monotonic() - begin
            left = f"about {max(elapsed / total - elapsed, 0.0):.0f} s left" if total > 0 else COMPILING
            print(f"{label}: {total:.0%} in {elapsed:.0f} s, {left}", file=sys.stderr, flush=True)

    reporter = Thread(target=report, daemon=True)
    reporter.start()
    try:
        yield advance
    finally:
        over.set()
        reporter.join()
