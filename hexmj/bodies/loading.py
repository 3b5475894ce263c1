"""A body compiled for its conditions: with its gains, on its ground, under its load."""

import copy
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np

from hexmj.bodies.additions import complete
from hexmj.bodies.check_described import check_described
from hexmj.bodies.check_finished import check_finished
from hexmj.bodies.compiled import CompiledBody, measured
from hexmj.bodies.gains import gains
from hexmj.bodies.grounds import lay_ground
from hexmj.bodies.reading import posed
from hexmj.body import Body
from hexmj.conditions import ROUNDING, Conditions
from hexmj.errors import InputError
from hexmj.legs import LEGS

HOME_TOLERANCE = 1e-3
"""How far feet and centre of mass may be from where they shall be at home, in lengths of the shortest leg."""


def compile_body(
    conditions: Conditions, timestep: float | None = None, *, looks: bool = True, pushes: bool = False
) -> CompiledBody:
    """The body of some conditions, compiled; every call gives a model of its own.

    Args:
        conditions: body, masses, contact of the feet and ground are taken from them.
        timestep: integration step [s], at most the longest one that the body's gains and contacts are made for, which
            it is unless given.
        looks: with the geoms that are only to look at; without them it walks to the same bits, 2 % faster.
        pushes: with sensors of what the feet push the ground with; without them it walks to the same bits, faster.

    Raises:
        InputError: a time step that makes no sense, or a body whose MJCF is not as described.
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
    """The MJCF of a body, compiled as it is; not to be written to.

    Raises:
        InputError: it does not compile, or it is not as described.
    """
    return _plain_model(body, body.mjcf.read_bytes())


@lru_cache(maxsize=16)
def _plain_model(body: Body, files: bytes) -> mujoco.MjModel:
    """The same; `files` is what they hold now, so that edited ones are compiled anew."""
    try:
        model = _spec(body).compile()
    except ValueError as error:
        raise InputError(f"body {body.name!r}: {body.mjcf} does not compile: {_sentence(error)}") from None
    check_described(model, body)
    return model


def check_home(compiled: CompiledBody) -> None:
    """Refuse a body that is not as described in posture home: its feet, and its centre of mass, which is at O unless
    `Conditions.centre_of_mass` says how far ahead.

    Raises:
        InputError: it is not.
    """
    body, conditions = compiled.body, compiled.conditions
    allowed = HOME_TOLERANCE * body.lengths.shortest_leg
    tips = compiled.forward(compiled.home[compiled.columns.qpos].reshape(6, -1))
    expected = np.stack([body.lines.origin, body.lines.y, 6 * [-body.standing_height]], axis=-1)
    off = np.abs(tips - expected).max(axis=1)
    if off.max() > allowed:
        leg = int(np.argmax(off))
        raise InputError(
            f"body {body.name!r}: at {body.home!r} foot {body.feet[leg]!r} is at {tips[leg].round(3).tolist()} mm;"
            f" expected it on the origin of its line, a standing height below the root, {expected[leg].tolist()}"
        )
    own, aside, _ = _centre_of_mass(plain_model(body), body)
    if conditions.centre_of_mass == 0.0 and abs(own) > allowed:
        raise InputError(
            f"body {body.name!r}: at {body.home!r} its centre of mass lies {own:.4g} mm ahead of O; expected it at O,"
            f" or centre_of_mass = {own:.4g} among the conditions, to leave it there"
        )
    if abs(aside) > allowed:
        raise InputError(
            f"body {body.name!r}: at {body.home!r} its centre of mass lies {aside:.4g} mm to the left of O; expected 0"
        )


def _centre_of_mass(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """Where it lies from O in posture home, in the root's frame (x ahead, y to the left, z up), (axis,) [mm]."""
    data = posed(model, model.key(body.home).qpos)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[model.body(body.root).id]


def gravity(body: Body) -> float:
    """Acceleration of gravity where a body walks [mm/s^2]."""
    return -float(plain_model(body).opt.gravity[2])


