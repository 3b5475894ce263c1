"""Descriptions of bodies and what is compiled from them: gains, grounds, masses, and a body of other names."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from film_reader import read_film
from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.description import ROOT_QPOS, Body, Leg, Servo
from hexmj.bodies.gains import gains, longest_lever
from hexmj.bodies.grounds import depth_in_ground, ground_level
from hexmj.bodies.hinges import ThreeHinges
from hexmj.bodies.loading import compile_body, plain_model
from hexmj.bodies.numeric import HingeChains
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.conditions import Conditions, Ground
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.reads_legs import ReadsLegs
from hexmj.environments import dm
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.settling import settle
from hexmj.replay.film import gl
from hexmj.replay.film.film import Film
from hexmj.replay.film.video import render
from hexmj.replay.recording import load_recording, record, record_plan, save_recording
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from other_bodies import found, renamed
from test_inverse_kinematics import any_hexapod

NAMES = ("name", "text", "paths", "nnames", "nbuffer")
"""Beginnings of what holds nothing but names in a model, and its size."""


def conditions(body: Body = STICK_INSECT, **values: Any) -> Conditions:
    """The usual conditions of a body but for some."""
    return Conditions(body=body).but(**values)


def arrays(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """All that a model holds but names, its options among it."""
    held = {}
    for place, of in (("", model), ("opt.", model.opt), ("stat.", model.stat)):
        for name in dir(of):
            value = None if name.startswith(("_", *NAMES)) else getattr(of, name)
            if isinstance(value, (np.ndarray, int, float)):
                held[place + name] = np.array(value)
    return held


def differences(one: mujoco.MjModel, other: mujoco.MjModel) -> list[str]:
    """What is not the same, to the bit."""
    a, b = arrays(one), arrays(other)
    assert len(a) > 400 and a.keys() == b.keys()
    return [name for name in a if a[name].shape != b[name].shape or a[name].tobytes() != b[name].tobytes()]


@pytest.fixture(scope="module")
def insect() -> CompiledBody:
    """The stick insect as usual."""
    return compile_body(conditions())


def at_home(compiled: CompiledBody) -> mujoco.MjData:
    """The compiled body in posture home, its servos at rest."""
    data = mujoco.MjData(compiled.model)
    data.qpos[:] = compiled.home
    data.ctrl[compiled.columns.ctrl] = compiled.home[compiled.columns.qpos]
    mujoco.mj_forward(compiled.model, data)
    return data


def test_the_mjcf_by_itself_is_the_body(insect: CompiledBody):
    """Gains computed are those written, and nothing is added."""
    assert differences(insect.model, mujoco.MjModel.from_xml_string(STICK_INSECT.text())) == []


def test_gains_are_computed_from_mass_lengths_and_time_step():
    model = plain_model(STICK_INSECT)
    found = gains(model, STICK_INSECT)
    assert (found.torque, found.stiffness, found.damping_ratio) == (4e5, 1.5e6, 1.0)
    assert longest_lever(model, STICK_INSECT) == pytest.approx(18.26 + 22.385)  # a front leg's femur and tibia
    knees = model.dof_M0[model.joint("R3_femur_tibia").dofadr[0]], model.dof_M0[model.joint("L3_femur_tibia").dofadr[0]]
    assert_allclose(knees, 1.6, atol=0.05)


@pytest.mark.parametrize("step", [0.0005, 0.001, 0.002])
def test_gains_follow_weight_and_time_step(step: float):
    model, precise = plain_model(STICK_INSECT), Servo(step=step, damping_ratio=0.5, digits=15)
    found = gains(model, replace(STICK_INSECT, servo=precise))
    heavy = gains(model, replace(STICK_INSECT, servo=precise, mass=2.0))
    assert heavy.torque == pytest.approx(2.0 * found.torque, rel=1e-12)
    knees = model.dof_M0[ROOT_QPOS - 1 + 2 :: 3]
    assert np.mean(found.stiffness / knees) * step**2 == pytest.approx(1.0)
    assert found.damping_ratio == 0.5


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


@pytest.mark.parametrize("timestep", [0.0, -0.001, 0.002, np.nan])
def test_time_steps_without_sense_are_refused(timestep: float):
    with pytest.raises(InputError, match="timestep"):
        compile_body(conditions(), timestep)


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
def test_all_ground_is_touched_alike(insect: CompiledBody, ground: str, pieces: int):
    """Feet and trunk each touch every piece, by the contact settings of the MJCF."""
    model = compile_body(conditions(ground=ground)).model
    assert insect.model.npair == 11
    assert model.npair == pieces * 11
    for name in ("dim", "solref", "solreffriction", "solimp", "margin", "gap", "friction"):
        values = getattr(model, f"pair_{name}")
        assert_array_equal(values, np.broadcast_to(getattr(insect.model, f"pair_{name}")[0], values.shape))


@pytest.mark.parametrize("ground", ["flat", "step", "gap", "hurdle", "rough"])
def test_the_ground_s_level_is_where_depth_begins(ground: str):
    """Of points, between edges; `test_strikes` holds the depth against MuJoCo's contacts."""
    lengths, rng = STICK_INSECT.lengths, np.random.default_rng(0)
    places = rng.uniform((40.0, -30.0), (80.0, 30.0), (500, 2))
    ahead = conditions(ground=ground).ground
    level = ground_level(ahead, lengths, places)
    assert (len(set(level)) > 1) == (ground != "flat")
    on_it = np.concatenate([places, level[:, None]], axis=1)
    assert_allclose(depth_in_ground(ahead, lengths, on_it, 0.0), 0.0, atol=1e-9)
    assert (depth_in_ground(ahead, lengths, on_it + np.array([0.0, 0.0, 0.5]), 0.0) < 0).all()


