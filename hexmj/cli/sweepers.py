"""What works on the cells of a command: threads, processes, or a cluster."""

import os
import threading
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any

from hexmj.errors import InputError
from hexmj.process.progress import progress_bar
from hexmj.process.signals import STOPS, of_stop, stops_wait, unheard_by_children

MOST_PROCESSES = 1000
"""More than any machine has cores."""


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

    @property
    def threads_each(self) -> int | None:
        """Threads of each process; None where a single one takes all cores."""
        from hexmj.process.threads import thread_count

        if self.threads is not None:
            return thread_count(self.threads)
        return max(1, thread_count() // max(1, self.processes)) if self.processes != 1 else None

    @contextmanager
    def at_work(self, label: str) -> Iterator[dict[str, Any]]:
        """How cells are computed under a progress bar, as what conducts them is told; errors as of `executor`."""
        with self.executor() as executor, progress_bar(label) as progress:
            yield {"executor": executor, "progress": progress, "threads": self.threads_each}

    @contextmanager
    def executor(self) -> Iterator[Executor | None]:
        """The processes, a cluster's workers, or None where this process does the work.

        Raises:
            InputError: no process, too many, or more than the system takes, or a scheduler as well or that cannot be
                reached.
        """
        if not 1 <= self.processes <= MOST_PROCESSES:
            raise InputError(f"--processes = {self.processes}; expected at least 1 and at most {MOST_PROCESSES}")
        if self.processes == 1:
            from hexmj.sweeps.cluster import workers_of

            with nullcontext() if self.scheduler is None else workers_of(self.scheduler) as executor:
                yield executor
            return
        if self.scheduler is not None:
            raise InputError(f"--scheduler and --processes = {self.processes}; expected one of them")
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import active_children, get_context

        from hexmj.sweeps.workers import end_with_parent

        with ExitStack() as ended:
            with stops_wait(), unheard_by_children(*STOPS):  # else semaphores might be left behind
                try:
                    pool = ProcessPoolExecutor(self.processes, get_context("spawn"), initializer=end_with_parent)
                except OSError as error:
                    told = f"--processes = {self.processes}: the system has no semaphores for them ({error.strerror})"
                    raise InputError(f"{told}; expected a shared memory that takes some, or --processes 1") from None
                executor = ended.enter_context(pool)
            try:
                with unheard_by_children(*STOPS):
                    for _ in range(self.processes):
                        executor.submit(os.getpid)  # begins one
                yield executor
            except BaseException as error:
                if of_stop(error):  # nobody waits for cells that are stopped
                    threading.excepthook = lambda _: None  # the pool's own thread minds that they were cancelled
                    for worker in active_children():
                        worker.terminate()
                raise
            with stops_wait():  # nothing is left to do but to leave
                executor.shutdown()
