"""Threads, processes or a cluster for the cells of a command."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from hexmj.progress import progress_bar


@dataclass(frozen=True)
class Sweepers:
    """What works on cells, which are kept as they finish."""

    threads: int | None = None
    """Threads of each process; unless given, processes share the cores.  No result depends on it."""
    processes: int = 1
    """Processes that compute cells side by side.  No result depends on it."""
    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers compute the cells instead; they must see
    the results' folder.  No result depends on it."""
    fresh: bool = False
    """Compute everything again, and replace what is cached."""

    @contextmanager
    def at_work(self, label: str) -> Iterator[dict[str, Any]]:
        """Arguments of `Execution` under a progress bar."""
        from hexmj.sweep import threads_each, workers

        with workers(self.processes, self.scheduler) as executor, progress_bar(label) as progress:
            threads = threads_each(self.threads, self.processes)
            yield {"executor": executor, "progress": progress, "threads": threads, "fresh": self.fresh}