def test_what_an_mjcf_lacks_is_added(insect: CompiledBody, tmp_path: Path):
    """Without servos, sensors and pairs the insect compiles to the same, but for the keyframe's targets."""
    tree = ElementTree.fromstring(STICK_INSECT.text())
    for section in ("actuator", "sensor", "contact"):
        tree.remove(found(tree, section))
    del found(tree, "keyframe/key").attrib["ctrl"]
    file = tmp_path / "bare.xml"
    file.write_text(ElementTree.tostring(tree, encoding="unicode"))
    bare = compile_body(conditions(replace(STICK_INSECT, mjcf=file)))
    assert plain_model(bare.body).nu == 0
    assert differences(bare.model, insect.model) == ["key_ctrl"]
    assert bare.columns == insect.columns


@pytest.mark.parametrize("hinges", [3, 4])
def test_a_body_of_any_hinges_compiles_and_can_be_loaded(tmp_path: Path, hinges: int):
    body = any_hexapod(tmp_path, hinges, 6)
    compiled = compile_body(conditions(body, load=0.5, grasp=1.0, leg_mass=0.5, ground="rough"))
    assert isinstance(compiled.kinematics, HingeChains)
    assert compiled.joints == 6 * hinges == compiled.columns.grasp.start
    assert compiled.model.body_mass.sum() == pytest.approx(1.5 * body.mass)
    assert compiled.torque_limits.tolist() == 6 * hinges * [gains(plain_model(body), body).torque]
    assert compiled.trunk_corners[0].shape == (8, 3)
    stands_and_steps(compiled)


def stands_and_steps(compiled: CompiledBody) -> None:
    """Its kinematics are MuJoCo's, and inverse and forward are each other's."""
    body, data = compiled.body, mujoco.MjData(compiled.model)
    rng = np.random.default_rng(3)
    home = compiled.home[compiled.columns.qpos].reshape(6, -1)
    tips = compiled.forward(home + rng.uniform(-0.1, 0.1, (20, *home.shape)))
    joints, reachable = compiled.inverse(tips)
    assert reachable.all()
    assert_allclose(compiled.forward(joints), tips, rtol=0, atol=1e-9)
    for wanted, angles in zip(tips, joints, strict=True):
        data.qpos[:] = 0.0
        data.qpos[3] = 1.0
        data.qpos[compiled.columns.qpos] = angles.ravel()
        mujoco.mj_kinematics(compiled.model, data)
        assert_allclose([data.site(foot).xpos for foot in body.feet], wanted, atol=1e-9)


