"""The dm_env face: its contract, its actions, how episodes end, and what the viewer needs."""

import copy
import pickle
import unittest

import numpy as np
import pytest
from dm_control.rl import control
from dm_control.suite.wrappers import action_noise
from dm_control.viewer.runtime import Runtime, State
from dm_env import specs
from dm_env.test_utils import EnvironmentTestMixin

from drawing import drawing
from episodes import KINDS, ZEROS, episode
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.environments import dm
from hexmj.errors import InputError, SimulationError
from hexmj.legs import LEGS
from hexmj.timing import Stride


class _Contract(EnvironmentTestMixin):
    """dm_env's own checks; the sequence of actions goes beyond the end of an episode."""

    def make_action_sequence(self):
        for _ in range(30):
            yield self.make_action()


class TestJointsContract(_Contract, unittest.TestCase):
    def make_object_under_test(self):
        return dm.load(actions="joints", duration=2.0)


class TestTipsContract(_Contract, unittest.TestCase):
    def make_object_under_test(self):
        return dm.load(actions="tips", duration=2.0)


@KINDS
def test_specs_are_named_and_bounded(actions):
    walking = dm.load(actions=actions)
    action = walking.action_spec()
    assert isinstance(action, specs.BoundedArray)
    assert len(set(action.name.split("\t"))) == 18
    assert all(name.startswith(leg) for name, leg in zip(action.name.split("\t"), np.repeat(LEGS, 3), strict=True))
    assert np.isfinite(action.minimum).all()
    assert (action.minimum < action.maximum).all()
    observations = walking.observation_spec()
    assert list(observations) == list(walking.reset().observation)
    assert all(spec.name == name for name, spec in observations.items())
    for name in {"contact", "planned_stance"}:
        assert isinstance(observations[name], specs.BoundedArray)


def test_joint_actions_are_the_actuators_targets_in_their_order():
    walking = dm.load(actions="joints")
    model = walking.physics.model
    spec = walking.action_spec()
    assert spec.name.split("\t") == [model.id2name(i, "actuator") for i in range(18)]
    np.testing.assert_array_equal(np.stack([spec.minimum, spec.maximum], axis=1), model.actuator_ctrlrange)
    action = walking.reset().observation["joint_angles"] + 0.01
    walking.step(action)
    np.testing.assert_array_equal(walking.physics.control(), action)
    walking.step(spec.maximum.astype(np.float32))


def test_physics_is_reached_by_names():
    walking = dm.load()
    step = walking.reset()
    named = walking.physics.named.data
    assert named.qpos["L1_thorax_coxa"] == step.observation["joint_angles"][0]
    assert named.qpos["R3_femur_tibia"] == step.observation["joint_angles"][17]
    assert walking.control_timestep() == pytest.approx(Stride().dt / Conditions().vp)
    for _ in range(200):
        walking.step(step.observation["joint_angles"])
    weight = 9810 * walking.physics.model.body_mass.sum()
    assert sum(named.sensordata[f"{leg}_touch"][0] for leg in LEGS) == pytest.approx(weight, rel=0.02)


def folded(walking: control.Environment) -> np.ndarray:
    """Joint targets that pull all feet up to the body."""
    spec = walking.action_spec()
    action = 0.5 * (spec.minimum + spec.maximum).reshape(6, 3)
    action[:, 1] = spec.maximum.reshape(6, 3)[:, 1]
    return action.ravel()


def test_a_fall_ends_the_episode_with_discount_zero():
    walking = dm.load(actions="joints")
    steps = episode(walking, folded(walking))
    assert len(steps) < 200
    assert steps[-1].discount == 0.0
    assert steps[-1].reward == 0.0
    assert steps[-1].observation["clearance"] == pytest.approx(0.0, abs=0.5)
    assert all(step.discount == 1.0 for step in steps[1:-1])
    assert steps[-2].observation["contact"].sum() == 0
    assert steps[-2].observation["margin"] == STICK_INSECT.lengths.no_foot_margin
    assert walking.step(ZEROS).first()


def test_the_end_of_the_time_keeps_the_discount():
    steps = episode(dm.load(actions="tips", duration=2.0), ZEROS)
    assert len(steps) - 1 == 20
    assert steps[-1].discount == 1.0
    assert all(0.0 <= step.reward <= 1.0 for step in steps[1:])


def test_a_leg_out_of_reach_keeps_its_angles_and_is_counted():
    walking = dm.load(actions="tips")
    substeps = Conditions().substeps(Stride())
    walking.reset()
    before = walking.physics.control().reshape(6, 3).copy()
    offsets = np.zeros((6, 3))
    offsets[4] = 5.0, 5.0, 5.0  # the middle leg of the right side, folded towards the body
    step = walking.step(offsets.ravel())
    assert step.observation["out_of_reach"].tolist() == [0, 0, 0, 0, substeps, 0]
    targets = walking.physics.control().reshape(6, 3)
    np.testing.assert_array_equal(targets[4], before[4])
    assert (targets[[0, 1, 2, 3, 5]] != before[[0, 1, 2, 3, 5]]).any(axis=1).all()
    assert walking.step(ZEROS).observation["out_of_reach"].sum() == 0


