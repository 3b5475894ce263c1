"""The fixture `measure`, which takes one figure by pytest-benchmark and notes what `table` prints."""

from collections.abc import Callable
from typing import Any

import pytest

OURS = "hexmj"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option `--once`."""
    parser.addoption("--once", action="store_true", help="take every figure once, without a warm-up")


@pytest.fixture
def measure(benchmark: Any, pytestconfig: pytest.Config) -> Callable[..., Any]:
    """Return `measure(work, what, who, ...)`, which runs `work` and returns its value.

    `what` names the row of the table, `who` is hexmj or a peer. The figure is `amount` per second in `unit`, or the
    seconds themselves without an amount. `ratio` is the least ratio of hexmj to its first peer.
    """

    def run(
        work: Callable[[], Any],
        what: str,
        who: str = OURS,
        *,
        amount: float | None = None,
        unit: str = "s",
        ratio: float | None = None,
        rounds: int = 3,
        warm: bool = True,
    ) -> Any:
        benchmark.extra_info.update(what=what, who=who, amount=amount, unit=unit, ratio=ratio)
        once = pytestconfig.getoption("--once")
        return benchmark.pedantic(work, rounds=1 if once else rounds, warmup_rounds=int(warm and not once))

    return run