def test_a_body_of_other_names_and_lengths_stands(tmp_path: Path):
    body = renamed(tmp_path)
    compiled = compile_body(conditions(body))
    old = {*STICK_INSECT.joints, *STICK_INSECT.feet, *STICK_INSECT.trunk, STICK_INSECT.ground}
    assert not old & {*body.joints, *body.feet, *body.trunk, body.ground}
    assert isinstance(compiled.kinematics, ThreeHinges)
    assert longest_lever(compiled.model, body) == pytest.approx(
        1.05 * longest_lever(plain_model(STICK_INSECT), STICK_INSECT)
    )
    assert compiled.torque_limits[0] == 4.2e5
    stands_and_steps(compiled)
    data = at_home(compiled)
    for _ in range(round(0.5 / compiled.model.opt.timestep)):
        mujoco.mj_step(compiled.model, data)
    mujoco.mj_forward(compiled.model, data)
    touch = data.sensordata[compiled.columns.touch]
    assert (touch > 0).all() and touch.sum() == pytest.approx(compiled.weight, rel=0.01)
    assert not data.sensordata[compiled.columns.trunk].any()
    assert np.linalg.norm(data.qvel[:3]) < body.lengths.speed_at_rest


def test_names_alone_change_no_bit(insect: CompiledBody, tmp_path: Path):
    """Of the model and of a walk, whether its plan reads the legs or not."""
    body = renamed(tmp_path, 1.0)
    same_home = {"key_qpos", "key_ctrl"}  # from 10 digits in the MJCF to all of them
    other = compile_body(conditions(body))
    assert set(differences(other.model, insect.model)) <= same_home
    assert_allclose(other.home, insect.home, atol=1e-9)
    for controller in (LDVS, ReadsLegs(LDVS)):
        ours, theirs = (
            physical_walk(draw_starts(4, 0), controller, 0.5, 30.0, conditions=conditions(one, grasp=0.3, load=0.5))
            for one in (STICK_INSECT, body)
        )
        assert_array_equal(theirs.qpos, ours.qpos)
        for name in ("stance", "x", "y"):
            assert_array_equal(getattr(theirs.measured, name), getattr(ours.measured, name))
        for name in Outcomes.__dataclass_fields__:
            assert_array_equal(getattr(theirs.outcomes, name), getattr(ours.outcomes, name))


@pytest.fixture(scope="module")
def longer(tmp_path_factory: pytest.TempPathFactory) -> Body:
    """Another name, longer legs and every name another."""
    return renamed(tmp_path_factory.mktemp("longer"))


def test_a_body_of_other_names_and_lengths_walks(longer: Body):
    """By passing its description, at the speed asked for."""
    walked = physical_walk(draw_starts(6, 0), LDVS, 0.3, 100.0, conditions=conditions(longer))
    stays = np.isinf(walked.outcomes.fall)
    assert stays.mean() > 0.5
    tips = 1000 * walked.conditions.substeps(walked.stride) * 6
    assert (walked.outcomes.unreachable < 0.05 * tips).all()  # its joints' ranges are those of shorter legs
    assert_allclose(walked.outcomes.speed[stays], 1.0, atol=0.05)
    ours = physical_walk(draw_starts(6, 0), LDVS, 0.3, 100.0)
    assert (walked.qpos[-1, stays] != ours.qpos[-1, stays]).any()


def test_a_body_of_other_names_walks_in_the_environment(longer: Body):
    """Zero offsets are its physical walk to the last bit; its joints go by their own names."""
    walked = physical_walk(draw_starts(1, 3), LDVS, 0.3, 20.0, conditions=conditions(longer))
    walking = dm.load(0.3, actions="tips", conditions=conditions(longer), duration=20.0, seed=3)
    step, qpos = walking.reset(), []
    while not step.last():
        step = walking.step(np.zeros(18))
        qpos.append(walking.physics.position())
    assert_array_equal(qpos, walked.qpos[:, 0])
    joints = dm.load(actions="joints", conditions=conditions(longer))
    assert joints.action_spec().name.split("\t") == list(longer.joints)