def test_offsets_move_the_feet():
    """Feet pushed down lift the body."""
    height = []
    for up in (0.0, -1.0):
        walking = dm.load(actions="tips")
        step = walking.reset()
        for _ in range(60):
            step = walking.step(np.tile([0.0, 0.0, up], 6))
        height.append(step.observation["clearance"])
    assert height[1] - height[0] == pytest.approx(1.0, abs=0.3)


def test_an_episode_ends_with_the_ground():
    walking = dm.load(conditions=Conditions(ground="gap", ground_length=4.0), actions="tips")
    walking.reset()
    assert walking.step(ZEROS).mid()
    walking.physics.data.qpos[1] = 1000.0
    step = walking.step(ZEROS)
    assert step.last()
    assert step.discount == 1.0


def test_divergence_raises():
    walking = dm.load(actions="tips")
    walking.reset()
    walking.physics.data.qvel[0] = np.nan
    with pytest.raises(control.PhysicsError):
        walking.step(ZEROS)
    assert walking.reset().first()
    assert walking.step(ZEROS).mid()


def test_no_step_follows_a_start_that_did_not_settle():
    walking = dm.load(actions="tips", conditions=Conditions(centre_of_mass=-8.0), seed=1)
    with pytest.raises(SimulationError, match="did not settle"):
        walking.reset()
    with pytest.raises(InputError, match="a reset that failed"):
        walking.step(ZEROS)
    assert walking.reset().first()
    assert walking.step(ZEROS).mid()


@pytest.mark.parametrize(
    "nonsense",
    [
        {"velocity": 1.5},
        {"velocity": 0.0},
        {"velocity": np.nan},
        {"actions": "foo"},
        {"duration": -1.0},
        {"duration": np.nan},
        {"seed": -1},
    ],
)
def test_nonsense_is_refused(nonsense: dict):
    (name,) = nonsense
    with pytest.raises(InputError, match=f"{name} = .*; (expected|valid)"):
        dm.load(**nonsense)


@pytest.mark.parametrize("action", [np.zeros(3), np.full(18, np.nan), np.full(18, 5.1)])
def test_nonsensical_actions_are_refused(action: np.ndarray):
    walking = dm.load(actions="tips")
    walking.reset()
    with pytest.raises(InputError, match="action"):
        walking.step(action)


@pytest.mark.parametrize("policy", [None, lambda step: ZEROS])
def test_the_viewers_runtime_runs_it(policy):
    """The viewer without its observation time: ticks, a pause, single steps, the end of an episode and a restart."""
    walking = dm.load(actions="tips", duration=5.0)
    runtime, errors = Runtime(walking, policy), []
    runtime.on_error += errors.append
    runtime.tick(0.02, paused=False)
    assert runtime.state is State.RUNNING
    assert runtime.get_time() == pytest.approx(0.02, abs=walking.control_timestep())
    now = runtime.get_time()
    runtime.tick(0.02, paused=True)
    assert runtime.get_time() == now
    runtime.single_step()
    assert runtime.get_time() == pytest.approx(now + walking.control_timestep())
    np.testing.assert_array_equal(runtime.last_action, ZEROS)
    for _ in range(4):
        runtime.tick(0.02, paused=False)
    assert runtime.state is State.STOPPED
    runtime.restart()
    runtime.tick(0.02, paused=False)
    assert runtime.state is State.RUNNING
    assert not errors


def test_the_suites_action_noise_wraps_it():
    plain, noisy = (dm.load(actions="tips", seed=3) for _ in range(2))
    wrapped = action_noise.Wrapper(noisy, scale=0.01)
    first = [one.reset().observation["tips"] for one in (plain, wrapped)]
    then = [one.step(ZEROS).observation["tips"] for one in (plain, wrapped)]
    assert np.array_equal(*first) and not np.array_equal(*then)


@drawing
def test_it_is_rendered():
    walking = dm.load()
    walking.reset()
    for camera in (-1, "side"):
        frame = walking.physics.render(48, 64, camera_id=camera)
        assert frame.shape == (48, 64, 3)
        assert frame.std() > 5
    walking.physics.free()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda walking: pickle.loads(pickle.dumps(walking))])
def test_an_environment_is_copied_before_its_first_reset_alone(copied):
    walking = dm.load(actions="tips")
    first = copied(walking).reset().observation
    for name, value in walking.reset().observation.items():
        np.testing.assert_array_equal(value, first[name])
    with pytest.raises(InputError, match="neither copied nor pickled"):
        copied(walking)
