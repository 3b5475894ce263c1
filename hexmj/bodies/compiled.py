"""A compiled body: its model, the columns of its joints and sensors, its kinematics and its measures."""

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
    """Of `qpos`: angles of the joints, leg by leg, each leg's from the body outwards [rad]."""
    qvel: slice
    """Of `qvel` and other arrays over the degrees of freedom: velocities of the joints [rad/s]."""
    ctrl: slice
    """Of `ctrl` and other arrays over the actuators: targets of the joints [rad]."""
    grasp: slice
    """Of `ctrl`: adhesion of each foot, 0 to 1, (..., leg); empty without adhesion."""
    foot: slice
    """Of `sensordata`: feet in the world, (..., leg * axis) [mm]; reshape to (leg, 3)."""
    touch: slice
    """Of `sensordata`: normal force of the ground on each foot, (..., leg) [g mm/s^2]."""
    trunk: slice
    """Of `sensordata`: number of contacts of each part of the trunk, (..., part)."""
    centre_of_mass: slice
    """Of `sensordata`: centre of mass of the whole body in the world, (..., axis) [mm]."""
    feet_push: slice
    """Of `sensordata`: force of each foot on the ground in the world, (..., leg * axis) [g mm/s^2]; empty if it is not
    measured."""


@dataclass(frozen=True, eq=False)
class CompiledBody:
    """A body under some conditions, ready to walk."""

    model: mujoco.MjModel
    """The caller's own."""
    conditions: Conditions
    """Those it was compiled for."""
    columns: Columns
    """Columns of its joints and sensors."""
    kinematics: ThreeHinges | HingeChains
    """In closed form if its legs have one, else numeric."""
    foot_radius: float
    """Height of a standing foot's tip over the ground [mm]."""
    trunk_corners: tuple[np.ndarray, np.ndarray]
    """Corners of the trunk in the root frame, (corner, axis) [mm], and its thickness there, (corner,) [mm]."""
    home: np.ndarray
    """`qpos` in posture home, (position,)."""

    @classmethod
    def of(cls, model: mujoco.MjModel, conditions: Conditions) -> "CompiledBody":
        """Read the other fields from a model with the sensors of `add_sensors`."""
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
        """Its description."""
        return self.conditions.body

    @property
    def joints(self) -> int:
        """Number of joints of all legs."""
        return len(self.body.joints)

    @property
    def root(self) -> int:
        """MuJoCo's index of the root."""
        return int(self.model.jnt_bodyid[0])

    @property
    def weight(self) -> float:
        """Weight of the body itself, without its load [g mm/s^2]."""
        return -self.body.mass * float(self.model.opt.gravity[2])

    @property
    def torque_limits(self) -> np.ndarray:
        """Greatest torque of each joint, (leg * joint,) [g mm^2/s^2]."""
        return self.model.actuator_forcerange[self.columns.ctrl, 1]

    def depth(self, feet: np.ndarray) -> np.ndarray:
        """Depth of feet in the world, (..., axis) [mm], in the ground, (...) [mm]; negative above it."""
        return depth_in_ground(self.conditions, feet, self.foot_radius)

    def carried(self, sensors: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Force of the ground on each foot along its normal without adhesion, (..., leg) [g mm/s^2].

        It is below 0 where adhesion holds a foot that pulls.

        Args:
            sensors: `sensordata`, (..., column).
            force: of the actuators, (..., actuator).
        """
        touch, adhesion = sensors[..., self.columns.touch], force[..., self.columns.grasp]
        return np.where(touch > 0, touch - adhesion, touch) if adhesion.size else touch.copy()

    def inverse(self, tips: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles that put the tips at these places in the root frame, (..., leg, axis) [mm].

        Returns:
            The angles, (..., leg, joint) [rad], NaN where a tip is out of reach of the legs' lengths or the joints'
            ranges, and whether it is within reach, (..., leg).
        """
        return self.kinematics.inverse(tips)

    def forward(self, joints: ArrayLike) -> np.ndarray:
        """Tips in the root frame, (..., leg, axis) [mm], at joint angles, (..., leg, joint) [rad]."""
        return self.kinematics.forward(joints)


def add_sensors(spec: mujoco.MjSpec, body: Body, pushes: bool) -> None:
    """Replace the sensors of a spec by those of a walk, in the order of `Columns`, `feet_push` only with `pushes`."""
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
    """Columns of the joints, and of the sensors that `add_sensors` adds."""
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
    """Ends of the trunk's capsules, centres of its spheres and corners of its boxes, see `CompiledBody`."""
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
