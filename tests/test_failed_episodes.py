"""Insects that diverge or do not settle: an error, and then all begin anew."""

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from hexmj.conditions import Conditions
from hexmj.environments.gym import StickInsect
from hexmj.environments.vector import StickInsects
from hexmj.errors import InputError, SimulationError
from tests.episodes import assert_same, some_actions

TIPS: dict[str, Any] = {"actions": "tips"}
TILTING: dict[str, Any] = TIPS | {"conditions": Conditions(centre_of_mass=-8.0)}
"""Not every start settles."""


@pytest.mark.parametrize("walking", [StickInsect(**TIPS), StickInsects(1, **TIPS)], ids=["one", "many"])
def test_divergence_is_an_error_that_can_be_replayed(walking: Any):
    walking.reset(seed=0)
    walking._walkers.bodies.qvel[0, 0] = 1e12
    with pytest.raises(SimulationError, match="diverged while acting") as error:
        for _ in range(5):
            walking.step(np.zeros(walking.action_space.shape))
    assert set(error.value.state) >= {"qpos", "qvel", "ctrl", "conditions"}


@pytest.mark.slow
@pytest.mark.parametrize("mode", AutoresetMode)
def test_after_a_divergence_a_reset_is_a_new_beginning(mode):
    task: Any = {**TIPS, "autoreset_mode": mode}
    walking, other = StickInsects(2, **task), StickInsects(2, **task)
    walking.reset(seed=0)
    walking._walkers.bodies.qvel[1, 0] = 1e12
    with pytest.raises(SimulationError):
        for _ in range(5):
            walking.step(np.zeros((2, 18)))
    assert_same(walking.reset(seed=4)[0], other.reset(seed=4)[0])
    for action in some_actions(60, 2):
        assert_same(walking.step(action)[0], other.step(action)[0])


def test_after_a_step_that_failed_all_begin_anew():
    """The others may have taken it or not."""
    walking = StickInsects(2, **TIPS)
    walking.reset(seed=0)
    walking._walkers.bodies.qvel[1, 0] = 1e30
    with pytest.raises(SimulationError):
        walking.step(np.zeros((2, 18)))
    with pytest.raises(InputError, match="whose last step or reset failed; expected a reset of all"):
        walking.reset(options={"reset_mask": np.array([False, True])})
    with pytest.raises(InputError, match="after a step or a reset that failed; expected a reset of all"):
        walking.step(np.zeros((2, 18)))
    assert_same(walking.reset(seed=4)[0], StickInsects(2, **TIPS).reset(seed=4)[0])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_after_a_start_that_did_not_settle_all_begin_anew(mode):
    """The third start by the seed 9 does not; no insect stays behind without rewards."""
    walking = StickInsects(3, duration=0.2, autoreset_mode=mode, **TILTING)
    walking.reset(seed=[2, 3, 9])
    with pytest.raises(SimulationError, match="start 2 did not settle"):  # though insects with others begin, too
        for _ in range(10):
            walking.step(np.zeros((3, 18)))
    with pytest.raises(InputError, match="a reset that failed; expected a reset of all"):
        walking.step(np.zeros((3, 18)))
    with pytest.raises(InputError, match="or reset failed; expected a reset of all"):
        walking.reset(options={"reset_mask": np.array([False, False, True])})
    assert_same(walking.reset(seed=5)[0], StickInsects(3, **TILTING).reset(seed=5)[0])
    walking.step(np.zeros((3, 18)))


def test_the_insect_is_told_whose_start_did_not_settle():
    walking = StickInsects(3, autoreset_mode="Disabled", **TILTING)
    walking.reset(seed=5)
    with pytest.raises(SimulationError, match="start 2 did not settle"):
        walking.reset(seed=[0, 0, 1], options={"reset_mask": np.array([False, False, True])})


@pytest.mark.parametrize("steps", [1, 2], ids=["in mid-episode", "at its end"])
def test_no_step_follows_a_reset_that_failed(steps):
    walking = StickInsect(duration=0.2, **TILTING)
    walking.reset(seed=3)
    for _ in range(steps):
        walking.step(np.zeros(18))
    with pytest.raises(SimulationError, match="start 0 did not settle"):
        walking.reset(seed=1)
    with pytest.raises(InputError, match="a reset that failed"):
        walking.step(np.zeros(18))
    walking.reset(seed=3)
    walking.step(np.zeros(18))
