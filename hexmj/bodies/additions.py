"""What a body's MJCF may lack is added as it is compiled: an implicit integrator, servos, pairs that touch, sensors.

Nothing is added to an MJCF that has it all, as the stick insect's.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from hexmj.bodies.gains import Gains
from hexmj.body import Body
from hexmj.legs import LEGS

_SENSOR, _OBJECT = mujoco.mjtSensor, mujoco.mjtObj

_COUNTS = (1 << mujoco.mjtConDataField.mjCONDATA_FOUND.value, 0, 1)
"""Of a contact sensor that counts contacts, in one number."""

_NET_FORCE = (1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, 3, 1)
"""Of one that adds up the forces of all contacts, in the world."""


@dataclass(frozen=True)
class SensorGroup:
    """Sensors of one kind that lie side by side in `sensordata`."""

    kind: mujoco.mjtSensor
    of: mujoco.mjtObj
    """What they are attached to."""
    objects: tuple[str, ...]
    """Names of that, one for each sensor."""
    names: tuple[str, ...]
    """Of the sensors where they are added."""
    contact: tuple[int, int, int] | None = None
    """What contact sensors tell, see MuJoCo's `intprm`."""
    optional: bool = False
    """Added only where the forces of feet are asked for; elsewhere it has no columns."""

    def find(self, model: mujoco.MjModel) -> slice | None:
        """Their columns of `sensordata`; none where the model lacks them, has them in another order, or alters what
        they show."""
        wanted = np.array([mujoco.mj_name2id(model, self.of, name) for name in self.objects])
        fits = (model.sensor_type == self.kind) & (model.sensor_objtype == self.of) & (model.sensor_refid < 0)
        for altered in (model.sensor_cutoff, model.sensor_noise, model.sensor_delay, model.sensor_interval[:, 0]):
            fits &= altered == 0
        if self.contact:
            fits &= (model.sensor_intprm[:, :3] == self.contact).all(axis=1)
        there = np.where(fits, model.sensor_objid, -1)
        for first in range(model.nsensor - len(wanted) + 1):
            last = first + len(wanted) - 1
            if (there[first : last + 1] == wanted).all():
                return slice(int(model.sensor_adr[first]), int(model.sensor_adr[last] + model.sensor_dim[last]))
        return None


def sensor_groups(body: Body) -> dict[str, SensorGroup]:
    """The sensors that walks are measured with, by what they measure."""
    touches, grounds = tuple(f"{leg}_touch" for leg in LEGS), tuple(f"{part}_ground" for part in body.trunk)
    contact, geom, pushes = _SENSOR.mjSENS_CONTACT, _OBJECT.mjOBJ_GEOM, tuple(f"{leg}_push" for leg in LEGS)
    return {
        "foot": SensorGroup(_SENSOR.mjSENS_FRAMEPOS, _OBJECT.mjOBJ_SITE, body.feet, body.feet),
        "touch": SensorGroup(_SENSOR.mjSENS_TOUCH, _OBJECT.mjOBJ_SITE, body.feet, touches),
        "trunk": SensorGroup(contact, geom, body.trunk, grounds, _COUNTS),
        "centre_of_mass": SensorGroup(_SENSOR.mjSENS_SUBTREECOM, _OBJECT.mjOBJ_BODY, (body.root,), ("centre_of_mass",)),
        "feet_push": SensorGroup(contact, geom, body.feet, pushes, _NET_FORCE, optional=True),
    }


def complete(spec: mujoco.MjSpec, plain: mujoco.MjModel, body: Body, gains: Gains, pushes: bool) -> None:
    """Make a spec walk: servos with these gains at the joints, nothing that touches but feet and trunk the ground.

    Where the integrator is Euler's, which is MuJoCo's own if none is told, damping is integrated implicitly instead.
    The spec is as the body's MJCF says, and `plain` is the same, compiled.
    """
    if spec.option.integrator == mujoco.mjtIntegrator.mjINT_EULER:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    paired = [{pair.geomname1, pair.geomname2} for pair in spec.pairs]
    for touching in (*body.trunk, *body.feet):
        if {body.ground, touching} not in paired:
            pair = spec.add_pair(name=f"{body.ground}_{touching}", geomname1=body.ground, geomname2=touching)
            pair.condim, pair.solref = 3, [2 * body.longest_step, 1.0]
    for servo in _servos(spec, body):
        servo.set_to_position(kp=gains.stiffness, dampratio=gains.damping_ratio)
        servo.armature *= servo.gear[0] ** 2  # the inertia that the joint has of it
        servo.forcerange, servo.gear = [-gains.torque, gains.torque], [1.0] + 5 * [0.0]
        servo.ctrlrange, servo.inheritrange = [0.0, 0.0], 1.0  # the joint's own range
        servo.forcelimited = servo.ctrllimited = True
        servo.actrange, servo.actlimited = [0.0, 0.0], False
    for group in sensor_groups(body).values():
        if group.find(plain) is None and (pushes or not group.optional):
            _add_sensors(spec, group)


def _servos(spec: mujoco.MjSpec, body: Body) -> Iterator[mujoco.MjsActuator]:
    """The actuators of the joints, added where there is none."""
    if spec.actuators:
        yield from spec.actuators
    else:
        for joint in body.joints:
            yield spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)


def _add_sensors(spec: mujoco.MjSpec, group: SensorGroup) -> None:
    taken = {sensor.name for sensor in spec.sensors}
    for name, of in zip(group.names, group.objects, strict=True):
        name = f"{name}_measured" if name in taken else name
        sensor = spec.add_sensor(name=name, type=group.kind, objtype=group.of, objname=of)
        if group.contact:
            sensor.intprm[:3] = group.contact
