"""The processor's side of the network's speed: its name, its clock, and the operations that a step takes."""

import platform
import re
from collections import Counter
from pathlib import Path
from time import perf_counter
from typing import Any, cast

import numpy as np
from numba import njit

from hexmj.controllers.cruse1998 import kernel
from hexmj.threads import cores

ARITHMETIC = r"v(add|sub|mul|div|min|max|cmp\w*|blendm|and|or|xor|andn)p[ds]"
WIDTHS = {"zmm": 8, "ymm": 4, "xmm": 2}
"""Numbers in a register of each name."""


def description() -> str:
    """Processor, cores that this process may use, operating system and versions, in one line."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    name = re.search(r"model name\s*: (.+)", text)
    family = re.search(r"cpu family\s*: (\d+)", text)
    cpu = (name[1] if name else platform.processor()) + (f" (family {family[1]})" if family else "")
    return f"{cpu}, {cores()} cores, {platform.system()}, Python {platform.python_version()}"


def clock(turns: int = 20_000_000) -> float:
    """The clock while it computes [Hz], from a chain of integer operations of one cycle each."""
    _chain(10)
    seconds = []
    for _ in range(5):
        begin = perf_counter()
        _chain(turns)
        seconds.append(perf_counter() - begin)
    return 6 * turns / min(seconds)


def operations() -> tuple[int, int]:
    """Arithmetic operations of the compiled kernel for each start and step (0 without AVX), and how many at a time."""
    block, p, k, rules = np.zeros(kernel.ROWS * kernel.LANES), (0.0,) * 72, (1.0,) * 18, ((),) * 6
    step = cast(Any, njit)(kernel._step_printed.py_func)
    step(block, p, k, rules)
    code = step.inspect_asm(step.signatures[0])
    lines = [line for line in code.splitlines() if re.match(rf"\s+{ARITHMETIC}\s", line)]
    counts = Counter(register for line in lines for register in WIDTHS if register in line)
    register, number = max(counts.items(), key=lambda item: item[1], default=("xmm", 0))
    return number, WIDTHS[register]


@njit(cache=True)
def _chain(turns):
    """A random number generator of three shifts and three exclusive ors, each of which waits for the one before."""
    x = np.uint64(88172645463325252)
    for _ in range(turns):
        x ^= x << np.uint64(13)
        x ^= x >> np.uint64(7)
        x ^= x << np.uint64(17)
    return x
