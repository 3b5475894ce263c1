"""What this machine has, and work on all of its cores: blocks of starts on a pool of threads that release the GIL."""

import math
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from hexmj.checks import whole
from hexmj.errors import InputError

MOST_THREADS = 1000
"""Far more than any machine has cores."""

LITTLE = 1e7
"""Memory for which nobody asks what there is [bytes]."""

GROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")
"""Where Linux tells how much memory a process group may have."""


def cores() -> int:
    """Cores that this process may use, as far as the operating system tells."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory() -> float:
    """Memory that this process may have [bytes], as far as the operating system tells: the machine's, or a limit's."""
    known = [math.inf]
    with suppress(AttributeError, ValueError, OSError):
        known.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    with suppress(ValueError, OSError):  # of a container or a batch job; "max" is no limit
        known.append(int(GROUP_LIMIT.read_text()))
    with suppress(ImportError, ValueError, OSError):
        from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit

        known += [one for one in getrlimit(RLIMIT_AS)[:1] if one != RLIM_INFINITY]
    return float(min(known))


def check_memory(what: str, needed: float) -> None:
    """Refuse what takes more memory [bytes] than this process may have.

    Raises:
        InputError: it does.
    """
    if needed > LITTLE and needed > (there := memory()):
        raise InputError(f"{what} take {needed / 1e9:.3g} GB; expected at most the {there / 1e9:.3g} GB that are there")


def thread_count(threads: int | None = None) -> int:
    """The number of threads asked for, by default one per core.

    Raises:
        InputError: no whole number of at least 1.
    """
    return cores() if threads is None else whole("threads", threads, 1, MOST_THREADS, ", or nothing for one per core")


def run_blocks(work: Callable[[int, int], None], size: int, block: int, threads: int | None = None) -> None:
    """Call ``work(begin, end)`` for consecutive blocks of range(size); results must not depend on the order."""
    count = thread_count(threads)
    begins = range(0, size, block)
    ends = [min(begin + block, size) for begin in begins]
    if count == 1 or len(ends) == 1:
        list(map(work, begins, ends))
        return
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(work, begins, ends))  # which cancels the others after an error
