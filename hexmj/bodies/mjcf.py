"""Compilation of a body's MJCF into the model that walks, with gains, ground, load and adhesion.

If an MJCF lacks servos or contact pairs, hexmj adds them. MuJoCo's explicit integrator is replaced by an implicit one,
and the MJCF's sensors by hexmj's. The stick insect's MJCF already has the right servos, pairs and integrator.

Torque limit of the servos: weight of the body times the longest lever, so that any leg alone can carry the body. The
lever of a hinge is the length of the leg from the hinge to the foot, times the horizontal share of the hinge's axis in
posture home: a vertical hinge carries no weight.

Stiffness of the servos: the greatest that a time step h allows for the lightest joint of a leg, whose inertia about its
axis, armature included, is I. An undamped servo of stiffness k oscillates with omega^2 = k / I. On average over the
legs (omega h)^2 is 1, so k = 1 / (h^2 mean(1 / I)). The damping is integrated implicitly, so it sets no limit.

Both gains are rounded to `Servo.digits`. For the stick insect, 398728 becomes 4.0e5 g mm^2/s^2 and 1.5384e6 becomes
1.5e6 g mm^2/s^2/rad (lever 40.645 mm; inertias of the knees 1.733, 1.327 and 1.615 g mm^2).
"""

import copy
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody, add_sensors
from hexmj.bodies.ground import lay_ground
from hexmj.bodies.kinematics import hinge_chains, joint_numbers, posed
from hexmj.body import Body, Leg
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS

HOME_TOLERANCE = 1e-3
"""Tolerance of the positions of feet and centre of mass in posture home, in lengths of the shortest leg."""

LEG_TOLERANCE = 1.5
"""Maximum factor between `Lengths.shortest_leg` and the shortest leg of the MJCF."""

LEAST_GRAVITY = 100.0
"""Minimum gravity, a sixteenth of the moon's [mm/s^2]; a smaller value is taken for one in m/s^2."""

MASS_TOLERANCE = 1e-3
"""Maximum relative difference between the mass of the model and `Body.mass`."""


def compile_body(
    conditions: Conditions, timestep: float | None = None, *, looks: bool = True, pushes: bool = False
) -> CompiledBody:
    """Return the body compiled for some conditions; every call returns a new model.

    Args:
        conditions: body, masses, contact of the feet, and ground.
        timestep: physics step [s], at most `Body.longest_step`, which is the default.
        looks: whether to keep geoms that are only visual; without them it walks 2 % faster, to the same bits.
        pushes: whether to add sensors of the feet's forces; without them it walks faster, to the same bits.

    Raises:
        InputError: the MJCF does not fit the description of the body.
    """
    body = conditions.body
    compiled = _compiled(conditions, looks, pushes, body.mjcf.read_bytes())
    model = copy.copy(compiled.model)
    model.opt.timestep = timestep or body.longest_step
    return replace(compiled, model=model)


def plain_model(body: Body) -> mujoco.MjModel:
    """Return the model of a body's unchanged MJCF; it is cached and shared, so callers must not change it.

    Raises:
        InputError: the MJCF does not compile, or does not fit the description of the body.
    """
    return _plain_model(body, body.mjcf.read_bytes())


def gravity(body: Body) -> float:
    """Return the acceleration of gravity in a body's MJCF [mm/s^2], positive downwards."""
    return -float(plain_model(body).opt.gravity[2])


def gains(model: mujoco.MjModel, body: Body) -> tuple[float, float]:
    """Return the gains of the servos of a compiled body without load; they are the same for all joints.

    Returns:
        The torque limit [g mm^2/s^2], and the stiffness: torque per distance from the target [g mm^2/s^2/rad].
    """
    data, joints, servo = posed(model, model.key(body.home).qpos), joint_numbers(model, body), body.servo
    feet = data.site_xpos[[model.site(foot).id for foot in body.feet]]
    places = np.concatenate([data.xanchor[joints], feet[:, None]], axis=1)  # (leg, joint + 1, axis)
    segments = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    length = np.cumsum(segments[:, ::-1], axis=1)[:, ::-1]
    lever = (length * np.linalg.norm(data.xaxis[joints][..., :2], axis=-1)).max()
    lightest = model.dof_M0[model.jnt_dofadr[joints]].min(axis=1)  # least inertia of its joints, (leg,)
    torque, stiffness = body.mass * -model.opt.gravity[2] * lever, 1.0 / (servo.step**2 * (1.0 / lightest).mean())
    return float(f"{torque:.{servo.digits - 1}e}"), float(f"{stiffness:.{servo.digits - 1}e}")


