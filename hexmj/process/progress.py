"""How far long work has come: a bar in a terminal or a notebook, lines elsewhere, all on standard error."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from time import monotonic
from typing import Any

from hexmj.checks import typed
from hexmj.storage.literal import literal

Progress = Callable[[float], None]
"""Told the fraction of the work that has been done since the last call."""

EVERY = 5.0
"""Time from line to line where there is no bar [s]."""

FIRST = "a first run compiles, for up to a minute"
"""What is told where nothing is done yet after that time."""

OFTEN = 0.2
"""Least time from one state of a notebook's bar to the next [s]."""


@contextmanager
def shown(progress: Progress | bool | None, label: str) -> Iterator[Progress | None]:
    """What a caller's `progress` comes to while the block runs: its function, a bar for True, else nothing.

    Raises:
        InputError: it is none of these.
    """
    wanted = typed("progress", progress, Progress | bool | None)
    if wanted is True:
        with progress_bar(label) as told:
            yield told
    else:
        yield None if wanted is False else wanted


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Show how far the block has come; call what it gives with the fraction done since the last call."""
    way = _in_terminal if sys.stderr and sys.stderr.isatty() else _in_notebook if _is_notebook() else _in_lines
    with way(label) as told:
        yield told


def part_of(progress: Progress | None, part: float) -> Progress | None:
    """What a part of some work is told by, where the whole is told by a progress."""
    return progress and (lambda done: progress(part * done))


@contextmanager
def _in_terminal(label: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar
    from rich.text import Text

    class First(ProgressColumn):
        def render(self, task: Any) -> Text:
            return Text(FIRST if not task.completed and (task.elapsed or 0.0) >= EVERY else "")

    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn(), First()
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda done: bar.advance(task, done)


def _is_notebook() -> bool:
    """Whether a kernel of Jupyter runs this."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


@contextmanager
def _in_notebook(label: str) -> Iterator[Progress]:
    """The browser's own bar, which needs no widgets."""
    from html import escape

    from IPython.display import HTML, display

    def bar(done: float) -> HTML:
        return HTML(f'{escape(label)} <progress max="1" value="{done:.3f}"></progress> {done:.0%}')

    shown: Any = display(HTML(f"{bar(0.0).data} {FIRST}"), display_id=True)
    sofar, drawn = 0.0, monotonic()

    def told(done: float) -> None:
        nonlocal sofar, drawn
        sofar += done
        if monotonic() - drawn > OFTEN:
            shown.update(bar(sofar))
            drawn = monotonic()

    yield told
    shown.update(bar(1.0))


@contextmanager
def _in_lines(label: str) -> Iterator[Progress]:
    """A line every few seconds, however seldom anything is done."""
    sofar, begun, over = 0.0, monotonic(), Event()

    def told(done: float) -> None:
        nonlocal sofar
        sofar += done

    def tell() -> None:
        nothing = f"; {FIRST}"
        while not over.wait(EVERY):
            gone = monotonic() - begun
            left = f", about {max(gone / sofar - gone, 0.0):.0f} s to go" if sofar > 0 else nothing
            nothing = ""
            with suppress(OSError, ValueError, AttributeError):  # closed, or nobody listens any more
                line = f"{literal(label)}: {sofar:.0%} in {gone:.0f} s{left}\n"
                sys.stderr.write(line)  # print takes standard output where there is none
                sys.stderr.flush()

    teller = Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield told
    finally:
        over.set()
        teller.join()
