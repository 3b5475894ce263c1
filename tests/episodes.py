"""Episodes under constant actions, random actions, and a comparison of observations."""

from typing import Any

import numpy as np
import pytest

TIPS: dict[str, Any] = {"actions": "tips"}
ZEROS = np.zeros(18)
KINDS = pytest.mark.parametrize("actions", ["joints", "tips"])


def episode(walking: Any, action: np.ndarray) -> list[Any]:
    """Return an episode of the dm_env interface with a constant action."""
    steps = [walking.reset()]
    while not steps[-1].last():
        steps.append(walking.step(action))
    return steps


def some_actions(steps: int, count: int, seed: int = 0, size: float = 0.3) -> np.ndarray:
    """Return random actions, (step, insect, number)."""
    return np.random.default_rng(seed).uniform(-size, size, (steps, count, 18))


def assert_same(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> None:
    """Compare two observations bit for bit."""
    assert first.keys() == second.keys()
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], err_msg=name)
