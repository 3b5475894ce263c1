"""One figure a test: `measure` runs it by pytest-benchmark and notes what `table` needs to print it."""

from collections.abc import Callable
from typing import Any

import pytest

OURS = "hexmj"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--once", action="store_true", help="take every figure once, and not after a first time")


@pytest.fixture
def measure(benchmark: Any, pytestconfig: pytest.Config) -> Callable[..., Any]:
    """``measure(work, what, who, ...)`` runs `work` and returns its value.

    `what` names the row, `who` is hexmj or a peer of it.  The figure is `amount` per second in `unit`, or the
    seconds themselves without an amount; `bar` is the figure to reach, or not to exceed, `ratio` the least
    ratio to the peers.
    """

    def run(
        work: Callable[[], Any],
        what: str,
        who: str = OURS,
        *,
        amount: float | None = None,
        unit: str = "s",
        bar: float | None = None,
        ratio: float | None = None,
        rounds: int = 3,
        warm: bool = True,
    ) -> Any:
        benchmark.extra_info.update(what=what, who=who, amount=amount, unit=unit, bar=bar, ratio=ratio)
        once = pytestconfig.getoption("--once")
        return benchmark.pedantic(work, rounds=1 if once else rounds, warmup_rounds=int(warm and not once))

    return run