def check_home(compiled: CompiledBody) -> None:
    """Check the positions of the feet and of the centre of mass of a body in posture home.

    The centre of mass must be at O, unless `Conditions.centre_of_mass` moves it ahead or to the rear.

    Raises:
        InputError: a foot or the centre of mass is not at its expected position.
    """
    body, tolerance = compiled.body, HOME_TOLERANCE * compiled.body.lengths.shortest_leg
    tips = compiled.forward(compiled.home[compiled.columns.qpos].reshape(6, -1))
    expected = np.stack([body.lines.origin, body.lines.y, 6 * [-body.standing_height]], axis=-1)
    off = np.abs(tips - expected).max(axis=1)
    if off.max() > tolerance:
        leg = int(np.argmax(off))
        raise InputError(
            f"body {body.name!r}: in posture {body.home!r} foot {body.feet[leg]!r} is at {tips[leg].round(3).tolist()}"
            f"; expected {expected[leg].tolist()} mm: the origin of the foot's line, one standing height below the root"
        )
    ahead, left, _ = _centre_of_mass(plain_model(body), body)
    if abs(left) > tolerance or (compiled.conditions.centre_of_mass == 0.0 and abs(ahead) > tolerance):
        raise InputError(
            f"body {body.name!r}: in posture {body.home!r} the centre of mass is {ahead:.4g} mm ahead and {left:.4g} mm"
            f" left of O; expected O, or Conditions(centre_of_mass={ahead:.4g})"
        )


@lru_cache(maxsize=16)
def _plain_model(body: Body, mjcf: bytes) -> mujoco.MjModel:
    """Compile `plain_model`; `mjcf`, the content of the file, makes the cache compile an edited file again."""
    try:
        model = mujoco.MjModel.from_xml_path(str(body.mjcf))
    except ValueError as error:
        raise InputError(f"body {body.name!r}: {body.mjcf} does not compile: {' '.join(str(error).split())}") from None
    _check(model, body)
    return model


@lru_cache(maxsize=16)
def _compiled(conditions: Conditions, looks: bool, pushes: bool, mjcf: bytes) -> CompiledBody:
    """Compile a body for `compile_body`; `mjcf`, the content of the file, is a part of the cache's key."""
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
    model.site_size[feet, 0] = radius + radius / 10  # a touch sensor counts only contacts within its site
    if conditions.softness:
        model.pair_solref[:, 0] = conditions.softness / 1000.0
    if conditions.pitch or conditions.roll:
        model.opt.gravity[:] = np.multiply(gravity(body), conditions.down)
    if conditions.leg_mass != 1.0 or conditions.centre_of_mass != 0.0:
        _redistribute(model, conditions)
    return CompiledBody.of(model, conditions)


def _add_missing(spec: mujoco.MjSpec, plain: mujoco.MjModel, body: Body) -> None:
    """Add the servos and contact pairs that the MJCF lacks, set the gains, and remove all other contacts.

    Args:
        spec: spec of the body's MJCF, which is changed.
        plain: model of the unchanged MJCF.
        body: description of the body.
    """
    if spec.option.integrator in (mujoco.mjtIntegrator.mjINT_EULER, mujoco.mjtIntegrator.mjINT_RK4):
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
    """Scale the masses of legs and trunk to `leg_mass`, and shift those of the trunk to set `centre_of_mass`."""
    body = conditions.body
    legs = [model.body(part).id for leg in body.legs for part in leg.parts]
    trunk = [model.body(part).id for part in body.trunk]
    in_legs, in_trunk = model.body_mass[legs].sum(), model.body_mass[trunk].sum()
    if not in_legs * conditions.leg_mass < in_legs + in_trunk:
        most = 1.0 + in_trunk / in_legs
        raise InputError(f"leg_mass = {conditions.leg_mass:g} leaves the trunk no mass; expected below {most:.4g}")
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
    ahead = posed(model, model.qpos0).xmat[trunk, :3]  # the root's forward axis in the frame of each part
    model.body_ipos[trunk] += offset * in_all / model.body_mass[trunk].sum() * ahead
    mujoco.mj_setConst(model, data)


