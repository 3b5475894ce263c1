"""What is compiled from the stick insect's description: gains, home, columns, masses and grounds."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from compiled_bodies import at_home, changed_body, conditions, differences
from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import depth_in_ground, ground_level
from hexmj.bodies.kinematics import ThreeHinges
from hexmj.bodies.mjcf import compile_body, gains, plain_model
from hexmj.body import ROOT_QPOS, STICK_INSECT, Servo
from hexmj.legs import FIG1
from other_bodies import found


@pytest.fixture(scope="module")
def insect() -> CompiledBody:
    """The stick insect as usual."""
    return compile_body(conditions())


def test_the_mjcf_by_itself_is_the_body(insect: CompiledBody):
    """Gains computed are those written, and nothing is added."""
    assert differences(insect.model, mujoco.MjModel.from_xml_string(STICK_INSECT.mjcf.read_text())) == []


def test_gains_are_computed_from_mass_lengths_and_time_step():
    model = plain_model(STICK_INSECT)
    found = gains(model, STICK_INSECT)
    assert found == (4e5, 1.5e6)
    lever = 18.26 + 22.385  # a front leg's femur and tibia
    assert gains(model, replace(STICK_INSECT, servo=Servo(digits=15)))[0] == pytest.approx(9810.0 * lever)
    knees = model.dof_M0[model.joint("R3_femur_tibia").dofadr[0]], model.dof_M0[model.joint("L3_femur_tibia").dofadr[0]]
    assert_allclose(knees, 1.6, atol=0.05)


@pytest.mark.parametrize("step", [0.0005, 0.001, 0.002])
def test_gains_follow_weight_and_time_step(step: float):
    model, precise = plain_model(STICK_INSECT), Servo(step=step, damping_ratio=0.5, digits=15)
    torque, stiffness = gains(model, replace(STICK_INSECT, servo=precise))
    assert gains(model, replace(STICK_INSECT, servo=precise, mass=2.0))[0] == pytest.approx(2.0 * torque, rel=1e-12)
    knees = model.dof_M0[ROOT_QPOS - 1 + 2 :: 3]
    assert np.mean(stiffness / knees) * step**2 == pytest.approx(1.0)


def test_home_puts_the_tips_on_the_lines(insect: CompiledBody):
    joints = insect.home[insect.columns.qpos].reshape(6, -1)
    tips = insect.forward(joints)
    assert STICK_INSECT.lines == FIG1
    assert_allclose(tips, np.stack([FIG1.origin, FIG1.y, 6 * [-STICK_INSECT.standing_height]], axis=-1), atol=1e-6)
    assert insect.home[2] == pytest.approx(STICK_INSECT.standing_height + insect.foot_radius)
    assert_allclose(insect.inverse(tips)[0], joints, atol=1e-9)


def test_its_mass_and_its_shortest_leg_are_as_described(insect: CompiledBody):
    assert insect.model.body_mass.sum() == pytest.approx(STICK_INSECT.mass, rel=1e-4)
    assert insect.weight == 9810.0
    assert isinstance(insect.kinematics, ThreeHinges)
    legs = insect.kinematics.coxa + insect.kinematics.femur + insect.kinematics.tibia
    assert legs.min() == pytest.approx(STICK_INSECT.lengths.shortest_leg, abs=0.5)


def test_columns_are_where_their_names_say(insect: CompiledBody):
    data, columns = at_home(insect), insect.columns
    feet = [data.site(foot).xpos for foot in STICK_INSECT.feet]
    assert_array_equal(data.sensordata[columns.foot].reshape(6, 3), feet)
    assert_array_equal(data.sensordata[columns.centre_of_mass], data.body(STICK_INSECT.root).subtree_com)
    assert data.sensordata[columns.touch].shape == (6,)
    assert data.sensordata[columns.trunk].shape == (len(STICK_INSECT.trunk),)
    for i, joint in enumerate(STICK_INSECT.joints):
        assert data.joint(joint).qpos[0] == data.qpos[columns.qpos][i] == data.ctrl[columns.ctrl][i]
    assert data.ctrl[columns.grasp].size == 0
    assert compile_body(conditions(grasp=1.0)).columns.grasp == slice(18, 24)


def test_every_call_gives_a_model_of_its_own():
    asked = conditions(friction=0.3)
    first, second = compile_body(asked, 0.0005), compile_body(asked)
    first.model.pair_friction[:] = 7.0
    assert (first.model.opt.timestep, second.model.opt.timestep) == (0.0005, STICK_INSECT.longest_step)
    assert set(second.model.pair_friction[:, :2].flat) == {0.3}
    assert first.conditions is asked and first.body is STICK_INSECT


@pytest.mark.parametrize("x", [-9.4, 0.0, 5.0])
@pytest.mark.parametrize("masses", [{}, {"leg_mass": 0.01}, {"load": 1.0}], ids=str)
def test_masses_are_where_they_are_asked_for(insect: CompiledBody, masses: dict[str, Any], x: float):
    changed = compile_body(conditions(centre_of_mass=x, **masses))
    data = at_home(changed)
    centre = data.subtree_com[changed.root] - data.qpos[:3]
    assert_allclose(centre[:2], [x, 0.0], atol=0.03 if x == 0.0 else 1e-6)
    assert_allclose(changed.model.body_mass.sum(), 1.0 + masses.get("load", 0.0), rtol=1e-5)
    legs = [changed.model.body(part).id for leg in STICK_INSECT.legs for part in leg.parts]
    assert_allclose(changed.model.body_mass[legs], masses.get("leg_mass", 1.0) * insect.model.body_mass[legs])
    assert changed.weight == insect.weight


def test_conditions_change_only_what_they_are_about(insect: CompiledBody):
    slippery = compile_body(conditions(friction=0.2))
    assert differences(slippery.model, insect.model) == ["pair_friction"]
    light = set(differences(compile_body(conditions(leg_mass=0.5)).model, insect.model))
    assert {"body_mass", "body_inertia"} <= light
    assert not {name for name in light if name.startswith(("jnt", "geom_pos", "pair", "qpos", "key", "opt", "sensor"))}


@pytest.mark.parametrize(("ground", "pieces"), [("step", 2), ("gap", 3), ("hurdle", 2), ("rough", 136)])
def test_all_ground_is_touched_alike(tmp_path: Path, ground: str, pieces: int):
    """Feet and trunk each touch every piece, by the contact settings of their own pair with the plane."""
    own = 'name="L1_foot" condim="6" friction="1 1 20 2 2" solimp="0.9 0.95" solref="0.002 1"'
    body = changed_body(tmp_path, {'<pair name="L1_foot"': f"<pair {own}"})
    flat, model = compile_body(conditions(body)).model, compile_body(conditions(body, ground=ground)).model
    assert flat.npair == 11
    assert model.npair == pieces * 11
    for name in ("dim", "solref", "solreffriction", "solimp", "margin", "gap", "friction"):
        plane, values = getattr(flat, f"pair_{name}"), getattr(model, f"pair_{name}")
        alike = dict(zip(flat.pair_geom2, plane.tolist(), strict=True))  # the plane is geom1
        assert_array_equal(values, [alike[touching] for touching in model.pair_geom2 - (model.ngeom - flat.ngeom)])


@pytest.mark.parametrize("ground", ["flat", "step", "gap", "hurdle", "rough"])
def test_the_ground_s_level_is_where_depth_begins(ground: str):
    """Of points, between edges; `test_strikes` holds the depth against MuJoCo's contacts."""
    places = np.random.default_rng(0).uniform((40.0, -30.0), (80.0, 30.0), (500, 2))
    ahead = conditions(ground=ground)
    level = ground_level(ahead, places)
    assert (len(set(level)) > 1) == (ground != "flat")
    on_it = np.concatenate([places, level[:, None]], axis=1)
    assert_allclose(depth_in_ground(ahead, on_it, 0.0), 0.0, atol=1e-9)
    assert (depth_in_ground(ahead, on_it + np.array([0.0, 0.0, 0.5]), 0.0) < 0).all()


