"""Kinematics in closed form against MuJoCo's own; the numeric ones equal to it, and right for any chain of hinges."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize

from hexmj.bodies.kinematics import HingeChains, ThreeHinges, hinge_chains, kinematics
from hexmj.bodies.mjcf import plain_model
from hexmj.body import ROOT_QPOS, STICK_INSECT, Body
from hexmj.legs import FIG1, LEGS, MIRROR
from other_bodies import any_hexapod

ORIGIN = np.stack([FIG1.origin, FIG1.y, np.zeros(6)], axis=-1)  # (leg, axis)


@pytest.fixture(scope="module")
def closed() -> ThreeHinges:
    """The closed form of the stick insect."""
    found = kinematics(plain_model(STICK_INSECT), STICK_INSECT)
    assert isinstance(found, ThreeHinges)
    return found


@pytest.fixture(scope="module")
def numeric() -> HingeChains:
    """The stick insect's legs as chains."""
    return hinge_chains(plain_model(STICK_INSECT), STICK_INSECT)


@pytest.fixture(scope="module", params=[(3, 0), (3, 1), (4, 2), (5, 3)], ids="{0[0]} hinges, seed {0[1]}".format)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Body:
    """A body with hinges about any axes."""
    return any_hexapod(tmp_path_factory.mktemp("body"), *request.param)


def step_range(count: int = 41) -> np.ndarray:
    """All tips that a walk may ask for, (x * z, leg, axis) [mm]: standing heights 8 to 14, lifts of 12, a sag of 1."""
    x, z = (grid.ravel()[:, None] for grid in np.meshgrid(np.linspace(-20.2, 10.2, count), np.linspace(-14, 5, count)))
    return ORIGIN + np.stack(np.broadcast_arrays(x, 0.0, z + np.zeros(6)), axis=-1)


def random_joints(chains: HingeChains, count: int, share: float = 1.0) -> np.ndarray:
    """Angles within a share of the ranges around home, (count, leg, joint) [rad]."""
    low, high = (chains.home + share * (limit - chains.home) for limit in (chains.low, chains.high))
    return np.random.default_rng(1998).uniform(low, high, (count, *low.shape))


@pytest.mark.slow
def test_it_is_the_closed_form_over_the_whole_step_range(closed: ThreeHinges, numeric: HingeChains):
    tips = step_range()
    for wanted, found in zip(closed.inverse(tips), numeric.inverse(tips), strict=True):
        assert_allclose(found, wanted, rtol=0, atol=1e-9)


def test_the_result_depends_on_nothing_but_the_tip(numeric: HingeChains):
    tips = ORIGIN + np.random.default_rng(1).uniform([-20, -3, -12], [10, 3, 5], (200, 6, 3))
    joints, reachable = numeric.inverse(tips)
    shuffled = np.random.default_rng(2).permutation(len(tips))
    assert_array_equal(numeric.inverse(tips[shuffled])[0], joints[shuffled])
    for one, wanted, ok in zip(tips, joints, reachable, strict=True):
        assert_array_equal(numeric.inverse(one)[0], wanted)
        assert_array_equal(numeric.inverse(one)[1], ok)


@pytest.fixture(params=["closed", "numeric"])
def legs(request: pytest.FixtureRequest) -> ThreeHinges | HingeChains:
    """The stick insect's legs either way."""
    return request.getfixturevalue(request.param)


def test_unreachable_tips_are_flagged_and_have_no_angles(legs: ThreeHinges | HingeChains):
    tips = ORIGIN - [0, 0, 10.0]
    tips[0] += [0, 60, 0]  # longer than the leg
    tips[2] = [-8, 3.5, -2]  # closer than femur and tibia can fold
    tips[4] += [30, 0, 0]
    tips[5] = np.nan
    joints, reachable = legs.inverse(tips)
    assert reachable.tolist() == [False, True, False, True, False, False]
    assert np.isnan(joints[~reachable]).all() and np.isfinite(joints[reachable]).all()


@pytest.mark.parametrize(("joint", "bound"), [(joint, bound) for joint in range(3) for bound in range(2)])
def test_joint_ranges_bound_what_is_reachable(
    closed: ThreeHinges, legs: ThreeHinges | HingeChains, joint: int, bound: int
):
    for beyond, within in ((-1e-8, True), (1e-8, False)):
        joints = closed.joint_range.mean(axis=-1)
        joints[:, joint] = closed.joint_range[:, joint, bound] + (beyond if bound else -beyond)
        found, reachable = legs.inverse(closed.forward(joints))
        assert (reachable == within).all()
        if within:
            assert_allclose(found, joints, atol=1e-9)


def test_only_legs_that_fit_the_closed_form_have_it(made: Body):
    assert isinstance(kinematics(plain_model(made), made), HingeChains)


