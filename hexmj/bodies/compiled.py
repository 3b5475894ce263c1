"""A compiled body: its MuJoCo model, the columns of its joints and sensors, its kinematics and its dimensions."""

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.ground import depth_in_ground
from hexmj.bodies.kinematics import HingeChains, ThreeHinges, kinematics, posed
from hexmj.body import ROOT_QPOS, ROOT_QVEL, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS


@dataclass(frozen=True)
class Columns:
    """Columns of joints and sensors in MuJoCo's arrays: ``qpos[..., columns.qpos]`` is (..., leg * joint)."""

    qpos: slice
    """Columns of `qpos` with the joint angles, leg by leg, and in each leg from the body outwards [rad]."""
    qvel: slice
    """Columns of `qvel`, and of other arrays over the degrees of freedom, with the joint velocities [rad/s]."""
    ctrl: slice
    """Columns of `ctrl`, and of other arrays over the actuators, with the joint targets [rad]."""
    grasp: slice
    """Columns of `ctrl` with the adhesion of each foot, 0 to 1, (..., leg); empty without adhesion."""
    foot: slice
    """Columns of `sensordata` with the feet in the world, (..., leg * axis) [mm]; reshape them to (..., leg, axis)."""
    touch: slice
    """Columns of `sensordata` with the normal force of the ground on each foot, (..., leg) [g mm/s^2]."""
    trunk: slice
    """Columns of `sensordata` with the number of contacts of each part of the trunk, (..., part)."""
    centre_of_mass: slice
    """Columns of `sensordata` with the centre of mass of the whole body in the world, (..., axis) [mm]."""
    feet_push: slice
    """Columns of `sensordata` with the force of each foot on the ground in the world, (..., leg * axis) [g mm/s^2];
    empty if this force is not measured."""


