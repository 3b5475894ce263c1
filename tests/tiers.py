"""Which cases of a test `.ci/run` has time for."""

from collections.abc import Iterable
from typing import Any

import pytest


def few_of(cases: Iterable[Any], *few: Any) -> list[Any]:
    """All cases, in their order; those besides the few are tried by `make thorough` alone."""
    rare = pytest.mark.thorough
    return [
        one if one in few else pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=rare) for one in cases
    ]
