"""Bodies that are not the stick insect: it under other names and of other lengths, and hexapods of any hinges."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.kinematics import kinematics
from hexmj.body import STICK_INSECT, Body, Leg
from hexmj.legs import LEGS, SIDE


def found(tree: ElementTree.Element, path: str) -> ElementTree.Element:
    """The element at a path."""
    element = tree.find(path)
    assert element is not None
    return element


RENAMED = {"mesothorax": "keel", "metathorax": "stern", "prothorax": "neck", "head": "bow", "abdomen": "tail_boom"}
RENAMED |= {"ground": "pool_floor", "home": "at_anchor"}
RENAMED |= {
    f"{leg}_{old}": f"{new}_of_{place}"
    for leg, place in zip(LEGS, ("alpha", "beta", "gamma", "delta", "epsilon", "zeta"), strict=True)
    for old, new in {
        "thorax_coxa": "yaw", "coxa_trochanter": "lift", "femur_tibia": "bend",
        "coxa": "hip", "femur": "thigh", "tibia": "shank", "foot": "toe",
    }.items()
}  # fmt: skip
"""Every name that the description gives, to another."""

LONG = ("fron", "midd", "hind")
"""How classes of leg segments begin in the MJCF."""


def renamed(folder: Path, factor: float = 1.05) -> Body:
    """The stick insect with every name another, legs longer by a factor, and its home posture anew."""
    tree = ElementTree.fromstring(STICK_INSECT.mjcf.read_text())
    placed = [e for e in tree.iter() if e.get("name", "").endswith(("_femur", "_tibia", "_foot"))]
    drawn = [geom for one in tree.iter("default") if one.get("class", "")[:4] in LONG for geom in one.findall("geom")]
    for element in (*placed, *drawn):
        for attribute in {"fromto", "pos"} & element.attrib.keys():
            longer = [repr(factor * float(number)) for number in element.attrib[attribute].split()]
            element.set(attribute, " ".join(longer))
    for element in tree.iter():
        for attribute in {"name", "joint", "geom1", "geom2", "site", "objname", "body"} & element.attrib.keys():
            if element.tag not in ("material", "texture", "mesh"):
                element.set(attribute, RENAMED.get(element.attrib[attribute], element.attrib[attribute]))
    tree.set("model", "stretched")
    file = folder / "stretched.xml"
    file.write_text(ElementTree.tostring(tree, encoding="unicode"))
    body = replace(
        STICK_INSECT,
        name="stretched",
        mjcf=file,
        root=RENAMED[STICK_INSECT.root],
        trunk=tuple(RENAMED[part] for part in STICK_INSECT.trunk),
        legs=tuple(
            Leg(tuple(RENAMED[name] for name in leg.joints), RENAMED[leg.foot], tuple(RENAMED[p] for p in leg.parts))
            for leg in STICK_INSECT.legs
        ),
        ground=RENAMED["ground"],
        home=RENAMED["home"],
        lengths=STICK_INSECT.lengths.scaled(factor),
    )
    tips = np.stack([body.lines.origin, body.lines.y, 6 * [-body.standing_height]], axis=-1)
    joints, reachable = kinematics(mujoco.MjModel.from_xml_path(str(file)), body).inverse(tips)
    assert reachable.all()
    angles = " ".join(repr(float(angle)) for angle in joints.ravel())
    key = found(tree, "keyframe/key")
    key.set("qpos", f"0 0 {body.standing_height + 0.4} 1 0 0 0 {angles}")
    key.set("ctrl", angles)
    file.write_text(ElementTree.tostring(tree, encoding="unicode"))
    return body


def numbers(values: np.ndarray | Sequence[float]) -> str:
    """As MJCF writes them."""
    return " ".join(repr(float(value)) for value in values)


def any_hexapod(folder: Path, hinges: int, seed: int) -> Body:
    """A body with so many hinges in each leg, about any axes, with offsets and turns of any kind between them.

    Its MJCF has neither servos nor sensors nor pairs that touch; some hinges share a body, some bodies have none.
    """
    rng = np.random.default_rng(seed)
    text, home, legs = "", [], []
    for name, side, x in zip(LEGS, SIDE, (25, 0, -25, 25, 0, -25), strict=True):
        joints, closing = [], ""
        for j in range(hinges):
            place = (x, 5 * side, 0) if j == 0 else rng.normal((14 if j % 2 else 3, 0, -2), 2)
            turn = numbers(rng.normal(size=4) * 0.3 + (1 if side > 0 or j else 0.7, 0, 0, 0 if j else 0.7 * side))
            axis, anchor = rng.normal(size=3), numbers(rng.normal(size=3))
            low, zero, high = np.sort(rng.uniform(-1.2, 1.2, 3)) + np.array([-0.5, 0.0, 0.5])
            joints.append(f"{name}_{j}")
            home.append(rng.uniform(0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high))
            if j != hinges - 2:  # the last but one shares the body of the hinge before it
                text += f'<body name="part_{name}_{j}" pos="{numbers(place)}" quat="{turn}">'
                text += f'<geom type="sphere" size="0.5" pos="{anchor}" mass="0.01"/>'
                closing += "</body>"
            text += f'<joint name="{joints[-1]}" axis="{numbers(axis)}" pos="{anchor}" ref="{zero}" armature="1"'
            text += f' range="{low} {high}"/>'
            if j == 0:
                text += f'<body name="bare_{name}" pos="1 2 3" euler="0.1 0.2 0.3">'
                text += '<geom type="sphere" size="0.5" mass="0.001"/>'
                closing += "</body>"
        text += f'<body name="foot_{name}" pos="15 0 -3"><geom type="sphere" size="0.5" mass="0.01" name="{name}"/>'
        text += f'<site name="{name}"/></body>{closing}'
        parts = tuple(f"part_{name}_{j}" for j in range(hinges) if j != hinges - 2)
        legs.append(Leg(tuple(joints), name, (*parts, f"bare_{name}", f"foot_{name}")))
    file = folder / "hexapod.xml"
    file.write_text(
        f"""<mujoco><compiler angle="radian"/><option gravity="0 0 -9810" timestep="0.0005"/><worldbody>
        <geom name="floor" type="plane" size="0 0 1"/>
        <body name="hull"><freejoint/><geom name="hull" type="box" size="30 5 2" mass="1"/>{text}</body>
        </worldbody><keyframe><key name="stand" qpos="0 0 40 1 0 0 0 {numbers(home)}"/></keyframe></mujoco>"""
    )
    mass = mujoco.MjModel.from_xml_path(str(file)).body_mass.sum()
    names: dict[str, Any] = {
        "name": f"made_{hinges}_{seed}",
        "root": "hull",
        "trunk": ("hull",),
        "ground": "floor",
        "home": "stand",
    }
    names["cameras"] = ()
    return replace(STICK_INSECT, mjcf=file, legs=tuple(legs), mass=float(mass), **names)
