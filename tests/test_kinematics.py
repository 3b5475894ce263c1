"""Inverse and forward kinematics against each other and against MuJoCo's own."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from hexmj.legs import FIG1, LEGS, MIRROR
from hexmj.physics import insect
from hexmj.physics.kinematics import joints_to_tips, tips_to_joints

MODEL = insect.load()
DIMENSIONS = insect.dimensions(MODEL)
ORIGIN = np.stack([FIG1.origin, FIG1.y, np.zeros(6)], axis=-1)  # (leg, axis)


def random_targets(count: int) -> np.ndarray:
    """Tips around the step range, (count, leg, axis) [mm]."""
    rng = np.random.default_rng(1998)
    return ORIGIN + rng.uniform([-20, -3, -12], [10, 3, 5], (count, 6, 3))


def random_joints(count: int) -> np.ndarray:
    """Angles within the joints' ranges, (count, leg, joint) [rad]."""
    low, high = np.moveaxis(DIMENSIONS.joint_range, -1, 0)
    return np.random.default_rng(1998).uniform(low, high, (count, 6, 3))


def mujoco_tips(joints: np.ndarray) -> np.ndarray:
    """Tips in the root frame by MuJoCo's forward kinematics, (leg, axis) [mm], with the root tilted."""
    data = mujoco.MjData(MODEL)
    data.qpos[: insect.ROOT_QPOS] = [3, -2, 15, 0.8, 0.36, 0, 0.48]
    data.qpos[insect.ROOT_QPOS :] = joints.ravel()
    mujoco.mj_kinematics(MODEL, data)
    tips = np.array([data.site(f"{leg}_foot").xpos for leg in LEGS])
    root = data.body("mesothorax")
    return (tips - root.xpos) @ root.xmat.reshape(3, 3)


def test_mujoco_puts_the_tips_where_the_joint_angles_say():
    for joints in random_joints(50):
        np.testing.assert_allclose(joints_to_tips(joints, DIMENSIONS), mujoco_tips(joints), atol=1e-9)


def test_mujoco_puts_the_tips_where_they_are_wanted():
    targets = random_targets(200)
    joints, reachable = tips_to_joints(targets, DIMENSIONS)
    assert reachable.mean() > 0.9
    for angles, target, ok in zip(joints, targets, reachable, strict=True):
        if ok.all():
            np.testing.assert_allclose(mujoco_tips(angles), target, atol=1e-6)


def test_forward_after_inverse_is_the_identity():
    targets = random_targets(10_000)
    joints, reachable = tips_to_joints(targets, DIMENSIONS)
    np.testing.assert_allclose(joints_to_tips(joints, DIMENSIONS)[reachable], targets[reachable], atol=1e-9)


def test_inverse_after_forward_is_the_identity():
    joints = random_joints(10_000)
    tips = joints_to_tips(joints, DIMENSIONS)
    back, reachable = tips_to_joints(tips, DIMENSIONS)
    # A tip beyond its own thorax-coxa axis belongs to another protraction, on the leg's own side.
    forward, left, _ = np.moveaxis(tips - DIMENSIONS.coxa_position, -1, 0)
    protraction = joints[..., 0]
    outward = forward * np.sin(protraction) + DIMENSIONS.side * left * np.cos(protraction) > 1e-6
    assert outward.mean() > 0.9
    assert reachable[outward].all()
    np.testing.assert_allclose(back[outward], joints[outward], atol=1e-9)


def test_unreachable_tips_are_flagged_and_have_no_angles():
    targets = ORIGIN - [0, 0, 10.0]
    targets[0] += [0, 60, 0]  # longer than the leg
    targets[2] = DIMENSIONS.coxa_position[2] + [0, 2, 0]  # closer than femur and tibia can fold
    targets[4] += [40, 0, 0]
    targets[5] = np.nan
    joints, reachable = tips_to_joints(targets, DIMENSIONS)
    assert reachable.tolist() == [False, True, False, True, False, False]
    assert np.isnan(joints[~reachable]).all()
    assert np.isfinite(joints[reachable]).all()


def test_joint_ranges_bound_what_is_reachable():
    home = ORIGIN - [0, 0, 10.0]
    angles, _ = tips_to_joints(home, DIMENSIONS)
    for joint in range(3):
        for bound, outside in ((0, 1e-6), (1, -1e-6)):
            joint_range = DIMENSIONS.joint_range.copy()
            joint_range[3, joint, bound] = angles[3, joint] + outside
            _, reachable = tips_to_joints(home, replace(DIMENSIONS, joint_range=joint_range))
            assert reachable.tolist() == [True, True, True, False, True, True]


def test_mirrored_tips_have_equal_angles():
    targets = random_targets(1000)
    mirrored = targets[:, MIRROR] * [1, -1, 1]
    joints, reachable = tips_to_joints(targets, DIMENSIONS)
    other, other_reachable = tips_to_joints(mirrored, DIMENSIONS)
    np.testing.assert_array_equal(other, joints[:, MIRROR])
    np.testing.assert_array_equal(other_reachable, reachable[:, MIRROR])


@pytest.mark.parametrize("shape", [(), (4,), (2, 3), (0,)])
def test_leading_axes_are_free_and_the_input_stays(shape: tuple[int, ...]):
    targets = np.broadcast_to(ORIGIN - [0, 0, 10.0], (*shape, 6, 3)).copy()
    before = targets.copy()
    joints, reachable = tips_to_joints(targets, DIMENSIONS)
    assert joints.shape == (*shape, 6, 3)
    assert reachable.shape == (*shape, 6)
    assert joints_to_tips(joints, DIMENSIONS).shape == (*shape, 6, 3)
    np.testing.assert_array_equal(targets, before)
