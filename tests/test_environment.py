"""The dm_env interface: its contract, physical walks bit for bit, observations, rewards and ends."""

import unittest
from typing import Any

import numpy as np
import pytest
from dm_control.suite.wrappers import action_noise
from dm_control.viewer.runtime import Runtime, State
from dm_env.test_utils import EnvironmentTestMixin

from drawing import drawing
from episodes import KINDS, ZEROS, episode
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import HWS, LDVS
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller
from hexmj.environments import dm
from hexmj.environments.task import end_step
from hexmj.errors import InputError, SimulationError
from hexmj.legs import CENTRED, FIG1, LEGS
from hexmj.measures.physical import physical_walk
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride


class _Contract(EnvironmentTestMixin):
    """dm_env's own checks; the actions continue beyond the end of an episode."""

    def make_action_sequence(self):
        for _ in range(30):
            yield self.make_action()


class TestJointsContract(_Contract, unittest.TestCase):
    def make_object_under_test(self):
        return dm.load(actions="joints", duration=2.0)


class TestTipsContract(_Contract, unittest.TestCase):
    def make_object_under_test(self):
        return dm.load(actions="tips", duration=2.0)


@pytest.mark.parametrize("velocity", [0.3, 0.5])
def test_zero_offsets_are_the_physical_walk_bit_for_bit(velocity: float):
    """Until the end, or the fall, which is seen at the end of its step; contacts and margins agree too."""
    starts, duration = draw_starts(2, 0), 100.0
    walked = physical_walk(starts, LDVS, velocity, duration)
    settled, m = settle(starts), Conditions().substeps(Stride())
    standing = np.zeros((2, 1000 * m + 1, 6), dtype=bool)
    for chunk in drive(settled, begin(LDVS, settled.starts, velocity, settled.stride), duration):
        standing[chunk.ids, chunk.first : chunk.first + chunk.standing.shape[1]] = chunk.standing
    margins = walk_margin(walked.measured)
    walking = dm.load(velocity, actions="tips", duration=duration)
    for start in range(2):
        qpos, seen = [], []
        step = walking.reset()
        while not step.last():
            step = walking.step(ZEROS)
            qpos.append(walking.physics.position())
            seen.append(step.observation)
        count = len(qpos) - int(step.discount == 0)
        np.testing.assert_array_equal(qpos[:count], walked.qpos[:count, start])
        planned = walked.planned
        np.testing.assert_array_equal([o["planned_stance"] for o in seen], planned.stance[: len(seen), start])
        tips = np.array([o["planned_tips"] for o in seen])
        np.testing.assert_allclose(tips[..., :2], planned.feet[: len(seen), start], rtol=0, atol=1e-12)
        contact = np.array([o["contact"] for o in seen])[:count]
        np.testing.assert_array_equal(contact, standing[start, m - 1 : m * count : m])
        same = (contact == walked.measured.stance[:count, start]).all(axis=1)
        assert same.mean() > 0.95
        margin = np.array([o["margin"][0] for o in seen])[:count]
        np.testing.assert_allclose(margin[same], margins[:count, start][same], rtol=0, atol=1e-9)
        assert sum(o["out_of_reach"].sum() for o in seen) == walked.outcomes.unreachable[start]
        fall = walked.outcomes.fall[start]
        assert step.discount == float(np.isinf(fall))
        assert len(qpos) == (1000 if np.isinf(fall) else np.ceil(fall / Stride().dt - 1e-6))
    assert np.isinf(walked.outcomes.fall).all() == (velocity == 0.3)


@pytest.mark.parametrize(
    ("controller", "conditions", "stride"),
    [
        (HWS, Conditions(vp=200.0, friction=0.5), Stride()),
        (HWS, Conditions(vp=40.0, standing_height=12.0), Stride(dt=0.5, geometry=CENTRED)),
        (SensoryFeedback(LDVS), Conditions(), Stride()),
        (SensoryFeedback(HWS), Conditions(vp=160.0, grasp=0.5, load=0.5), Stride(dt=0.2)),
    ],
    ids=["slippery", "slow and centred", "sensory feedback", "sensory feedback, loaded"],
)
def test_other_controllers_and_conditions_are_the_physical_walk(
    controller: Controller, conditions: Conditions, stride: Stride
):
    walked = physical_walk(draw_starts(1, 7, stride), controller, 0.3, 40.0, conditions=conditions, stride=stride)
    walking = dm.load(
        0.3, actions="tips", controller=controller, conditions=conditions, stride=stride, duration=40.0, seed=7
    )
    step, qpos = walking.reset(), []
    while not step.last():
        step = walking.step(ZEROS)
        qpos.append(walking.physics.position())
    assert np.isinf(walked.outcomes.fall[0])
    np.testing.assert_array_equal(qpos, walked.qpos[:, 0])
    assert len(qpos) == round(40.0 / stride.dt)


