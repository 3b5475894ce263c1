"""Episodes under the same action throughout, actions at random, and observations that ought to be the same."""

import numpy as np
import pytest
from dm_control.rl import control
from dm_env import TimeStep

ZEROS = np.zeros(18)
KINDS = pytest.mark.parametrize("actions", ["joints", "tips"])


def episode(walking: control.Environment, action: np.ndarray) -> list[TimeStep]:
    """One with the same action throughout."""
    steps = [walking.reset()]
    while not steps[-1].last():
        steps.append(walking.step(action))
    return steps


def run_steps(walking: control.Environment, count: int) -> TimeStep:
    """The last of some steps with zeros."""
    walking.reset()
    return [walking.step(ZEROS) for _ in range(count)][-1]


def some_actions(steps: int, count: int, seed: int = 0, size: float = 0.3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-size, size, (steps, count, 18))


def assert_same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