def test_what_an_mjcf_lacks_is_added(insect: CompiledBody, tmp_path: Path):
    """Without servos, sensors and pairs the insect compiles to the same, but for the keyframe's targets."""
    tree = ElementTree.fromstring(STICK_INSECT.mjcf.read_text())
    for section in ("actuator", "sensor", "contact"):
        tree.remove(found(tree, section))
    del found(tree, "keyframe/key").attrib["ctrl"]
    file = tmp_path / "bare.xml"
    file.write_text(ElementTree.tostring(tree, encoding="unicode"))
    bare = compile_body(conditions(replace(STICK_INSECT, mjcf=file)))
    assert plain_model(bare.body).nu == 0
    assert differences(bare.model, insect.model) == ["key_ctrl"]
    assert bare.columns == insect.columns


UNLISTED = {"\n  <contact>\n": "\n  <!--\n", "  </contact>\n": "  -->\n"}


@pytest.mark.parametrize(
    ("changes", "under"),
    [
        (UNLISTED | {'solref="0.00125 1" ': ""}, {"ground": "step"}),
        ({'<position name="L1_thorax_coxa"': '<intvelocity name="L1_thorax_coxa" actrange="0 1"'}, {}),
        ({' integrator="implicitfast"': ""}, {}),
    ],
)
def test_other_servos_and_pairs_compile_alike(tmp_path: Path, changes: dict[str, str], under: dict[str, Any]):
    changed = compile_body(conditions(changed_body(tmp_path, changes), **under), looks=False)
    assert differences(changed.model, compile_body(conditions(**under), looks=False).model) == []


def test_masses_are_moved_ahead_however_parts_are_turned(tmp_path: Path):
    """Not along their own axes."""
    turned = {'<body name="prothorax" pos': '<body name="prothorax" euler="0 20 90" pos'}
    masses = {"centre_of_mass": 5.0, "leg_mass": 0.5}
    centres = []
    for own in ({}, turned):
        data = at_home(changed := compile_body(conditions(changed_body(tmp_path, own), **masses)))
        centres.append(data.subtree_com[changed.root] - data.qpos[:3])
    assert [centre[0] for centre in centres] == pytest.approx([5.0, 5.0])
