"""The stick insect: the MJCF compiled once, and its names turned into indices in one place.

Units mm, g, s, rad; forces in g mm/s^2.  Joints, actuators and the columns of `ctrl` come leg by leg
in the order of `LEGS`, each leg's joints in the order of `JOINTS`: ``qpos[ROOT_QPOS:]`` and ``ctrl``
reshape to (leg, joint).
"""

import copy
import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np

from hexmj.errors import InputError
from hexmj.legs import LEGS, SIDE
from hexmj.physics.body import Body
from hexmj.physics.ground import lay_ground
from hexmj.physics.kinematics import LegDimensions

JOINTS = ("thorax_coxa", "coxa_trochanter", "femur_tibia")
"""A leg's joints from the body outwards; their angles are protraction, levation, the knee's inner angle."""

TRUNK = ("head", "prothorax", "mesothorax", "metathorax", "abdomen")
"""Parts of the body that can touch the ground, from front to rear; also names of bodies and geoms."""

ROOT_QPOS = 7
"""Numbers of `qpos` before the joints: the root's position (3) and unit quaternion (4)."""

ROOT_QVEL = 6
"""Numbers of `qvel` before the joints: the root's velocity (3) and angular velocity (3)."""

MASS, GRAVITY = 1.0, 9810.0
"""The insect's own mass [g], and the acceleration of gravity [mm/s^2]."""

JOINT_ACTUATORS = 18
"""Columns of `ctrl` that hold joint targets; with `Body.grasp` the adhesion of the six feet follows."""

LONGEST_STEP = 0.000625
"""The longest time step [s] that the gains and contacts of the MJCF allow."""


@dataclass(frozen=True)
class Sensors:
    """Columns of `sensordata`: ``data[..., sensors.touch]`` is (..., leg)."""

    foot: slice
    """Feet in the world, (..., leg * axis) [mm]; reshape to (leg, 3)."""
    touch: slice
    """Normal force of the ground on each foot, (..., leg) [g mm/s^2]."""
    trunk: slice
    """Number of contacts of each part in `TRUNK` with the ground, (..., part)."""
    centre_of_mass: slice
    """Centre of mass of the whole insect in the world, (..., axis) [mm]."""


def load(timestep: float = LONGEST_STEP, body: Body | None = None, *, looks: bool = True) -> mujoco.MjModel:
    """The compiled insect on its ground; every call gives a copy of its own.

    Args:
        timestep: integration step [s], at most the 0.000625 that gains and contacts are made for.
        body: friction, masses, adhesion and ground are taken from it.
        looks: with the geoms that are only to look at; without them it walks to the same bits, 2 % faster.
    """
    if not 0 < timestep <= LONGEST_STEP:
        raise InputError(f"timestep = {timestep} s; expected above 0 and at most {LONGEST_STEP} s")
    model = copy.copy(_compiled(body or Body(), looks))
    model.opt.timestep = timestep
    return model


def body_of(model: mujoco.MjModel) -> Body:
    """The conditions with which a model of the insect was loaded."""
    begin = model.text_adr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, "body")]
    return Body(**json.loads(bytes(model.text_data[begin:]).split(b"\0")[0]))


def mjcf() -> str:
    """The insect's MJCF text."""
    packaged = files("hexmj") / "assets"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[2] / "assets"
    return (folder / "stick_insect.xml").read_text(encoding="utf-8")


def sensors(model: mujoco.MjModel) -> Sensors:
    """Where the insect's sensors lie in the model's `sensordata`."""

    def columns(first: str, last: str) -> slice:
        end = model.sensor(last)
        return slice(int(model.sensor(first).adr[0]), int(end.adr[0] + end.dim[0]))

    return Sensors(
        foot=columns(f"{LEGS[0]}_foot", f"{LEGS[-1]}_foot"),
        touch=columns(f"{LEGS[0]}_touch", f"{LEGS[-1]}_touch"),
        trunk=columns(f"{TRUNK[0]}_ground", f"{TRUNK[-1]}_ground"),
        centre_of_mass=columns("centre_of_mass", "centre_of_mass"),
    )


def dimensions(model: mujoco.MjModel) -> LegDimensions:
    """The legs' geometry, read from the compiled model."""
    ranges = [[model.joint(f"{leg}_{joint}").range for joint in JOINTS] for leg in LEGS]
    return LegDimensions(
        coxa_position=np.array([model.body(f"{leg}_coxa").pos for leg in LEGS]),
        coxa=np.array([model.body(f"{leg}_femur").pos[0] for leg in LEGS]),
        femur=np.array([model.body(f"{leg}_tibia").pos[0] for leg in LEGS]),
        tibia=np.array([model.site(f"{leg}_foot").pos[0] for leg in LEGS]),
        foot=float(model.geom(f"{LEGS[0]}_foot").size[0]),
        side=np.array(SIDE, dtype=np.float64),
        joint_range=np.array(ranges),
    )


def trunk_corners(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the trunk's capsules in the root frame, (corner, axis) [mm], and their radii, (corner,) [mm]."""
    data = mujoco.MjData(model)
    data.qpos[:ROOT_QPOS] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    ends, radii = [], []
    for part in TRUNK:
        geom = model.geom(part).id
        radius, half = model.geom_size[geom, :2]
        axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
        ends += [data.geom_xpos[geom] - half * axis, data.geom_xpos[geom] + half * axis]
        radii += [radius, radius]
    return np.array(ends), np.array(radii)


@lru_cache(maxsize=16)
def _compiled(body: Body, looks: bool) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(mjcf())
    spec.compiler.discardvisual = not looks
    lay_ground(spec, body, LEGS, TRUNK)
    if body.load:
        load = spec.body("mesothorax").add_body(name="load", mass=body.load * MASS, inertia=3 * [4 * body.load * MASS])
        load.explicitinertial = True
    spec.add_text(name="body", data=json.dumps(asdict(body), default=lambda number: number.item()))
    for leg in LEGS if body.grasp else ():
        spec.add_actuator(
            name=f"{leg}_grasp",
            trntype=mujoco.mjtTrn.mjTRN_BODY,
            target=f"{leg}_tibia",
            gainprm=[body.grasp * MASS * GRAVITY] + 9 * [0.0],
            ctrllimited=True,
            ctrlrange=[0.0, 1.0],
        )
    model = spec.compile()
    model.pair_friction[:, :2] = body.friction
    if body.leg_mass != 1.0 or body.centre_of_mass != 0.0:
        _redistribute(model, body)
    return model


def _redistribute(model: mujoco.MjModel, body: Body) -> None:
    """Give the legs their share of the mass, and move the trunk's masses until the centre of mass lies there."""
    legs = [model.body(f"{leg}_{part}").id for leg in LEGS for part in ("coxa", "femur", "tibia")]
    trunk = [model.body(part).id for part in TRUNK]
    in_legs, in_trunk = model.body_mass[legs].sum(), model.body_mass[trunk].sum()
    for bodies, factor in ((legs, body.leg_mass), (trunk, 1.0 + in_legs / in_trunk * (1.0 - body.leg_mass))):
        model.body_mass[bodies] *= factor
        model.body_inertia[bodies] *= factor
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    offset = body.centre_of_mass - (data.subtree_com[model.body("mesothorax").id] - data.qpos[:3])[0]
    model.body_ipos[trunk, 0] += offset * model.body_mass.sum() / model.body_mass[trunk].sum()
    mujoco.mj_setConst(model, data)