@KINDS
def test_same_seed_same_bits(actions):
    def episodes(seed: int) -> list[np.ndarray]:
        walking = dm.load(actions=actions, duration=3.0, seed=seed)
        bits = []
        for _ in range(2):
            action = ZEROS if actions == "tips" else walking.reset().observation["joint_angles"]
            bits += [value for step in episode(walking, action) for value in step.observation.values()]
        return bits

    first, second, other = episodes(3), episodes(3), episodes(4)
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))


def test_episodes_take_the_drawn_starts_in_order():
    walking = dm.load(seed=5)
    tips = np.array([walking.reset().observation["planned_tips"] for _ in range(18)])
    np.testing.assert_allclose(tips[..., 0] - FIG1.origin, draw_starts(18, 5), atol=1e-12)


@KINDS
def test_specs_fit_actions_and_observations(actions):
    walking = dm.load(actions=actions)
    action, observations = walking.action_spec(), walking.observation_spec()
    assert np.isfinite(action.minimum).all() and (action.minimum < action.maximum).all()
    assert list(observations) == list(walking.reset().observation)
    assert all(spec.name == name for name, spec in observations.items())


def test_joint_actions_are_the_actuators_targets_in_their_order():
    walking = dm.load(actions="joints")
    model, spec = walking.physics.model, walking.action_spec()
    np.testing.assert_array_equal(np.stack([spec.minimum, spec.maximum], axis=1), model.actuator_ctrlrange)
    action = walking.reset().observation["joint_angles"] + 0.01
    walking.step(action)
    np.testing.assert_array_equal(walking.physics.control(), action)
    walking.step(spec.maximum.astype(np.float32))


def test_physics_has_names_and_carries_the_weight():
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


def test_clearance_at_home_is_that_of_the_metathorax():
    walking = dm.load()
    walking.reset()
    walking.physics.reset(walking.physics.model.name2id("home", "key"))
    assert walking._walkers.observations(0)["clearance"] == pytest.approx(10.4 - 2.0 - 1.6)


def test_the_margin_without_contact_is_below_every_margin_with_one_foot():
    """At any reach of the legs."""
    walking = dm.load()
    walking.reset()
    walkers: Any = walking._walkers

    def margin(standing: np.ndarray) -> float:
        walkers._senses.standing = lambda: standing[np.newaxis]
        return walkers.observations(0)["margin"][0]

    single = [margin(row) for row in np.eye(6, dtype=bool)]
    assert margin(np.zeros(6, dtype=bool)) == STICK_INSECT.lengths.no_foot_margin < min(single) < 0
    legs: Any = walking.compiled.kinematics
    reach = np.linalg.norm(legs.coxa_position[:, :2], axis=1) + legs.coxa + legs.femur + legs.tibia
    farthest = STICK_INSECT.lengths.farthest_centre_of_mass
    assert reach.max() + farthest < -STICK_INSECT.lengths.no_foot_margin


@pytest.mark.parametrize(
    ("speed", "roll", "reward"),
    [(1, 0, 1), (0, 0, 0), (0.5, 0, 0.5), (1.5, 0, 0.5), (2, 0, 0), (3, 0, 0), (-1, 0, 0), (1, 60, 0.5), (1, 90, 0),
     (1, 180, 0)],
)  # fmt: skip
def test_reward_is_its_formula(speed: float, roll: float, reward: float):
    rotation = np.diag([1.0, 1.0, np.cos(np.radians(roll))])[np.newaxis]
    state = np.zeros((1, 7)), np.full((1, 6), 20.0 * speed), rotation, np.zeros((1, 1))
    result = np.zeros(1), np.zeros(1, dtype=bool), np.zeros(1, dtype=bool)
    end_step(np.arange(1), np.zeros((1, 2, 1)), state, (0, 1), 20.0, (np.zeros(1, dtype=int), 9), result)
    assert result[0] == pytest.approx(reward, abs=1e-12) and not result[1]


