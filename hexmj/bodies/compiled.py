"""A compiled body: the one object that is asked for its model, its columns, its kinematics and its measures."""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.additions import sensor_groups
from hexmj.bodies.grounds import depth_in_ground
from hexmj.bodies.hinges import ThreeHinges, three_hinges
from hexmj.bodies.numeric import HingeChains, hinge_chains
from hexmj.bodies.reading import posed
from hexmj.body import ROOT_QPOS, ROOT_QVEL, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError


@dataclass(frozen=True)
class Columns:
    """Where joints and sensors stand in MuJoCo's arrays: ``qpos[..., columns.qpos]`` is (..., leg * joint)."""

    qpos: slice
    """Of `qpos`: angles of the joints, leg by leg, each leg's from the body outwards [rad]."""
    qvel: slice
    """Of `qvel` and other arrays over the degrees of freedom: velocities of the joints [rad/s]."""
    ctrl: slice
    """Of `ctrl` and other arrays over the actuators: targets of the joints [rad]."""
    grasp: slice
    """Of `ctrl`: adhesion of each foot, 0 to 1, (..., leg); empty where feet do not grasp."""
    foot: slice
    """Of `sensordata`: feet in the world, (..., leg * axis) [mm]; reshape to (leg, 3)."""
    touch: slice
    """Of `sensordata`: normal force of the ground on each foot, (..., leg) [g mm/s^2]."""
    trunk: slice
    """Of `sensordata`: number of contacts of each part of the trunk, (..., part)."""
    centre_of_mass: slice
    """Of `sensordata`: centre of mass of the whole body in the world, (..., axis) [mm]."""
    feet_push: slice
    """Of `sensordata`: force of each foot on the ground in the world, (..., leg * axis) [g mm/s^2]; empty where that
    is not measured."""


@dataclass(frozen=True, eq=False)
class CompiledBody:
    """A body under some conditions, ready to walk."""

    model: mujoco.MjModel
    """The caller's own."""
    conditions: Conditions
    """Those it was compiled for."""
    columns: Columns
    kinematics: ThreeHinges | HingeChains
    """In closed form where its legs have one, else numeric."""
    foot_radius: float
    """Height of a standing foot's tip over the ground [mm]."""
    trunk_corners: tuple[np.ndarray, np.ndarray]
    """Where the trunk ends in the root frame, (corner, axis) [mm], and how thick it is there, (corner,) [mm]."""
    home: np.ndarray
    """`qpos` in posture home, (position,)."""

    @property
    def body(self) -> Body:
        """Its description."""
        return self.conditions.body

    @property
    def joints(self) -> int:
        """Number of joints of all legs."""
        return len(self.body.joints)

    @property
    def root(self) -> int:
        """MuJoCo's number of the root."""
        return int(self.model.jnt_bodyid[0])

    @property
    def weight(self) -> float:
        """Of the body itself, without what it carries [g mm/s^2]."""
        return -self.body.mass * float(self.model.opt.gravity[2])

    @property
    def torque_limits(self) -> np.ndarray:
        """Greatest torque of each joint, (leg * joint,) [g mm^2/s^2]."""
        return self.model.actuator_forcerange[self.columns.ctrl, 1]

    def depth(self, feet: np.ndarray) -> np.ndarray:
        """How deep feet in the world, (..., axis) [mm], are in the ground, (...) [mm]; negative above it."""
        return depth_in_ground(self.conditions, feet, self.foot_radius)

    def carried(self, sensors: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Force of the ground on each foot along its normal, (..., leg), adhesion taken off [g mm/s^2]: below 0 where
        that holds a foot that pulls; from what sensors show, (..., column), and actuators do, (..., actuator)."""
        touch, held = sensors[..., self.columns.touch], force[..., self.columns.grasp]
        return np.where(touch > 0, touch - held, touch) if held.size else touch.copy()

    def inverse(self, tips: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles that put the tips where they are wanted in the root frame, (..., leg, axis) [mm].

        Returns:
            The angles, (..., leg, joint) [rad], NaN where a tip cannot be reached, and whether it can within the legs'
            lengths and the joints' ranges, (..., leg).
        """
        return self.kinematics.inverse(tips)

    def forward(self, joints: ArrayLike) -> np.ndarray:
        """Tips in the root frame, (..., leg, axis) [mm], at joint angles, (..., leg, joint) [rad]."""
        return self.kinematics.forward(joints)


def measured(model: mujoco.MjModel, conditions: Conditions) -> CompiledBody:
    """A body compiled for some conditions."""
    body = conditions.body
    return CompiledBody(
        model=model,
        conditions=conditions,
        columns=columns(model, body),
        kinematics=kinematics(model, body),
        foot_radius=float(model.geom(body.feet[0]).size[0]),
        trunk_corners=trunk_corners(model, body),
        home=model.key(body.home).qpos.copy(),
    )


def kinematics(model: mujoco.MjModel, body: Body) -> ThreeHinges | HingeChains:
    """Kinematics of a compiled body's legs, in closed form where all of them have one."""
    chains = hinge_chains(model, body)
    return three_hinges(model, body, chains) or chains


def columns(model: mujoco.MjModel, body: Body) -> Columns:
    """Where a compiled body has its joints and sensors."""
    found = {}
    for name, group in sensor_groups(body).items():
        here = group.find(model) or (slice(0, 0) if group.optional else None)
        if here is None:
            raise InputError(f"body {body.name!r}: its sensors {', '.join(group.names)} do not measure {name}")
        found[name] = here
    joints = len(body.joints)
    return Columns(
        qpos=slice(ROOT_QPOS, ROOT_QPOS + joints),
        qvel=slice(ROOT_QVEL, ROOT_QVEL + joints),
        ctrl=slice(0, joints),
        grasp=slice(joints, model.nu),
        **found,
    )


def trunk_corners(model: mujoco.MjModel, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the trunk's capsules, middles of its spheres and corners of its boxes, (corner, axis) [mm], in the root
    frame, and the radius around each, (corner,) [mm]."""
    data, kinds = posed(model, model.qpos0), mujoco.mjtGeom
    ends, radii = [], []
    for part in body.trunk:
        geom = model.geom(part).id
        kind, size, axes = model.geom_type[geom], model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
        if kind == kinds.mjGEOM_CAPSULE:
            corners, radius = np.outer((-1, 1), (0, 0, size[1])), size[0]
        elif kind == kinds.mjGEOM_SPHERE:
            corners, radius = np.zeros((1, 3)), size[0]
        elif kind == kinds.mjGEOM_BOX:
            corners, radius = size * list(product((-1, 1), repeat=3)), 0.0
        else:
            raise InputError(f"body {body.name!r}: trunk part {part!r}; expected a capsule, a sphere or a box")
        ends.append(data.geom_xpos[geom] + corners @ axes.T)
        radii += len(corners) * [radius]
    return np.concatenate(ends), np.array(radii)
