"""Descriptions and MJCFs of bodies that make no sense, or do not fit each other, are refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from compiled_bodies import at_home, changed_body, conditions, differences
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Leg
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts


def changed_leg(**changes: Any) -> tuple[Leg, ...]:
    """The legs, the second changed."""
    first, second, *others = STICK_INSECT.legs
    return (first, replace(second, **changes), *others)


SECOND = STICK_INSECT.legs[1]

ROOT, WORLD, OPTION, JOINT = '<freejoint name="root"/>', "</worldbody>", "<option ", '<joint armature="1" '
FLAG, PAIR, TRUNK, HEAD = '<flag island="disable"', '<pair condim="3"', '<geom name="mesothorax" ', '<geom name="head" '
PLANE = '<geom name="ground" type="plane" size="0 0 50" material="ground"'
CONTACTS, BELLY = "  </contact>", '<pair geom1="ground" geom2="belly"/>'
SERVO, SITE = "<position name", '<site name="R3_foot" '
SKY = '<site name="sky" pos="0 0 200"/></worldbody><tendon><spatial stiffness="60"><site site="sky"/><site site="top"/>'
SKY += "</spatial></tendon>"
FLEX = '<flexcomp name="f" type="grid" count="3 3 1" spacing="5 5 5" pos="0 0 4" mass=".01" dim="2" rigid="true"/>'
PLUGIN = '<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension><asset>'
GRID = '<plugin plugin="mujoco.sensor.touch_grid" objtype="site" objname="L1_foot">'
GRID += '<config key="size" value="2 2"/><config key="fov" value="10 10"/><config key="nchannel" value="1"/></plugin>'


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
        ({"name": "a\nb"}, r"^a body's name = 'a\\nb'; expected 1 to 200 printable characters$"),
    ],
)
def test_descriptions_without_sense_are_refused(changes: dict[str, Any], message: str):
    with pytest.raises(InputError, match=message):
        replace(STICK_INSECT, **changes)


def test_what_is_no_number_or_no_text_in_utf_8_gets_a_sentence(tmp_path: Path):
    factor: Any = "2"
    with pytest.raises(InputError, match=r"^factor = '2'; expected a number$"):
        STICK_INSECT.lengths.scaled(factor)
    (mjcf := tmp_path / "latin.xml").write_bytes(STICK_INSECT.text().encode() + b"<!-- \xe9 -->")
    with pytest.raises(InputError, match=r"latin\.xml is no text in UTF-8"):
        replace(STICK_INSECT, mjcf=mjcf).text()


@pytest.mark.parametrize("changes", [{"standing_height": 12.0}, {"lines": replace(FIG1, origins=(29.0, 4.0, -20.0))}])
def test_a_home_that_is_not_as_described_is_refused(changes: dict[str, Any]):
    with pytest.raises(InputError, match=r"at 'home' foot 'L[12]_foot' is at .*; expected it on the origin of"):
        settle(draw_starts(1, 0), Conditions(body=replace(STICK_INSECT, **changes)))


@pytest.mark.parametrize(
    ("pack", "turn", "message"),
    [
        ("3 0 3", "1 0 0 0", r"centre of mass lies 1 mm ahead of O; expected it at O"),
        ("3 0 3", "1 0 0 1", r"centre of mass lies 1 mm ahead of O; expected it at O"),
        ("0 4 3", "1 0 0 0", r"centre of mass lies 1\.33\d mm to the left of O; expected 0"),
    ],
)
def test_a_centre_of_mass_elsewhere_is_seen_however_home_is_turned(tmp_path: Path, pack: str, turn: str, message: str):
    load = f'<geom type="sphere" size="1" pos="{pack}" mass="0.5"/>{TRUNK}'
    body = changed_body(tmp_path, {TRUNK: load, 'qpos="0 0 10.4  1 0 0 0': f'qpos="0 0 10.4 {turn}'})
    with pytest.raises(InputError, match=message):
        settle(draw_starts(1, 0), conditions(replace(body, mass=1.5)))


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
        ({"lengths": STICK_INSECT.lengths.scaled(2.0)}, r"for legs of 62 mm, but .* 31\.37 mm long.* by 0\.506"),
        ({"legs": changed_leg(joints=("L2_hip", *SECOND.joints[1:]))}, "no joint 'L2_hip'; valid names: root, L1_"),
        ({"legs": changed_leg(joints=SECOND.joints[::-1])}, "expected them leg by leg"),
        ({"legs": changed_leg(parts=SECOND.parts[1:])}, "is moved by 'L2_thorax_coxa'; expected it among the parts of"),
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
        (' gravity="0 0 -9810"', "", "gravity = 9.81 mm/s.2; expected at least 100, as 9810 on Earth"),
        (
            'type="plane" size',
            'type="plane" pos="0 0 3" size',
            "the ground 'ground' lies at z = 3 mm, .* expected it level",
        ),
        (
            'type="plane" size',
            'type="plane" euler="5 0 0" size',
            "lies at z = 0 mm, quat = .* expected it level at z = 0",
        ),
        ('condim="3"', 'condim="1"', "condim = 1 of the pair .*; expected 3 or more: friction"),
        ('<geom name="L2_foot" class="foot"', '<geom name="L2_foot" class="foot" size="0.5"', "feet have the radii"),
        ("<mujoco model", "<mujoco mod", "does not compile"),
        ("</worldbody>", '</worldbody><equality><weld body1="mesothorax"/></equality>', "equality constraints = 1"),
        ('gravity="0 0 -9810"', 'gravity="0 0 -9810" density="1000" viscosity="10"', "density = 1000.0; expected 0"),
        (
            '<geom name="ground"',
            '<geom name="ground" surfacevel="4.5 0 0"',
            "of the geom 'ground'; expected 0: nothing moves",
        ),
        ('<body name="mesothorax"', '<body name="mesothorax" gravcomp="1"', "gravcomp = 1.0 of the body 'mesothorax'"),
    ],
)
def test_mjcfs_that_cannot_walk_are_refused(tmp_path: Path, old: str, new: str, message: str):
    assert old in STICK_INSECT.text()
    file = tmp_path / "changed.xml"
    file.write_text(STICK_INSECT.text().replace(old, new))
    with pytest.raises(InputError, match=message):
        compile_body(conditions(replace(STICK_INSECT, mjcf=file)))


def root_joint(attribute: str) -> dict[str, str]:
    """A root whose joint takes an attribute, as it takes those of a default."""
    return {ROOT: f'<joint type="free" name="root" limited="false" {attribute}/>'}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({HEAD: '<geom name="skull" ', WORLD: f'{HEAD}size="1"/>{WORLD}'}, "geom 'head' is on the body 'world'; expec"),
        (root_joint('damping="500"'), r"damping = 500\.0 of the root; expected 0"),
        (root_joint('damping="0 5"'), r"damping = \[5\.0, .* of the root; expected 0"),
        (root_joint('frictionloss="300"'), r"frictionloss = 300\.0 of the root; expected 0"),
        (root_joint('armature="5"'), r"armature = 5\.0 of the root; expected 0"),
        (root_joint('stiffness="5000"'), r"stiffness = 5000\.0 of the root; expected 0"),
        (
            {JOINT: f'{JOINT}damping="-1000" '},
            r"damping = -1000\.0 of a leg's joint; expected 0 or more: a joint takes",
        ),
        ({JOINT: f'{JOINT}damping="0 -5" '}, r"damping = \[-5\.0, .* of a leg's joint; expected 0 or more"),
        ({JOINT: f'{JOINT}frictionloss="-1" '}, r"frictionloss = -1\.0 of a leg's joint; expected 0 or more"),
        ({WORLD: SKY, TRUNK: f'<site name="top"/>{TRUNK}'}, "number of tendons = 1; expected"),
        ({WORLD: FLEX + WORLD}, "number of flexes = 1; expected none"),
        ({"<asset>": PLUGIN, "</sensor>": f"{GRID}</sensor>"}, "number of plugins = 1; expected none"),
        ({PAIR: '<pair condim="1"'}, "condim = 1 of the pair"),
        ({'solimp="0.95 0.99': 'solimp="0.3 0.3'}, r"solimp = \[0\.3, 0\.3\] of the pair .*; expected 0\.9 or more"),
        ({'solimp="0.95 0.99': 'solimp="0.95 0.5'}, r"solimp = \[0\.95, 0\.5\] of the pair"),
        ({'impratio="3"': 'impratio="0.1"'}, r"impratio = 0\.1; expected 1 or more"),
        *(
            ({CONTACTS: f'<pair geom1="{one}" geom2="{other}"/>{CONTACTS}'}, f"pair of '{one}' and '{other}'; expected")
            for one, other in (("mesothorax", "L1_knee"), ("L1_foot", "L2_foot"), ("ground", "R3_knee"))
        ),
        ({CONTACTS: f'<pair geom1="L1_foot" geom2="ground"/>{CONTACTS}'}, "'ground' and 'L1_foot'; .* each once"),
        (
            {TRUNK: f'<geom name="belly" type="sphere" size="5"/>{TRUNK}', CONTACTS: f"{BELLY}{CONTACTS}"},
            "a pair of 'ground' and 'belly'; expected pairs of 'ground' with its trunk's parts and its feet alone",
        ),
        (
            {WORLD: f'<geom name="wall" size="3"/>{WORLD}', CONTACTS: f"{BELLY.replace('belly', 'wall')}{CONTACTS}"},
            "a pair of 'ground' and 'wall'; expected",
        ),
        ({PAIR: f'{PAIR} margin="3"'}, r"margin = 3\.0 of the pair"),
        ({'<pair name="mesothorax"': '<pair margin="3"'}, r"margin = 3\.0 of the pair 'ground' and 'mesothorax'"),
        ({PAIR: f'{PAIR} gap="3"'}, r"gap = 3\.0 of the pair"),
        ({PAIR: f'{PAIR} solreffriction="0.02 1"'}, r"solreffriction = \[0\.02, 1\.0\] of the pair"),
        ({'solref="0.00125 1"': 'solref="0.05 1"'}, r"solref = \[0\.05, 1\.0\] of the pair .* at most 0\.0025 s"),
        ({'solref="0.00125 1"': 'solref="-640000 -1600"'}, r"solref = \[-640000\.0, .* a time constant above 0"),
        ({FLAG: f'{FLAG} override="enable"', OPTION: '<option o_friction="0 0 0 0 0" '}, "flag 'override' is enabled"),
        ({FLAG: f'{FLAG} sleep="enable"'}, "flag 'sleep' is enabled; expected flags as MuJoCo has them"),
        *(
            ({FLAG: f'{FLAG} {flag}="disable"'}, f"flag '{flag}' is disabled; expected flags as MuJoCo has them")
            for flag in ("contact", "gravity", "actuation", "limit", "clampctrl", "warmstart", "refsafe")
        ),
        ({"implicitfast": "RK4"}, "integrator = RK4; expected IMPLICITFAST or IMPLICIT"),
        ({'solver="Newton"': 'solver="PGS"'}, "solver = PGS; expected NEWTON or CG"),
        ({OPTION: '<option iterations="1" '}, "iterations = 1; expected 100 or more"),
        ({OPTION: '<option ls_iterations="1" '}, "ls_iterations = 1; expected 50 or more"),
        ({'tolerance="1e-5" ': 'tolerance="1" '}, r"tolerance = 1\.0; expected at most 1e-05"),
        ({OPTION: '<option actuatorgroupdisable="1" '}, "actuatorgroupdisable = 2; expected none"),
        ({WORLD: f'<body name="ball"><freejoint name="b"/><geom size="3"/></body>{WORLD}'}, "joint 'b' is no leg's"),
        ({WORLD: f'<body name="ball"><freejoint/><geom size="3"/></body>{WORLD}'}, "a joint of 'ball' is no leg's"),
        ({SITE: f'<body><joint name="spur"/><geom size="0.1" mass="1e-6"/></body>{SITE}'}, "joint 'spur' is no leg's"),
        ({JOINT: f'{JOINT} margin="0.5" '}, r"margin = 0\.5 of the joint 'L1_thorax_coxa'; expected 0"),
        ({JOINT: f'{JOINT} actuatorfrcrange="-9 9" '}, "actuatorfrclimited = True of the joint 'L1_thorax_coxa'"),
        ({SERVO: '<position nsample="20" delay="0.01" name'}, r"nsample, interp = \[20, 0\] of the actuator"),
        ({WORLD: f'<geom name="wall" type="box" size="3 9 9" contype="1"/>{WORLD}'}, "geom 'wall' beside the body"),
        ({WORLD: f'<geom name="upper" type="plane" size="9 9 9" conaffinity="1"/>{WORLD}'}, "geom 'upper' beside the"),
    ],
)
def test_what_is_in_force_unseen_is_refused(tmp_path: Path, changes: dict[str, str], message: str):
    body = changed_body(tmp_path, changes)
    with pytest.raises(InputError, match=message):
        compile_body(conditions(body))


def test_euler_s_damping_is_idle(tmp_path: Path):
    model = compile_body(conditions(changed_body(tmp_path, {FLAG: f'{FLAG} eulerdamp="disable"'}))).model
    assert differences(model, compile_body(conditions()).model) == ["opt.disableflags"]


def test_legs_that_leave_nothing_of_the_trunk_are_refused(tmp_path: Path):
    heavy = {'<geom type="sphere" size="0.4" ': '<geom type="sphere" size="0.4" mass="0.5" '}
    body = replace(changed_body(tmp_path, heavy), mass=4.0)
    compile_body(conditions(body, leg_mass=1.2))
    with pytest.raises(InputError, match=r"leg_mass = 1\.4; expected below 1\.2\d+, or nothing is left of the trunk"):
        compile_body(conditions(body, leg_mass=1.4))


@pytest.mark.parametrize(
    ("changes", "under", "message"),
    [
        (
            {HEAD: f'<geom name="step" type="sphere" size="1"/>{HEAD}'},
            {"ground": "step"},
            "ground = 'step', .* repeated name 'step'",
        ),
        (
            {HEAD: f'<geom name="bump_3" type="sphere" size="1"/>{HEAD}'},
            {"ground": "rough"},
            "cannot be built: .* 'bump_3'",
        ),
        ({HEAD: f'<body name="load"/>{HEAD}'}, {"load": 1.0}, "load = 1, .* repeated name 'load'"),
        ({' autolimits="true"/>': ' settotalmass="1"/>'}, {"load": 1.0}, "with load = 1 it weighs 1 g; expected 2 g"),
        (
            {PLANE: f'<frame quat="0 1 0 0">{PLANE} quat="0 1 0 0"', "\n    <body": "</frame><body"},
            {"ground": "gap"},
            "with ground = 'gap' its plane lies at z = 31 mm; expected -31 mm",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
def test_what_conditions_cannot_be_met_with_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, str], under: dict[str, Any], message: str
):
    monkeypatch.chdir(tmp_path)  # MuJoCo logs its warnings there
    with pytest.raises(InputError, match=message):
        compile_body(conditions(changed_body(tmp_path, changes), **under))
