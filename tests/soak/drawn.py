"""Inputs of each kind, drawn from a seed and tried one by one."""

import gc
import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

import hexmj
from tests.soak import calls, commands, files
from tests.soak.judge import judged

SLOW = (HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much, HealthCheck.large_base_example)

KINDS: dict[str, tuple[Any, Callable[[Any], None]]] = {
    "commands": (commands.command_lines(), commands.typed),
    "calls": (calls.calls(), calls.called),
    "files": (files.damages(), files.damaged),
}
"""Kind of input -> what draws them, and what is done with one."""


@dataclass
class Tried:
    """What came of some inputs of a kind."""

    kind: str
    codes: Counter[int] = field(default_factory=Counter)
    """Exit code -> how often."""
    faults: dict[str, str] = field(default_factory=dict)
    """What is wrong -> the first input of which it is."""


def try_job(job: tuple[str, int, int]) -> Tried:
    """`try_inputs` with all of its arguments in one."""
    return try_inputs(*job)


def try_inputs(kind: str, inputs: int, number: int) -> Tried:
    """Draw so many inputs of a kind from the seed `number`, and try each in a process of its own."""
    drawn, work = KINDS[kind]
    tried = Tried(kind)
    _warm()

    @seed(number)
    @settings(
        max_examples=inputs, deadline=None, database=None, phases=[Phase.generate],
        suppress_health_check=SLOW, report_multiple_bugs=False,
    )  # fmt: skip
    @given(drawn)
    def one(given: Any) -> None:
        with TemporaryDirectory(prefix="hexmj-soak-") as folder:
            verdict = judged(lambda: work(given), Path(folder))
        tried.codes[verdict.code] += 1
        for fault in verdict.faults:
            tried.faults.setdefault(_kind_of(fault), f"{given!r:.400}\n    {verdict.complaint[-300:]}")

    one()
    return tried


def _kind_of(fault: str) -> str:
    """A fault without the values that differ from input to input."""
    return re.sub(r"'[^']*'|\d[\d.e+-]*", "*", fault)[:120]


@cache
def _warm() -> None:
    """Import and load here, once, what every forked process would."""
    warnings.simplefilter("ignore")
    for command in commands.SMALL:
        commands.offered(command)
    calls.usual()
    files.originals()
    hexmj.flss(hexmj.LDVS, [0.5], n_starts=2, window=3.0, threads=1)
    hexmj.compare(hexmj.LDVS, [0.5], n_starts=1, window=2.0, threads=1)
    gc.collect()
    gc.freeze()  # what is here stays shared with the processes to come
