"""What this machine has, and work on all of its cores: blocks of starts on a pool of threads that release the GIL."""

import math
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from hexmj.checks import whole


def cores() -> int:
    """Cores that this process may use, as far as the operating system tells."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory() -> float:
    """This machine's memory [bytes]; infinite where the operating system does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def thread_count(threads: int | None = None) -> int:
    """The number of threads asked for, by default one per core.

    Raises:
        InputError: no whole number of at least 1.
    """
    return cores() if threads is None else whole("threads", threads, 1, more=", or nothing for one per core")


def run_blocks(work: Callable[[int, int], None], size: int, block: int, threads: int | None = None) -> None:
    """Call ``work(begin, end)`` for consecutive blocks of range(size); results must not depend on the order."""
    count = thread_count(threads)
    bounds = [(begin, min(begin + block, size)) for begin in range(0, size, block)]
    if count == 1 or len(bounds) == 1:
        for begin, end in bounds:
            work(begin, end)
        return
    with ThreadPoolExecutor(count) as pool:
        futures = [pool.submit(work, begin, end) for begin, end in bounds]
        try:
            for future in futures:
                future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
