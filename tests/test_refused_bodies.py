"""Descriptions and MJCFs of bodies that make no sense, or do not fit each other, are refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from compiled_bodies import at_home, conditions
from hexmj.bodies.description import Leg
from hexmj.bodies.loading import compile_body
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.physics.settling import settle
from hexmj.starts import draw_starts


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
        ('condim="3"', 'condim="1"', "has condim = 1; expected 3 or more: friction"),
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
