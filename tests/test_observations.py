"""What an insect in the dm_env face observes, and what it is paid for."""

import numpy as np
import pytest
from dm_control.rl import control

from episodes import run_steps
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.environments import dm


def test_observed_tips_are_those_of_the_joints():
    walking = dm.load(actions="tips")
    seen = run_steps(walking, 100).observation
    tips = walking.physics.compiled.forward(seen["joint_angles"].reshape(6, 3))
    np.testing.assert_allclose(seen["tips"], tips, rtol=0, atol=1e-9)


def seen(walking: control.Environment) -> dict[str, np.ndarray]:
    """What is observed now."""
    return walking.task.get_observation(walking.physics)


def test_velocity_is_seen_from_the_heading():
    walking = dm.load()
    walking.reset()
    with walking.physics.reset_context():
        data = walking.physics.data
        data.qpos[2:7] = 20.0, np.cos(0.4), 0.0, 0.0, np.sin(0.4)
        data.qvel[:3] = 10.0 * np.cos(0.8), 10.0 * np.sin(0.8), 3.0
    np.testing.assert_allclose(seen(walking)["velocity"], [10.0, 0.0, 3.0], atol=1e-12)


def test_clearance_at_home_is_that_of_the_metathorax():
    walking = dm.load()
    walking.reset()
    walking.physics.reset(walking.physics.model.name2id("home", "key"))
    assert seen(walking)["clearance"] == pytest.approx(10.4 - 2.0 - 1.6)


@pytest.mark.slow
def test_no_foot_in_contact_has_a_margin_of_its_own():
    """It lies below every margin that one foot in contact can have, at any reach of the legs."""
    walking = dm.load()
    walking.reset()
    physics, walkers = walking.physics, walking.task._walkers

    def margin(standing: np.ndarray) -> float:
        flat = walkers.observer.observe(walkers.places, standing[np.newaxis], walkers._planned)
        return walkers.observer.named(flat)["margin"][0, 0]

    one = [margin(row) for row in np.eye(6, dtype=bool)]
    assert margin(np.zeros(6, dtype=bool)) == STICK_INSECT.lengths.no_foot_margin < min(one) < 0
    legs = physics.compiled.kinematics
    reach = np.linalg.norm(legs.coxa_position[:, :2], axis=1) + legs.coxa + legs.femur + legs.tibia
    farthest = STICK_INSECT.lengths.farthest_centre_of_mass
    assert reach.max() + farthest < -STICK_INSECT.lengths.no_foot_margin


def test_reward_is_its_formula():
    walking = dm.load(0.25)
    walking.reset()
    task, physics = walking.task, walking.physics
    command = 0.25 * Conditions().vp
    with physics.reset_context():
        physics.data.qpos[2:7] = 20.0, 1.0, 0.0, 0.0, 0.0
    for speed, reward in ((1, 1), (0, 0), (0.5, 0.5), (1.5, 0.5), (2, 0), (3, 0), (-1, 0)):
        physics.data.qvel[0] = speed * command
        assert task.get_reward(physics) == pytest.approx(reward)
    for roll, reward in ((0.0, 1.0), (np.pi / 3, 0.5), (np.pi / 2, 0.0), (np.pi, 0.0)):
        with physics.reset_context():
            physics.data.qpos[2:7] = 60.0, np.cos(roll / 2), np.sin(roll / 2), 0.0, 0.0
            physics.data.qvel[0] = command
        assert task.get_reward(physics) == pytest.approx(reward, abs=1e-12)