def test_a_body_of_other_names_is_recorded_and_filmed(longer: Body, tmp_path: Path):
    """The insect and a puppet beside it, from a file."""
    walked = physical_walk(draw_starts(1, 0), LDVS, 0.3, 8.0, conditions=conditions(longer))
    puppet = record_plan(walked.planned, walked.conditions, walked.stride)
    path = save_recording(record(walked), tmp_path / "walk.nc")
    if gl.missing():
        pytest.skip("nothing can be rendered here")
    film = Film(width=160, height=120, slow_motion=0.3)
    with load_recording(path) as recording:
        assert render([recording, puppet], tmp_path / "film.mp4", film, body=longer) == 1
        with pytest.raises(InputError, match="of the body 'stretched', not of 'stick_insect'"):
            render([recording], tmp_path / "other.mp4", film)
    assert read_film(tmp_path / "film.mp4")[0].shape == (1, 120, 320, 3)


def test_a_body_is_filmed_by_its_own_cameras_and_without_looks(tmp_path: Path):
    tree = ElementTree.fromstring(STICK_INSECT.text())
    assets = found(tree, "asset")
    for one in [*assets.findall("texture"), *assets.findall("material")]:
        assets.remove(one)
    for element in tree.iter():
        element.attrib.pop("material", None)
        if element.get("name") == "side":
            element.set("name", "eye")
    (tmp_path / "plain.xml").write_text(ElementTree.tostring(tree, encoding="unicode"))
    body = replace(STICK_INSECT, name="plain", mjcf=tmp_path / "plain.xml", cameras=("eye",))
    stride = Stride()
    planned = walk(draw_starts(1, 0), LDVS, 0.3, 1.0, stride=stride)
    puppet, film = record_plan(planned, conditions(body), stride), tmp_path / "film.mp4"
    if gl.missing():
        pytest.skip("nothing can be rendered here")
    assert render([puppet], film, Film("eye", width=160, height=120, slow_motion=1.0), body=body) == 1
    for cameras, told in ((("eye",), "eye"), ((), "none")):
        with pytest.raises(InputError, match=f"camera = 'following'; valid names of plain: {told}"):
            render([puppet], film, body=replace(body, cameras=cameras))


def changed_leg(**changes: Any) -> tuple[Leg, ...]:
    """The legs, the second changed."""
    first, second, *others = STICK_INSECT.legs
    return (first, replace(second, **changes), *others)


SECOND = STICK_INSECT.legs[1]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mjcf": Path("nowhere.xml")}, r"mjcf = 'nowhere\.xml' is no file"),
        ({"trunk": ()}, "at least one part"),
        ({"trunk": ("head", "L1_tibia")}, "trunk part 'L1_tibia' is a leg's"),
        ({"trunk": ("head", "head")}, "trunk name 'head' twice"),
        ({"legs": STICK_INSECT.legs[:5]}, "5 legs; expected 6"),
        ({"legs": changed_leg(joints=SECOND.joints[:2])}, "3, 2, 3, 3, 3, 3 joints; expected equally many"),
        ({"legs": changed_leg(joints=STICK_INSECT.legs[0].joints)}, "joints name 'L1_thorax_coxa' twice"),
        ({"mass": 0.0}, "mass = 0.0; expected a finite number above 0 g"),
        ({"standing_height": np.nan}, "standing_height = nan"),
        ({"longest_step": np.inf}, "longest_step = inf"),
    ],
)
def test_descriptions_without_sense_are_refused(changes: dict[str, Any], message: str):
    with pytest.raises(InputError, match=message):
        replace(STICK_INSECT, **changes)


@pytest.mark.parametrize("changes", [{"standing_height": 12.0}, {"lines": replace(FIG1, origins=(29.0, 4.0, -20.0))}])
def test_a_home_that_is_not_as_described_is_refused(changes: dict[str, Any]):
    with pytest.raises(InputError, match=r"at 'home' foot 'L[12]_foot' is at .*; expected it on the origin of"):
        settle(draw_starts(1, 0), Conditions(body=replace(STICK_INSECT, **changes)))


