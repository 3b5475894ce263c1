"""From a body's MJCF to the model that walks: loading, additions, gains, ground, load and adhesion.

An MJCF may lack servos, contact pairs and sensors, and may name MuJoCo's explicit integrator; these are added or
replaced. Nothing is added to the stick insect's.

Torque limit of the servos: one leg alone carries the whole weight W where its lever is longest, so it is W times that
lever. The lever of a hinge is the length of the leg from it to the foot, times the horizontal share of its axis in
posture home: a vertical hinge carries no weight.

Stiffness of the servos: as much as a step h allows for the lightest joint of a leg, whose inertia about its axis, with
the armature, is I. An undamped servo of stiffness k oscillates with omega^2 = k / I; on the mean over the legs
(omega h)^2 is 1, so k = 1 / (h^2 mean(1 / I)). The damping is integrated implicitly, so it sets no limit.

Both are rounded to the significant digits of the body's `servo`: 398728 and 1.5384e6 to 4.0e5 g mm^2/s^2 and
1.5e6 g mm^2/s^2/rad for the stick insect (lever 40.645 mm; knees of 1.733, 1.327 and 1.615 g mm^2).
"""

import copy
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody, SensorGroup, sensor_groups
from hexmj.bodies.ground import lay_ground
from hexmj.bodies.kinematics import joint_numbers, posed, segments
from hexmj.bodies.validation import check_described, check_finished
from hexmj.body import Body
from hexmj.conditions import ROUNDING, Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS

HOME_TOLERANCE = 1e-3
"""Tolerance of the feet and the centre of mass in posture home, in lengths of the shortest leg."""


class Gains(NamedTuple):
    """Gains of the servos, the same for all joints of a body."""

    torque: float
    """Greatest torque [g mm^2/s^2]."""
    stiffness: float
    """Torque per angle off the target [g mm^2/s^2/rad]."""
    damping_ratio: float
    """1 is critical; MuJoCo computes the damping of each joint from it when it compiles."""


def compile_body(
    conditions: Conditions, timestep: float | None = None, *, looks: bool = True, pushes: bool = False
) -> CompiledBody:
    """Compile the body of some conditions; every call returns a model of its own.

    Args:
        conditions: give the body, its masses, the contact of the feet and the ground.
        timestep: integration step [s], at most the longest one for which the body's gains and contacts are made,
            which is the default.
        looks: with the geoms that are only visual; without them it walks to the same bits, 2 % faster.
        pushes: with sensors of the forces of the feet on the ground; without them it walks to the same bits, faster.

    Raises:
        InputError: the time step is out of range, or the body's MJCF is not as described.
    """
    body = conditions.body
    timestep = body.longest_step if timestep is None else timestep
    if not 0 < timestep <= body.longest_step * (1.0 + ROUNDING):
        raise InputError(f"timestep = {timestep} s; expected above 0 and at most {body.longest_step} s")
    compiled = _compiled(conditions, looks, pushes, body.mjcf.read_bytes())
    model = copy.copy(compiled.model)
    model.opt.timestep = timestep
    return replace(compiled, model=model)


def plain_model(body: Body) -> mujoco.MjModel:
    """Compile the MJCF of a body as it is; the model is shared and must not be changed.

    Raises:
        InputError: it does not compile, or is not as described.
    """
    return _plain_model(body, body.mjcf.read_bytes())


def gravity(body: Body) -> float:
    """Acceleration of gravity where a body walks [mm/s^2]."""
    return -float(plain_model(body).opt.gravity[2])


def gains(model: mujoco.MjModel, body: Body) -> Gains:
    """The gains for a compiled body without load."""
    servo, weight = body.servo, -body.mass * float(model.opt.gravity[2])
    inertia = model.dof_M0[model.jnt_dofadr[joint_numbers(model, body)]]
    lightest = inertia.min(axis=1)  # (leg,)
    return Gains(
        torque=_rounded(weight * longest_lever(model, body), servo.digits),
        stiffness=_rounded(1.0 / (servo.step**2 * (1.0 / lightest).mean()), servo.digits),
        damping_ratio=servo.damping_ratio,
    )


def longest_lever(model: mujoco.MjModel, body: Body) -> float:
    """The longest lever with which the weight, on one foot, can turn a joint [mm]."""
    data, joints = posed(model, model.key(body.home).qpos), joint_numbers(model, body)
    length = np.cumsum(segments(model, body)[:, ::-1], axis=1)[:, ::-1]
    horizontal = np.linalg.norm(data.xaxis[joints][..., :2], axis=-1)
    return float((length * horizontal).max())


