"""Descriptions and MJCFs of bodies that make no sense, or do not fit each other, are refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import pytest

from compiled_bodies import at_home, changed_body, conditions
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Leg
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts

SECOND = STICK_INSECT.legs[1]


def changed_leg(**changes: Any) -> tuple[Leg, ...]:
    """The legs, the second changed."""
    first, second, *others = STICK_INSECT.legs
    return (first, replace(second, **changes), *others)


DESCRIPTIONS: dict[str, dict[str, Any]] = {
    "no file": {"mjcf": Path("nowhere.xml")},
    "five legs": {"legs": STICK_INSECT.legs[:5]},
    "a leg of two joints": {"legs": changed_leg(joints=SECOND.joints[:2])},
    "no mass": {"mass": 0.0},
    "ground that is no plane": {"ground": "left_eye"},
    "unknown keyframe": {"home": "bed"},
    "other mass": {"mass": 2.0},
    "lengths of another body": {"lengths": STICK_INSECT.lengths.scaled(2.0)},
    "unknown joint": {"legs": changed_leg(joints=("L2_hip", *SECOND.joints[1:]))},
    "joints in another order": {"legs": changed_leg(joints=SECOND.joints[::-1])},
    "foot without a site": {"legs": changed_leg(foot="L2_knee")},
    "home off its lines": {"lines": replace(FIG1, origins=(29.0, 4.0, -20.0))},
}


@pytest.mark.parametrize("case", DESCRIPTIONS)
def test_descriptions_that_make_no_sense_or_do_not_fit_the_mjcf_are_refused(case: str):
    with pytest.raises(InputError):
        settle(draw_starts(1, 0), conditions(replace(STICK_INSECT, **DESCRIPTIONS[case])))


WORLD, TRUNK, JOINT = "</worldbody>", '<geom name="mesothorax" ', '<joint armature="1" '
CONTACTS, SITE = "  </contact>", '<site name="R3_foot" '
TENDON = '</worldbody><tendon><spatial><site site="L1_foot"/><site site="L2_foot"/></spatial></tendon>'
MJCFS: dict[str, dict[str, str]] = {
    "no XML": {"<mujoco model": "<mujoco mod"},
    "actuators in another order": {'joint="L2_femur_tibia"': 'joint="L3_femur_tibia"'},
    "gravity in metres": {' gravity="0 0 -9810"': ""},
    "ground above 0": {'type="plane" size': 'type="plane" pos="0 0 3" size'},
    "feet of two sizes": {'<geom name="L2_foot" class="foot"': '<geom name="L2_foot" class="foot" size="0.5"'},
    "a tendon": {WORLD: TENDON},
    "feet that touch each other": {CONTACTS: f'<pair geom1="L1_foot" geom2="L2_foot"/>{CONTACTS}'},
    "limited joint torque": {JOINT: f'{JOINT}actuatorfrcrange="-9 9" '},
    "a joint of no leg": {SITE: f'<body><joint name="spur"/><geom size="0.1" mass="1e-6"/></body>{SITE}'},
}


@pytest.mark.parametrize("case", MJCFS)
def test_mjcfs_that_cannot_walk_are_refused(tmp_path: Path, case: str):
    with pytest.raises(InputError):
        compile_body(conditions(changed_body(tmp_path, MJCFS[case])))


@pytest.mark.parametrize("pack", ["3 0 3", "0 4 3"])
def test_a_centre_of_mass_that_is_not_at_o_is_refused(tmp_path: Path, pack: str):
    body = changed_body(tmp_path, {TRUNK: f'<geom type="sphere" size="1" pos="{pack}" mass="0.5"/>{TRUNK}'})
    with pytest.raises(InputError, match="centre of mass"):
        settle(draw_starts(1, 0), conditions(replace(body, mass=1.5)))


def test_a_centre_of_mass_elsewhere_stays_there_if_the_conditions_say_so(tmp_path: Path):
    body = changed_body(tmp_path, {'mass="0.216133"': 'mass="0.432266"'})
    heavy = conditions(replace(body, mass=1.216133), centre_of_mass=-5.1)
    data = at_home(compile_body(heavy))
    mujoco.mj_forward(data.model, data)
    assert data.subtree_com[data.model.body(body.root).id][0] - data.qpos[0] == pytest.approx(-5.1, abs=1e-6)
    settle(draw_starts(1, 0), heavy)


def test_legs_heavier_than_the_whole_body_are_refused(tmp_path: Path):
    heavy = {'<geom type="sphere" size="0.4" ': '<geom type="sphere" size="0.4" mass="0.5" '}
    body = replace(changed_body(tmp_path, heavy), mass=4.0)
    compile_body(conditions(body, leg_mass=1.2))
    with pytest.raises(InputError, match="leg_mass"):
        compile_body(conditions(body, leg_mass=1.4))