def _centre_of_mass(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """Return the centre of mass in posture home, in the root's frame (x forward, y left, z up), (axis,) [mm]."""
    data = posed(model, model.key(body.home).qpos)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[model.body(body.root).id].copy()


def _check(model: mujoco.MjModel, body: Body) -> None:
    """Check the model of an unchanged MJCF.

    Raises:
        InputError: the MJCF does not fit the description of the body.
    """
    try:
        model.key(body.home)
        for fault in _faults(model, body):
            raise InputError(f"body {body.name!r}: {fault}")
    except KeyError as error:  # an unknown name
        raise InputError(f"body {body.name!r}: {error.args[0]}") from None


def _faults(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    kinds, joints = mujoco.mjtJoint, [model.joint(i).name for i in range(1, model.njnt)]
    if model.njnt == 0 or model.jnt_type[0] != kinds.mjJNT_FREE or model.jnt_bodyid[0] != model.body(body.root).id:
        yield f"root {body.root!r} needs a free joint, which must be the first joint of the MJCF"
    if joints != list(body.joints):
        yield f"joints after the root's: {', '.join(joints)}; expected, in this order: {', '.join(body.joints)}"
    if not ((model.jnt_type == kinds.mjJNT_HINGE) & (model.jnt_limited == 1))[1:].all():
        yield "every joint of a leg must be a hinge with a range"
    driven = model.actuator_trnid[:, 0].tolist() == list(range(1, model.njnt))
    if model.nu and not (driven and (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()):
        yield f"{model.nu} actuators; expected one for each joint in the order of the joints, or none"
    if model.neq or model.ntendon or model.jnt_actfrclimited.any():
        yield "the MJCF must not have equality constraints, tendons or actuatorfrcrange (effort in a URDF)"
    gravity = model.opt.gravity
    if gravity[:2].any() or not -gravity[2] >= LEAST_GRAVITY:
        yield f"gravity = {gravity.tolist()} mm/s^2; expected a vector that points down, as (0, 0, -9810)"
    mass = model.body_subtreemass[model.body(body.root).id]
    if not abs(mass - body.mass) <= MASS_TOLERANCE * body.mass:
        yield f"mass = {body.mass:g} g; expected the mass of the MJCF, {mass:.6g} g"
    for leg in body.legs:
        yield from _leg(model, body, leg)
    if len({float(model.geom(foot).size[0]) for foot in body.feet}) > 1:
        yield "all feet must have the same radius"
    factor = hinge_chains(model, body).length.min() / body.lengths.shortest_leg
    if not 1 / LEG_TOLERANCE <= factor <= LEG_TOLERANCE:
        yield f"the shortest leg of the MJCF is not as long as shortest_leg; use lengths.scaled({factor:.3g})"
    ground = model.geom(body.ground)
    level = not (ground.bodyid[0] or ground.pos[2] or ground.quat[1:3].any())
    if ground.type[0] != mujoco.mjtGeom.mjGEOM_PLANE or not level:
        yield f"geom {body.ground!r} must be a level plane at z = 0 in the worldbody"
    allowed = {frozenset((ground.id, model.geom(part).id)) for part in (*body.trunk, *body.feet)}
    if not {frozenset(pair) for pair in np.stack([model.pair_geom1, model.pair_geom2], axis=1).tolist()} <= allowed:
        yield f"expected only contact pairs of {body.ground!r} with the feet and the parts of the trunk"


def _leg(model: mujoco.MjModel, body: Body, leg: Leg) -> Iterator[str]:
    foot, site, chain = model.geom(leg.foot), model.site(leg.foot), []
    around = foot.bodyid[0] == site.bodyid[0] and (foot.pos == site.pos).all()
    if foot.type[0] != mujoco.mjtGeom.mjGEOM_SPHERE or not around:
        yield f"geom {leg.foot!r} must be a sphere around the site {leg.foot!r}"
    part, root = model.body(foot.bodyid[0]), model.body(body.root).id
    while part.id not in (0, root):
        chain = [model.joint(part.jntadr[0] + i).name for i in range(part.jntnum[0])] + chain
        part = model.body(part.parentid[0])
    if part.id != root or tuple(chain) != leg.joints:
        found = ", ".join(chain) or "none"
        yield f"joints from {body.root!r} to foot {leg.foot!r}: {found}; expected {', '.join(leg.joints)}"
