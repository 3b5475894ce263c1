"""Parameters that only the slow tests need."""

from collections.abc import Iterable
from typing import Any

import pytest


def few_of(cases: Iterable[Any], *few: Any) -> list[Any]:
    """Return all cases in order; those not among the few are marked `slow`."""
    return [
        case if case in few else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for case in cases
    ]
