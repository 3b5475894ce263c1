"""Cores and memory of this machine, and a pool of threads that computes blocks of starts in parallel."""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from hexmj.errors import InputError
from hexmj.validate import whole


def cores() -> int:
    """Return the number of cores that this process may use."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def thread_count(threads: int | None = None) -> int:
    """Return the number of threads, by default one per core."""
    return cores() if threads is None else whole("threads", threads, 1)


def check_memory(what: str, needed: float) -> None:
    """Raise InputError if this machine has less than the needed memory [bytes]; the message begins with `what`."""
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else float("inf")
    if needed > available:
        raise InputError(f"{what} need {needed / 1e9:.3g} GB of memory; this machine has {available / 1e9:.3g} GB")


def run_blocks(work: Callable[[int, int], None], size: int, block: int, threads: int | None = None) -> None:
    """Call `work(begin, end)` on threads for blocks of range(size), each of length `block`, in any order."""
    count = thread_count(threads)
    begins = range(0, size, block)
    ends = [min(begin + block, size) for begin in begins]
    if count == 1 or len(ends) == 1:
        list(map(work, begins, ends))
        return
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(work, begins, ends))  # an error cancels the blocks that wait
