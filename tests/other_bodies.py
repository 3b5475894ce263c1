"""A body of other names and other lengths, made of the stick insect's MJCF."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from hexmj.bodies.compiled import kinematics
from hexmj.bodies.description import Body, Leg
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.legs import LEGS


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
    tree = ElementTree.fromstring(STICK_INSECT.text())
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