def test_a_fall_ends_the_episode_with_discount_zero():
    walking = dm.load(actions="joints")
    spec = walking.action_spec()
    folded = 0.5 * (spec.minimum + spec.maximum).reshape(6, 3)
    folded[:, 1] = spec.maximum.reshape(6, 3)[:, 1]  # pulls all feet up to the body
    steps = episode(walking, folded.ravel())
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


def test_an_episode_ends_with_the_ground():
    walking = dm.load(conditions=Conditions(ground="gap", ground_length=4.0), actions="tips")
    walking.reset()
    assert walking.step(ZEROS).mid()
    walking.physics.data.qpos[1] = 1000.0
    step = walking.step(ZEROS)
    assert step.last() and step.discount == 1.0


def test_a_leg_out_of_reach_keeps_its_angles_and_is_counted():
    walking = dm.load(actions="tips")
    substeps = Conditions().substeps(Stride())
    walking.reset()
    before = walking.physics.control().reshape(6, 3).copy()
    offsets = np.zeros((6, 3))
    offsets[4] = 5.0, 5.0, 5.0  # the right middle leg, folded towards the body
    step = walking.step(offsets.ravel())
    assert step.observation["out_of_reach"].tolist() == [0, 0, 0, 0, substeps, 0]
    targets = walking.physics.control().reshape(6, 3)
    np.testing.assert_array_equal(targets[4], before[4])
    assert (targets[[0, 1, 2, 3, 5]] != before[[0, 1, 2, 3, 5]]).any(axis=1).all()
    assert walking.step(ZEROS).observation["out_of_reach"].sum() == 0


def test_feet_pushed_down_lift_the_body():
    height = []
    for up in (0.0, -1.0):
        walking = dm.load(actions="tips")
        step = walking.reset()
        for _ in range(60):
            step = walking.step(np.tile([0.0, 0.0, up], 6))
        height.append(step.observation["clearance"])
    assert height[1] - height[0] == pytest.approx(1.0, abs=0.3)


def test_after_a_divergence_or_a_start_that_does_not_settle_an_episode_begins():
    walking = dm.load(actions="tips")
    walking.reset()
    walking.physics.data.qvel[0] = np.nan
    with pytest.raises(SimulationError):
        walking.step(ZEROS)
    assert walking.reset().first()
    assert walking.step(ZEROS).mid()
    walking = dm.load(actions="tips", conditions=Conditions(centre_of_mass=-8.0), seed=1)
    with pytest.raises(SimulationError):
        walking.reset()
    assert walking.step(ZEROS).first()
    assert walking.step(ZEROS).mid()


@pytest.mark.parametrize(("name", "value"), [("velocity", np.nan), ("duration", -1.0), ("seed", -1)])
def test_bad_settings_are_refused(name: str, value: Any):
    with pytest.raises(InputError, match=name):
        dm.load(**{name: value})


def test_the_viewers_runtime_runs_it():
    """Ticks, a pause, a single step, the end of an episode and a restart."""
    walking, errors = dm.load(actions="tips", duration=5.0), []
    runtime = Runtime(walking, lambda step: ZEROS)
    runtime.on_error += errors.append
    for paused, state in ((False, State.RUNNING), (True, State.RUNNING)):
        runtime.tick(0.02, paused=paused)
        assert runtime.state is state
    now = runtime.get_time()
    runtime.single_step()
    assert runtime.get_time() == pytest.approx(now + walking.control_timestep())
    for _ in range(4):
        runtime.tick(0.02, paused=False)
    assert runtime.state is State.STOPPED
    runtime.restart()
    runtime.tick(0.02, paused=False)
    assert runtime.state is State.RUNNING and not errors


def test_the_suites_action_noise_wraps_it():
    plain, noisy = (dm.load(actions="tips", seed=3) for _ in range(2))
    both = plain, action_noise.Wrapper(noisy, scale=0.01)
    first = [walking.reset().observation["tips"] for walking in both]
    then = [walking.step(ZEROS).observation["tips"] for walking in both]
    assert np.array_equal(*first) and not np.array_equal(*then)


@drawing
def test_it_is_rendered():
    walking = dm.load()
    walking.reset()
    for camera in (-1, "side"):
        frame = walking.physics.render(48, 64, camera_id=camera)
        assert frame.shape == (48, 64, 3) and frame.std() > 5
    walking.physics.free()