def test_mirrored_tips_have_equal_angles(closed: ThreeHinges):
    """To the last bit; the numeric ones' axes are mirrored, their angles are rounded otherwise."""
    tips = ORIGIN + np.random.default_rng(1998).uniform([-20, -3, -12], [10, 3, 5], (1000, 6, 3))
    for one, other in zip(closed.inverse(tips), closed.inverse(tips[:, MIRROR] * [1, -1, 1]), strict=True):
        assert_array_equal(other, one[:, MIRROR])


def test_the_closed_form_s_inverse_and_forward_are_each_others(closed: ThreeHinges, numeric: HingeChains):
    joints = random_joints(numeric, 10_000)
    tips = closed.forward(joints)
    back, reachable = closed.inverse(tips)
    # A tip beyond its own thorax-coxa axis belongs to another protraction, on the leg's own side.
    forward, left, _ = np.moveaxis(tips - closed.coxa_position, -1, 0)
    outward = forward * np.sin(joints[..., 0]) + closed.side * left * np.cos(joints[..., 0]) > 1e-6
    assert outward.mean() > 0.9
    assert reachable[outward].all()
    assert_allclose(back[outward], joints[outward], atol=1e-9)


def tips_in_mujoco(model: mujoco.MjModel, body: Body, joints: np.ndarray) -> np.ndarray:
    """In the root frame by MuJoCo's forward kinematics, (leg, axis) [mm], with the root tilted."""
    data = mujoco.MjData(model)
    data.qpos[:ROOT_QPOS] = 3, -2, 15, 0.8, 0.36, 0, 0.48
    data.qpos[ROOT_QPOS:] = joints.ravel()
    mujoco.mj_kinematics(model, data)
    root = data.body(body.root)
    return (np.array([data.site(foot).xpos for foot in body.feet]) - root.xpos) @ root.xmat.reshape(3, 3)


def test_mujoco_puts_the_insects_feet_where_they_are_wanted(legs: ThreeHinges | HingeChains, numeric: HingeChains):
    model = plain_model(STICK_INSECT)
    for joints in random_joints(numeric, 50):
        assert_allclose(legs.forward(joints), tips_in_mujoco(model, STICK_INSECT, joints), atol=1e-9)
    tips = ORIGIN + np.random.default_rng(1998).uniform([-20, -3, -12], [10, 3, 5], (200, 6, 3))
    found, reachable = legs.inverse(tips)
    whole = reachable.all(axis=1)
    assert whole.mean() > 0.5
    for joints, wanted in zip(found[whole], tips[whole], strict=True):
        assert_allclose(tips_in_mujoco(model, STICK_INSECT, joints), wanted, atol=1e-6)


def test_mujoco_puts_the_feet_where_the_chains_do(made: Body):
    model = plain_model(made)
    chains = hinge_chains(model, made)
    for joints in random_joints(chains, 50):
        assert_allclose(chains.forward(joints), tips_in_mujoco(model, made, joints), atol=1e-9)


def test_any_chain_reaches_its_tips(made: Body):
    """All around home; at the ends of the ranges a few are missed, where a chain is all but singular."""
    chains = hinge_chains(plain_model(made), made)
    for share, reached_at_least in ((0.4, 1.0), (1.0, 0.99)):
        tips = chains.forward(random_joints(chains, 2000, share))
        joints, reachable = chains.inverse(tips)
        assert reachable.mean() >= reached_at_least
        assert_allclose(chains.forward(joints)[reachable], tips[reachable], rtol=0, atol=1e-9)
        assert ((chains.low <= joints) & (joints <= chains.high))[reachable].all()


def test_more_than_three_hinges_stay_near_home(tmp_path: Path):
    """No posture close by reaches the tip and is nearer to home, as SciPy looks for one."""
    body = any_hexapod(tmp_path, 5, 4)
    chains = hinge_chains(plain_model(body), body)
    tips = chains.forward(random_joints(chains, 3, 0.5))
    joints, reachable = chains.inverse(tips)
    assert reachable.all()
    for tip, found in zip(tips, joints, strict=True):
        for leg in range(len(LEGS)):

            def missed(angles: np.ndarray, leg: int = leg, tip: np.ndarray = tip, found: np.ndarray = found):
                posture = found.copy()
                posture[leg] = angles
                return chains.forward(posture)[leg] - tip[leg]

            def from_home(angles: np.ndarray, leg: int = leg):
                return ((angles - chains.home[leg]) ** 2).sum()

            how = {"bounds": np.stack([chains.low[leg], chains.high[leg]], axis=-1), "options": {"ftol": 1e-14}}
            there = {"type": "eq", "fun": missed}
            nearest = minimize(from_home, found[leg], method="SLSQP", constraints=there, **how)
            if np.linalg.norm(missed(nearest.x)) < 1e-6:
                assert from_home(found[leg]) <= from_home(nearest.x) + 1e-6
