"""The stick insect's anatomy: masses, symmetry, posture, joint ranges, names, and how it stands."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from compiled_bodies import at_home
from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import compile_body
from hexmj.body import JOINTS, PARTS, STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.legs import FIG1, LEGS, MIRROR

TRUNK = STICK_INSECT.trunk
LIFT = 12.0  # mm
MEASURED_RANGES = np.array(  # (segment, joint, 2) degrees, 2 to 98 % of the motion-captured animal
    [
        [[-9, 66], [-20, 29], [51, 145]],
        [[-43, 24], [-22, 24], [55, 163]],
        [[-62, -15], [-1, 45], [45, 164]],
    ]
)


@pytest.fixture(scope="module")
def insect() -> CompiledBody:
    return compile_body(Conditions())


@pytest.fixture(scope="module")
def model(insect: CompiledBody) -> mujoco.MjModel:
    return insect.model


@pytest.fixture
def home(insect: CompiledBody) -> mujoco.MjData:
    return at_home(insect)


@pytest.fixture(scope="module")
def standing(insect: CompiledBody, model: mujoco.MjModel) -> mujoco.MjData:
    """One second after it was put down in the home posture."""
    data = at_home(insect)
    mujoco.mj_step(model, data, nstep=round(1 / model.opt.timestep))
    mujoco.mj_forward(model, data)
    return data


def step_range_targets(count: int = 61) -> np.ndarray:
    """All tips that a walk may ask for, in the root frame, (x * z, leg, axis) [mm].

    Standing heights of 8 to 12 mm, feet lifted by up to 12 mm, and a body that sags by 1 mm.
    """
    x, z = np.meshgrid(np.linspace(-20.2, 10.2, count), np.linspace(-12.0, LIFT - 8.0 + 1.0, count))
    x, z = x.ravel()[:, None], z.ravel()[:, None]
    y = np.broadcast_to(FIG1.y, (x.size, 6))
    return np.stack([FIG1.origin + x, y, np.broadcast_to(z, y.shape)], axis=-1)


def test_only_the_abdomen_is_lighter_than_published(model: mujoco.MjModel):
    """Published split: mesothorax 20, metathorax 15, prothorax 3, head 3, all legs 10, abdomen 49."""
    mass = {name: model.body(name).mass[0] for name in TRUNK}
    unit = mass["mesothorax"] / 20
    legs = sum(model.body(f"{leg}_{part}").mass[0] for leg in LEGS for part in PARTS)
    assert mass["metathorax"] / unit == pytest.approx(15, rel=1e-3)
    assert mass["prothorax"] / unit == pytest.approx(3, rel=1e-3)
    assert mass["head"] / unit == pytest.approx(3, rel=1e-3)
    assert legs / unit == pytest.approx(10, rel=1e-3)
    assert mass["abdomen"] / unit < 49


def test_centre_of_mass_is_the_papers(home: mujoco.MjData):
    offset = home.body("mesothorax").subtree_com - home.body("mesothorax").xpos
    assert np.abs(offset[:2]).max() < 0.01


def test_left_and_right_are_mirror_images(model: mujoco.MjModel):
    for left, right in zip(LEGS[:3], LEGS[3:], strict=True):
        for part in PARTS:
            a, b = model.body(f"{left}_{part}"), model.body(f"{right}_{part}")
            assert_array_equal(a.mass, b.mass)
            assert_array_equal(a.inertia, b.inertia)
            assert_array_equal(a.ipos, b.ipos)
        for joint in JOINTS:
            a, b = model.joint(f"{left}_{joint}"), model.joint(f"{right}_{joint}")
            assert_array_equal(a.range, b.range)
    for name in TRUNK:
        assert model.body(name).ipos[1] == pytest.approx(0, abs=1e-12)


def test_the_part_of_the_trunk_that_touches_the_ground_is_known(insect: CompiledBody, home: mujoco.MjData):
    home.qpos[2] = 3.0  # abdomen and the metathorax's rear end: axes 1 mm above the ground
    mujoco.mj_forward(insect.model, home)
    touching = home.sensordata[insect.columns.trunk] > 0
    assert touching.tolist() == [False, False, False, True, True]


def test_every_target_of_the_step_range_is_reachable(insect: CompiledBody):
    _, reachable = insect.inverse(step_range_targets())
    assert reachable.all()


def test_joint_ranges_are_the_measured_ones_widened_only_as_needed(insect: CompiledBody):
    """By less than one degree more than the targets need; the MJCF has the table."""
    joints, _ = insect.inverse(step_range_targets())
    needed = np.degrees(np.stack([joints.min(axis=0), joints.max(axis=0)], axis=-1))  # (leg, joint, 2)
    measured = np.concatenate([MEASURED_RANGES, MEASURED_RANGES])
    low = np.minimum(measured[..., 0], np.floor(needed[..., 0]))
    high = np.maximum(measured[..., 1], np.ceil(needed[..., 1]))
    found = np.degrees(insect.model.jnt_range[1:]).reshape(6, 3, 2)
    assert_allclose(found, np.stack([low, high], axis=-1), atol=1e-9)


def test_the_feet_carry_the_weight(insect: CompiledBody, standing: mujoco.MjData):
    forces = standing.sensordata[insect.columns.touch]
    assert (forces > 0).all()
    assert forces.sum() == pytest.approx(insect.weight, rel=0.01)
    assert_allclose(forces, forces[list(MIRROR)], rtol=0.01)


def test_feet_do_not_sink_in_and_the_body_does_not_sag(standing: mujoco.MjData, home: mujoco.MjData):
    assert standing.warning.number.sum() == 0
    assert np.abs(standing.qvel).max() < 1
    assert standing.ncon == 6
    assert -0.2 < standing.contact.dist.min() < 0
    assert -1 < standing.qpos[2] - home.qpos[2] < 0


def test_looks_change_no_bit_of_a_walk(insect: CompiledBody):
    bare = compile_body(Conditions(), looks=False)
    assert bare.model.ngeom == 1 + len(TRUNK) + len(LEGS)
    seen = []
    for one in (insect, bare):
        data = at_home(one)
        data.ctrl[::3] += 0.3
        mujoco.mj_step(one.model, data, nstep=500)
        seen.append(data.qpos.copy())
    assert np.array_equal(*seen)


def test_feet_grasp_with_the_force_asked_for():
    grasping = compile_body(Conditions(grasp=2.0))
    assert grasping.model.nu == len(STICK_INSECT.joints) + 6
    assert_allclose(grasping.model.actuator_gainprm[grasping.columns.grasp, 0], 2.0 * 9810.0)
