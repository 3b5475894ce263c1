"""A compiled body: its model, the columns of its joints and sensors, its kinematics and its measures."""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hexmj.bodies.ground import depth_in_ground
from hexmj.bodies.kinematics import HingeChains, ThreeHinges, kinematics, posed
from hexmj.body import ROOT_QPOS, ROOT_QVEL, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS

_COUNTS = (1 << mujoco.mjtConDataField.mjCONDATA_FOUND.value, 0, 1)
"""`intprm` of a contact sensor that counts contacts, in one number."""

_NET_FORCE = (1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, 3, 1)
"""`intprm` of a contact sensor that adds up the forces of all contacts, in the world."""


@dataclass(frozen=True)
class SensorGroup:
    """Sensors of one kind that are adjacent in `sensordata`."""

    kind: mujoco.mjtSensor
    """MuJoCo's type of the sensors."""
    object_type: mujoco.mjtObj
    """Type of the objects to which they are attached."""
    objects: tuple[str, ...]
    """Names of these objects, one for each sensor."""
    names: tuple[str, ...]
    """Names of the sensors that are added."""
    contact: tuple[int, int, int] | None = None
    """`intprm` of contact sensors."""
    optional: bool = False
    """Added only if the forces of the feet are measured; without them it has no columns."""

    def find(self, model: mujoco.MjModel) -> slice | None:
        """Find the sensors' columns of `sensordata`, or None if the model does not have them side by side."""
        objects = np.array([mujoco.mj_name2id(model, self.object_type, name) for name in self.objects])
        fits = (model.sensor_type == self.kind) & (model.sensor_objtype == self.object_type) & (model.sensor_refid < 0)
        fits &= model.sensor_cutoff == 0
        if self.contact:
            fits &= (model.sensor_intprm[:, :3] == self.contact).all(axis=1)
        attached = np.where(fits, model.sensor_objid, -1)
        for first in range(model.nsensor - len(objects) + 1):
            last = first + len(objects) - 1
            if (attached[first : last + 1] == objects).all():
                return slice(int(model.sensor_adr[first]), int(model.sensor_adr[last] + model.sensor_dim[last]))
        return None


def sensor_groups(body: Body) -> dict[str, SensorGroup]:
    """The sensors of a walk, by the name of their field in `Columns`."""
    sensor, objects = mujoco.mjtSensor, mujoco.mjtObj
    site, geom, root = objects.mjOBJ_SITE, objects.mjOBJ_GEOM, objects.mjOBJ_BODY
    touches, grounds = tuple(f"{leg}_touch" for leg in LEGS), tuple(f"{part}_ground" for part in body.trunk)
    contact, pushes = sensor.mjSENS_CONTACT, tuple(f"{leg}_push" for leg in LEGS)
    return {
        "foot": SensorGroup(sensor.mjSENS_FRAMEPOS, site, body.feet, body.feet),
        "touch": SensorGroup(sensor.mjSENS_TOUCH, site, body.feet, touches),
        "trunk": SensorGroup(contact, geom, body.trunk, grounds, _COUNTS),
        "centre_of_mass": SensorGroup(sensor.mjSENS_SUBTREECOM, root, (body.root,), ("centre_of_mass",)),
        "feet_push": SensorGroup(contact, geom, body.feet, pushes, _NET_FORCE, optional=True),
    }


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
        """Read the other fields from a model."""
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


def _columns(model: mujoco.MjModel, body: Body) -> Columns:
    """Find the joints and sensors of a model."""
    found = {}
    for name, group in sensor_groups(body).items():
        columns = group.find(model) or (slice(0, 0) if group.optional else None)
        if columns is None:
            raise InputError(f"body {body.name!r}: its sensors {', '.join(group.names)} do not measure {name}")
        found[name] = columns
    joints = len(body.joints)
    return Columns(
        qpos=slice(ROOT_QPOS, ROOT_QPOS + joints),
        qvel=slice(ROOT_QVEL, ROOT_QVEL + joints),
        ctrl=slice(0, joints),
        grasp=slice(joints, model.nu),
        **found,
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
