"""From a body's MJCF to the model that walks: loading, additions, gains, ground, load and adhesion.

An MJCF may lack servos and contact pairs, and may name MuJoCo's explicit integrator; these are added or replaced, and
sensors are always hexmj's own. Nothing changes the stick insect's.

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
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody, add_sensors
from hexmj.bodies.ground import lay_ground
from hexmj.bodies.kinematics import joint_numbers, posed
from hexmj.bodies.validation import check
from hexmj.body import Body
from hexmj.conditions import ROUNDING, Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS

HOME_TOLERANCE = 1e-3
"""Tolerance of the feet and the centre of mass in posture home, in lengths of the shortest leg."""


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


def gains(model: mujoco.MjModel, body: Body) -> tuple[float, float]:
    """Gains of a compiled body without load, the same for all joints.

    Returns:
        Torque limit [g mm^2/s^2], and stiffness, torque per angle off the target [g mm^2/s^2/rad].
    """
    data, joints, servo = posed(model, model.key(body.home).qpos), joint_numbers(model, body), body.servo
    feet = data.site_xpos[[model.site(foot).id for foot in body.feet]]
    places = np.concatenate([data.xanchor[joints], feet[:, None]], axis=1)  # (leg, joint + 1, axis)
    segments = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    length = np.cumsum(segments[:, ::-1], axis=1)[:, ::-1]
    lever = (length * np.linalg.norm(data.xaxis[joints][..., :2], axis=-1)).max()
    lightest = model.dof_M0[model.jnt_dofadr[joints]].min(axis=1)  # inertia, (leg,)
    torque, stiffness = body.mass * -model.opt.gravity[2] * lever, 1.0 / (servo.step**2 * (1.0 / lightest).mean())
    return float(f"{torque:.{servo.digits - 1}e}"), float(f"{stiffness:.{servo.digits - 1}e}")


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
    ahead, left, _ = _centre_of_mass(plain_model(body), body)
    where = f"body {body.name!r}: in posture {body.home!r} the centre of mass is"
    if compiled.conditions.centre_of_mass == 0.0 and abs(ahead) > tolerance:
        remedy = f"Conditions(centre_of_mass={ahead:.4g}) to leave it there"
        raise InputError(f"{where} {ahead:.4g} mm ahead of O; expected 0, or {remedy}")
    if abs(left) > tolerance:
        raise InputError(f"{where} {left:.4g} mm left of O; expected 0")


@lru_cache(maxsize=16)
def _plain_model(body: Body, mjcf: bytes) -> mujoco.MjModel:
    """See `plain_model`; `mjcf` holds the file's content, so that an edited file is compiled again."""
    try:
        model = mujoco.MjModel.from_xml_path(str(body.mjcf))
    except ValueError as error:
        raise InputError(f"body {body.name!r}: {body.mjcf} does not compile: {' '.join(str(error).split())}") from None
    check(model, body)
    return model


@lru_cache(maxsize=16)
def _compiled(conditions: Conditions, looks: bool, pushes: bool, mjcf: bytes) -> CompiledBody:
    """See `compile_body`."""
    body = conditions.body
    plain, spec = _plain_model(body, mjcf), mujoco.MjSpec.from_file(str(body.mjcf))
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    spec.compiler.discardvisual = not (looks or from_geoms)
    try:
        _add_missing(spec, plain, body)
        add_sensors(spec, body, pushes)
        lay_ground(spec, conditions)
        if conditions.load:
            mass = conditions.load * body.mass
            part = spec.body(body.root).add_body(name="load", mass=mass)
            part.inertia, part.explicitinertial = 3 * [body.lengths.load_gyration**2 * mass], True
        grasp = conditions.grasp * body.mass * gravity(body)
        for name, foot in zip(LEGS, body.feet, strict=True) if grasp else ():
            adhesion = spec.add_actuator(name=f"{name}_grasp", trntype=mujoco.mjtTrn.mjTRN_BODY)
            adhesion.target, adhesion.gainprm[0] = spec.geom(foot).parent.name, grasp
            adhesion.ctrllimited, adhesion.ctrlrange = True, [0.0, 1.0]
        model = spec.compile()
    except ValueError as error:
        raise InputError(f"body {body.name!r} cannot be compiled: {' '.join(str(error).split())}") from None
    model.pair_friction[:, :2] = conditions.friction
    feet = [model.site(foot).id for foot in body.feet]
    model.site_type[feet], radius = mujoco.mjtGeom.mjGEOM_SPHERE, model.geom(body.feet[0]).size[0]
    model.site_size[feet, 0] = radius + radius / 10  # a touch sensor sees only contacts within its site
    check(model, body, finished=True)
    if conditions.leg_mass != 1.0 or conditions.centre_of_mass != 0.0:
        _redistribute(model, conditions)
    return CompiledBody.of(model, conditions)


def _add_missing(spec: mujoco.MjSpec, plain: mujoco.MjModel, body: Body) -> None:
    """Add servos and contact pairs that the MJCF lacks; only feet and trunk touch the ground.

    Args:
        spec: of the body's MJCF.
        plain: the same MJCF, compiled.
        body: its description.
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
    torque, stiffness = gains(plain, body)
    for joint in () if spec.actuators else body.joints:
        spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    for servo in spec.actuators:
        servo.set_to_position(kp=stiffness, dampratio=body.servo.damping_ratio)
        servo.armature *= servo.gear[0] ** 2  # the motor's inertia at the joint
        servo.forcerange, servo.gear = [-torque, torque], [1.0] + 5 * [0.0]
        servo.ctrlrange, servo.inheritrange = [0.0, 0.0], 1.0  # the joint's own range
        servo.forcelimited = servo.ctrllimited = True
        servo.actrange, servo.actlimited = [0.0, 0.0], False


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
