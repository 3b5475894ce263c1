"""Episodes of the dm_env face under the same action throughout."""

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