def test_a_centre_of_mass_elsewhere_is_said_and_stays_there(tmp_path: Path):
    """Light legs do not move it either."""
    (mjcf := tmp_path / "heavy.xml").write_text(STICK_INSECT.text().replace('mass="0.216133"', 'mass="0.432266"'))
    body = replace(STICK_INSECT, name="heavy", mjcf=mjcf, mass=1.216133)
    for masses in ({}, {"leg_mass": 0.5}):
        with pytest.raises(InputError, match=r"centre of mass lies -5\.10\d* mm ahead of O; expected it at O"):
            settle(draw_starts(1, 0), conditions(body, **masses))
        data = at_home(compile_body(conditions(body, centre_of_mass=-5.1, **masses)))
        mujoco.mj_forward(data.model, data)
        assert data.subtree_com[data.model.body(body.root).id][0] - data.qpos[0] == pytest.approx(-5.1, abs=1e-6)
    settle(draw_starts(1, 0), conditions(body, centre_of_mass=-5.1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"root": "thorax"}, "no body 'thorax'; valid names: .*mesothorax"),
        ({"root": "head"}, "root 'head' lacks a free joint"),
        ({"trunk": ("head", "wings")}, "no body 'wings'; valid names"),
        ({"trunk": ("head", "L1_femur_missing")}, "no body 'L1_femur_missing'"),
        ({"ground": "lawn"}, "no geom 'lawn'; valid names: ground"),
        ({"ground": "left_eye"}, "ground 'left_eye' is no plane"),
        ({"home": "bed"}, "no key 'bed'; valid names: home"),
        ({"cameras": ("side", "drone")}, "no camera 'drone'; valid names: side, top, front, following"),
        ({"mass": 2.0}, "mass = 2 g, but its MJCF weighs 1 g"),
        ({"legs": changed_leg(joints=("L2_hip", *SECOND.joints[1:]))}, "no joint 'L2_hip'; valid names: root, L1_"),
        ({"legs": changed_leg(joints=SECOND.joints[::-1])}, "expected them leg by leg"),
        ({"legs": (*STICK_INSECT.legs[3:], *STICK_INSECT.legs[:3])}, "expected them leg by leg"),
        ({"legs": changed_leg(foot="L2_tip")}, "no geom 'L2_tip'; valid names"),
        ({"legs": changed_leg(foot="L2_knee")}, "no site 'L2_knee'; valid names: L1_foot"),
        ({"legs": changed_leg(foot="L4_foot")}, "no geom 'L4_foot'"),
        ({"legs": changed_leg(parts=SECOND.parts[:2])}, "foot 'L2_foot' is on 'L2_tibia'; expected it on a part"),
    ],
)
def test_descriptions_that_the_mjcf_does_not_fit_are_refused(changes: dict[str, Any], message: str):
    body = replace(STICK_INSECT, **changes)
    with pytest.raises(InputError, match=message):
        compile_body(conditions(body))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<joint name="L2_femur_tibia"/>', '<joint name="L2_femur_tibia" type="slide"/>', "expected a hinge"),
        ('joint="L2_femur_tibia"', 'joint="L3_femur_tibia"', "expected one for each joint in the order"),
        ('gravity="0 0 -9810"', 'gravity="1 0 -9810"', "expected it to point down"),
        ('<geom name="L2_foot" class="foot"', '<geom name="L2_foot" class="foot" size="0.5"', "feet have the radii"),
        ("<mujoco model", "<mujoco mod", "does not compile"),
        ("</worldbody>", '</worldbody><equality><weld body1="mesothorax"/></equality>', "1 equality constraints"),
        ('gravity="0 0 -9810"', 'gravity="0 0 -9810" density="1000" viscosity="10"', "density = 1000, viscosity = 10"),
        ('<body name="mesothorax"', '<body name="mesothorax" gravcomp="1"', "gravity is compensated"),
    ],
)
def test_mjcfs_that_cannot_walk_are_refused(tmp_path: Path, old: str, new: str, message: str):
    assert old in STICK_INSECT.text()
    file = tmp_path / "changed.xml"
    file.write_text(STICK_INSECT.text().replace(old, new))
    with pytest.raises(InputError, match=message):
        compile_body(conditions(replace(STICK_INSECT, mjcf=file)))


def test_usual_places_of_obstacles_hold_no_body_back_where_the_ground_is_flat(tmp_path):
    long = renamed(tmp_path, factor=1.2)
    Conditions(body=long)
    for ground in ("step", "gap", "rough"):
        with pytest.raises(InputError, match="ground_at = 50"):
            Conditions(body=long, ground=Ground(ground))
    with pytest.raises(InputError, match="ground_at = 51"):
        Conditions(body=long, ground=Ground(ground_at=51.0))