def check_home(compiled: CompiledBody) -> None:
    """Check the feet and the centre of mass of a body in posture home.

    The centre of mass must be at O, unless `Conditions.centre_of_mass` says how far ahead it is.

    Raises:
        InputError: one of them is elsewhere.
    """
    body, tolerance = compiled.body, HOME_TOLERANCE * compiled.body.lengths.shortest_leg
    tips = compiled.forward(compiled.home[compiled.columns.qpos].reshape(6, -1))
    expected = np.stack([body.lines.origin, body.lines.y, 6 * [-body.standing_height]], axis=-1)
    off = np.abs(tips - expected).max(axis=1)
    if off.max() > tolerance:
        leg = int(np.argmax(off))
        raise InputError(
            f"body {body.name!r}: in posture {body.home!r} foot {body.feet[leg]!r} is at {tips[leg].round(3).tolist()}"
            f" mm; expected {expected[leg].tolist()}, the origin of its line at the standing height below the root"
        )
    ahead, left, _ = _described_centre(body, body.mjcf.read_bytes())
    if compiled.conditions.centre_of_mass == 0.0 and abs(ahead) > tolerance:
        raise InputError(
            f"body {body.name!r}: in posture {body.home!r} the centre of mass is {ahead:.4g} mm ahead of O; expected 0,"
            f" or Conditions(centre_of_mass={ahead:.4g}) to leave it there"
        )
    if abs(left) > tolerance:
        raise InputError(
            f"body {body.name!r}: in posture {body.home!r} the centre of mass is {left:.4g} mm left of O; expected 0"
        )


@lru_cache(maxsize=16)
def _plain_model(body: Body, mjcf: bytes) -> mujoco.MjModel:
    """See `plain_model`; `mjcf` holds the file's content, so that an edited file is compiled again."""
    try:
        model = _spec(body).compile()
    except ValueError as error:
        raise InputError(f"body {body.name!r}: {body.mjcf} does not compile: {' '.join(str(error).split())}") from None
    check_described(model, body)
    return model


@lru_cache(maxsize=16)
def _described_centre(body: Body, mjcf: bytes) -> np.ndarray:
    """Centre of mass of the MJCF as it is, see `_centre_of_mass`."""
    return _centre_of_mass(_plain_model(body, mjcf), body)


@lru_cache(maxsize=16)
def _compiled(conditions: Conditions, looks: bool, pushes: bool, mjcf: bytes) -> CompiledBody:
    """See `compile_body`."""
    body = conditions.body
    plain, spec = _plain_model(body, mjcf), _spec(body)
    spec.compiler.discardvisual = not looks
    try:
        _add_missing(spec, plain, body, pushes)
        lay_ground(spec, conditions)
        if conditions.load:
            _add_load(spec, body, conditions.load)
        if conditions.grasp:
            _add_grasp(spec, body, conditions.grasp * body.mass * gravity(body))
        model = spec.compile()
    except ValueError as error:
        raise InputError(f"body {body.name!r} cannot be compiled: {' '.join(str(error).split())}") from None
    model.pair_friction[:, :2] = conditions.friction
    feet = [model.site(foot).id for foot in body.feet]
    model.site_type[feet], radius = mujoco.mjtGeom.mjGEOM_SPHERE, model.geom(body.feet[0]).size[0]
    model.site_size[feet, 0] = radius + radius / 10  # a touch sensor sees only contacts within its site
    check_finished(model, body)
    if conditions.leg_mass != 1.0 or conditions.centre_of_mass != 0.0:
        _redistribute(model, conditions)
    return CompiledBody.of(model, conditions)


def _spec(body: Body) -> mujoco.MjSpec:
    """The spec of a body's MJCF, whose inertias do not depend on its visual geoms."""
    spec = mujoco.MjSpec.from_file(str(body.mjcf))
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        # Write the same inertias explicitly, so that the compiler may discard visual geoms.
        model = spec.compile()
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
        for part in spec.bodies[1:]:
            part.mass, part.ipos = model.body_mass[part.id], model.body_ipos[part.id]
            part.iquat, part.inertia = model.body_iquat[part.id], model.body_inertia[part.id]
            part.explicitinertial = True
    return spec