@dataclass(frozen=True, eq=False)
class CompiledBody:
    """A body that is compiled for some conditions and ready to walk."""

    model: mujoco.MjModel
    """MuJoCo's model; the caller may change it."""
    conditions: Conditions
    """Conditions for which the body is compiled."""
    columns: Columns
    """Columns of the joints and sensors in MuJoCo's arrays."""
    kinematics: ThreeHinges | HingeChains
    """Kinematics of the legs, in closed form if it exists, else numeric."""
    foot_radius: float
    """Radius of the sphere at a foot: the height of a standing foot's tip above the ground [mm]."""
    trunk_corners: tuple[np.ndarray, np.ndarray]
    """Corners of the trunk, which are spheres: centres in the root frame, (corner, axis), and radii, (corner,) [mm]."""
    home: np.ndarray
    """`qpos` in posture home, (position,)."""

    @classmethod
    def of(cls, model: mujoco.MjModel, conditions: Conditions) -> "CompiledBody":
        """Return the compiled body of a model that has the sensors of `add_sensors`."""
        body = conditions.body
        return cls(
            model=model,
            conditions=conditions,
            columns=_columns(model, body),
            kinematics=kinematics(model, body),
            foot_radius=float(model.geom(body.feet[0]).size[0]),
            trunk_corners=_trunk_corners(model, body),
            home=model.key(body.home).qpos.copy(),
        )

    @property
    def body(self) -> Body:
        """Description of the body."""
        return self.conditions.body

    @property
    def joints(self) -> int:
        """Number of joints of all legs."""
        return len(self.body.joints)

    @property
    def root(self) -> int:
        """MuJoCo's index of the root body."""
        return int(self.model.jnt_bodyid[0])

    @property
    def weight(self) -> float:
        """Weight of the body itself, without its load [g mm/s^2]."""
        return self.body.mass * math.hypot(*self.model.opt.gravity)

    @property
    def torque_limits(self) -> np.ndarray:
        """Maximum torque of each joint, (leg * joint,) [g mm^2/s^2]."""
        return self.model.actuator_forcerange[self.columns.ctrl, 1]

    def depth(self, feet: np.ndarray) -> np.ndarray:
        """Return how deep feet at world positions, (..., axis) [mm], are in the ground [mm]; negative above it."""
        return depth_in_ground(self.conditions, feet, self.foot_radius)

    def carried(self, sensors: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the normal force of the ground on each foot, without adhesion, (..., leg) [g mm/s^2].

        The force is negative where adhesion holds a foot that pulls.

        Args:
            sensors: `sensordata`, (..., column).
            force: forces of the actuators, (..., actuator).
        """
        touch, adhesion = sensors[..., self.columns.touch], force[..., self.columns.grasp]
        return np.where(touch > 0, touch - adhesion, touch) if adhesion.size else touch.copy()

    def inverse(self, tips: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the joint angles that put the tips at positions in the root frame, (..., leg, axis) [mm].

        Returns:
            The angles, (..., leg, joint) [rad], and whether each tip is within reach, (..., leg). The angles are NaN
            where the length of the leg or the ranges of its joints put the tip out of reach.
        """
        return self.kinematics.inverse(tips)

    def forward(self, joints: ArrayLike) -> np.ndarray:
        """Return the tips in the root frame, (..., leg, axis) [mm], at joint angles, (..., leg, joint) [rad]."""
        return self.kinematics.forward(joints)


def add_sensors(spec: mujoco.MjSpec, body: Body, pushes: bool) -> None:
    """Replace the sensors of a spec by sensors in the order of `Columns`; `pushes` says whether to add `feet_push`."""
    sensor, objects, field = mujoco.mjtSensor, mujoco.mjtObj, mujoco.mjtConDataField
    count, net_force = [1 << field.mjCONDATA_FOUND.value, 0, 1], [1 << field.mjCONDATA_FORCE.value, 3, 1]
    for own in list(spec.sensors):
        spec.delete(own)
    for foot in body.feet:
        spec.add_sensor(name=foot, type=sensor.mjSENS_FRAMEPOS, objtype=objects.mjOBJ_SITE, objname=foot)
    for leg, foot in zip(LEGS, body.feet, strict=True):
        spec.add_sensor(name=f"{leg}_touch", type=sensor.mjSENS_TOUCH, objtype=objects.mjOBJ_SITE, objname=foot)
    contact: Any = {"type": sensor.mjSENS_CONTACT, "objtype": objects.mjOBJ_GEOM}
    for part in body.trunk:
        spec.add_sensor(name=f"{part}_ground", objname=part, intprm=count, **contact)
    root: Any = {"objtype": objects.mjOBJ_BODY, "objname": body.root}
    spec.add_sensor(name="centre_of_mass", type=sensor.mjSENS_SUBTREECOM, **root)
    for leg, foot in zip(LEGS, body.feet, strict=True) if pushes else ():
        spec.add_sensor(name=f"{leg}_push", objname=foot, intprm=net_force, **contact)


def _columns(model: mujoco.MjModel, body: Body) -> Columns:
    """Return the columns of the joints, and of the sensors that `add_sensors` adds."""
    joints, trunk = len(body.joints), len(body.trunk)
    return Columns(
        qpos=slice(ROOT_QPOS, ROOT_QPOS + joints),
        qvel=slice(ROOT_QVEL, ROOT_QVEL + joints),
        ctrl=slice(0, joints),
        grasp=slice(joints, model.nu),
        foot=slice(0, 18),
        touch=slice(18, 24),
        trunk=slice(24, 24 + trunk),
        centre_of_mass=slice(24 + trunk, 27 + trunk),
        feet_push=slice(27 + trunk, model.nsensordata),
    )


def _trunk_corners(model: mujoco.MjModel, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return `CompiledBody.trunk_corners`: ends of capsules, centres of spheres and corners of boxes, with radii."""
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
            raise InputError(f"body {body.name!r}: trunk part {part!r} must be a capsule, a sphere or a box")
        ends.append(data.geom_xpos[geom] + corners @ axes.T)
        radii += len(corners) * [radius]
    return np.concatenate(ends), np.array(radii)