@lru_cache(maxsize=16)
def _compiled(conditions: Conditions, looks: bool, pushes: bool, files: bytes) -> CompiledBody:
    """The body under some conditions, for its files as they are now."""
    body = conditions.body
    plain, spec = _plain_model(body, files), _spec(body)
    spec.compiler.discardvisual = not looks
    try:
        complete(spec, plain, body, gains(plain, body), pushes)
        lay_ground(spec, conditions)
        if conditions.load:
            _add_load(spec, body, conditions.load)
        if conditions.grasp:
            _add_grasp(spec, body, conditions.grasp * body.mass * gravity(body))
        model = spec.compile()
    except ValueError as error:
        under = f"ground = {conditions.ground!r}, load = {conditions.load:g}, grasp = {conditions.grasp:g}"
        raise InputError(f"body {body.name!r} with {under} cannot be built: {_sentence(error)}") from None
    model.pair_friction[:, :2] = conditions.friction
    feet = [model.site(foot).id for foot in body.feet]
    model.site_type[feet], radius = mujoco.mjtGeom.mjGEOM_SPHERE, model.geom(body.feet[0]).size[0]
    model.site_size[feet, 0] = radius + radius / 10  # around the foot: touch is felt inside the site alone
    check_finished(model, conditions)
    if conditions.leg_mass != 1.0 or conditions.centre_of_mass != 0.0:
        _redistribute(model, conditions)
    return measured(model, conditions)


def _sentence(error: ValueError) -> str:
    return " ".join(str(error).split())


def _spec(body: Body) -> mujoco.MjSpec:
    mujoco.mj_clearCache(mujoco.mj_getCache())  # of meshes, which it knows by names and whole seconds
    spec = mujoco.MjSpec.from_file(str(body.mjcf))
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        # The same by other words, under which geoms that are only to look at may be discarded.
        model = spec.compile()
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
        for part in spec.bodies[1:]:
            part.mass, part.ipos = model.body_mass[part.id], model.body_ipos[part.id]
            part.iquat, part.inertia = model.body_iquat[part.id], model.body_inertia[part.id]
            part.explicitinertial = True
    return spec


def _add_load(spec: mujoco.MjSpec, body: Body, load: float) -> None:
    """Let the root carry a load, in multiples of the body's own mass."""
    mass = load * body.mass
    part = spec.body(body.root).add_body(name="load", mass=mass, inertia=3 * [body.lengths.load_gyration**2 * mass])
    part.explicitinertial = True


def _add_grasp(spec: mujoco.MjSpec, body: Body, force: float) -> None:
    """Let feet hold on to the ground, each with a force [g mm/s^2] times its actuator's 0 to 1."""
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
    """Give the legs their share of the mass, and move the trunk's masses until the centre of mass lies there."""
    body = conditions.body
    legs = [model.body(part).id for leg in body.legs for part in leg.parts]
    trunk = [model.body(part).id for part in body.trunk]
    in_legs, in_trunk = model.body_mass[legs].sum(), model.body_mass[trunk].sum()
    if not in_legs * conditions.leg_mass < in_legs + in_trunk:
        raise InputError(
            f"body {body.name!r}: leg_mass = {conditions.leg_mass:g}; expected below {1.0 + in_trunk / in_legs:.4g}, or"
            " nothing is left of the trunk"
        )
    for bodies, factor in (
        (legs, conditions.leg_mass),
        (trunk, 1.0 + in_legs / in_trunk * (1.0 - conditions.leg_mass)),
    ):
        model.body_mass[bodies] *= factor
        model.body_inertia[bodies] *= factor
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    offset = conditions.centre_of_mass - _centre_of_mass(model, body)[0]
    in_all = np.where(model.body_rootid == model.body(body.root).id, model.body_mass, 0.0).sum()
    ahead = posed(model, model.qpos0).xmat[trunk, :3]  # the root's x in the frame of each part
    model.body_ipos[trunk] += offset * in_all / model.body_mass[trunk].sum() * ahead
    mujoco.mj_setConst(model, data)