def _add_missing(spec: mujoco.MjSpec, plain: mujoco.MjModel, body: Body, pushes: bool) -> None:
    """Add servos, contact pairs and sensors that the MJCF lacks; only feet and trunk touch the ground.

    Args:
        spec: of the body's MJCF.
        plain: the same MJCF, compiled.
        body: its description.
        pushes: with sensors of the forces of the feet on the ground.
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
    servo_gains = gains(plain, body)
    for servo in _servos(spec, body):
        servo.set_to_position(kp=servo_gains.stiffness, dampratio=servo_gains.damping_ratio)
        servo.armature *= servo.gear[0] ** 2  # the motor's inertia at the joint
        servo.forcerange, servo.gear = [-servo_gains.torque, servo_gains.torque], [1.0] + 5 * [0.0]
        servo.ctrlrange, servo.inheritrange = [0.0, 0.0], 1.0  # the joint's own range
        servo.forcelimited = servo.ctrllimited = True
        servo.actrange, servo.actlimited = [0.0, 0.0], False
    for group in sensor_groups(body).values():
        if group.find(plain) is None and (pushes or not group.optional):
            _add_sensors(spec, group)


def _servos(spec: mujoco.MjSpec, body: Body) -> Iterator[mujoco.MjsActuator]:
    """The actuators of the joints; they are added if the MJCF has none."""
    if spec.actuators:
        yield from spec.actuators
    else:
        for joint in body.joints:
            yield spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)


def _add_sensors(spec: mujoco.MjSpec, group: SensorGroup) -> None:
    taken = {sensor.name for sensor in spec.sensors}
    for name, target in zip(group.names, group.objects, strict=True):
        name = f"{name}_measured" if name in taken else name
        sensor = spec.add_sensor(name=name, type=group.kind, objtype=group.object_type, objname=target)
        if group.contact:
            sensor.intprm[:3] = group.contact


def _add_load(spec: mujoco.MjSpec, body: Body, load: float) -> None:
    """Let the root carry a load, in multiples of the body's own mass."""
    mass = load * body.mass
    part = spec.body(body.root).add_body(name="load", mass=mass, inertia=3 * [body.lengths.load_gyration**2 * mass])
    part.explicitinertial = True


def _add_grasp(spec: mujoco.MjSpec, body: Body, force: float) -> None:
    """Add adhesion to the feet, each with a force [g mm/s^2] times its actuator's 0 to 1."""
    for name, foot in zip(LEGS, body.feet, strict=True):
        spec.add_actuator(
            name=f"{name}_grasp",
            trntype=mujoco.mjtTrn.mjTRN_BODY,
            target=spec.geom(foot).parent.name,
            gainprm=[force] + 9 * [0.0],
            ctrllimited=True,
            ctrlrange=[0.0, 1.0],
        )


def _redistribute(model: mujoco.MjModel, conditions: Conditions) -> None:
    """Give the legs their share of the mass, and move the trunk's masses to put the centre of mass in its place."""
    body = conditions.body
    legs = [model.body(part).id for leg in body.legs for part in leg.parts]
    trunk = [model.body(part).id for part in body.trunk]
    in_legs, in_trunk = model.body_mass[legs].sum(), model.body_mass[trunk].sum()
    if not in_legs * conditions.leg_mass < in_legs + in_trunk:
        most = 1.0 + in_trunk / in_legs
        raise InputError(
            f"leg_mass = {conditions.leg_mass:g}; expected below {most:.4g}, the whole mass of body {body.name!r}"
        )
    for parts, factor in (
        (legs, conditions.leg_mass),
        (trunk, 1.0 + in_legs / in_trunk * (1.0 - conditions.leg_mass)),
    ):
        model.body_mass[parts] *= factor
        model.body_inertia[parts] *= factor
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    offset = conditions.centre_of_mass - _centre_of_mass(model, body)[0]
    in_all = np.where(model.body_rootid == model.body(body.root).id, model.body_mass, 0.0).sum()
    ahead = posed(model, model.qpos0).xmat[trunk, :3]  # the root's x in the frame of each part
    model.body_ipos[trunk] += offset * in_all / model.body_mass[trunk].sum() * ahead
    mujoco.mj_setConst(model, data)


def _centre_of_mass(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """Centre of mass in posture home, in the root's frame (x ahead, y to the left, z up), (axis,) [mm]."""
    data = posed(model, model.key(body.home).qpos)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[model.body(body.root).id].copy()


def _rounded(value: float, digits: int) -> float:
    """Round to significant digits."""
    return float(f"{value:.{digits - 1}e}")
