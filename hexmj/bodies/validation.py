"""Checks that a body's MJCF fits its description, and that the finished model has no forces that hexmj ignores."""

from collections.abc import Iterator
from math import inf
from operator import attrgetter

import mujoco
import numpy as np

from hexmj.bodies.kinematics import hinge_chains
from hexmj.body import ROOT_QVEL, Body
from hexmj.errors import InputError

LEG_TOLERANCE = 1.5
"""Maximum factor between `Lengths.shortest_leg` and the shortest leg of the MJCF."""

LEAST_GRAVITY = 100.0
"""Minimum gravity, a sixteenth of the moon's [mm/s^2]; a smaller value is taken for one in m/s^2."""

MASS_TOLERANCE = 1e-3
"""Maximum relative difference between the mass of the model and `Body.mass`."""

SOFTEST = 4.0
"""Maximum time constant of a contact, in multiples of `Body.longest_step`. MuJoCo's minimum is two physics steps; in a
fine step (`physics.substeps`) hexmj sets it to two of the shorter steps."""

RULES = (
    ("integrator (implicit is 2, implicitfast 3)", "opt.integrator", 2, 3),
    ("number of equality constraints", "neq", 0, 0),
    ("number of tendons", "ntendon", 0, 0),
    ("density", "opt.density", 0, 0),
    ("gravcomp of a body", "body_gravcomp", 0, 0),
    ("actuatorfrclimited of a joint (effort in a URDF)", "jnt_actfrclimited", 0, 0),
    ("condim of a contact pair", "pair_dim", 3, inf),
)
"""Checks of the finished model: name in the MJCF, field of the model, minimum and maximum.

Outside of these ranges a walk depends on forces that hexmj does not measure."""


def check(model: mujoco.MjModel, body: Body, *, finished: bool = False) -> None:
    """Check the model of an unchanged MJCF or, with `finished`, the model that walks.

    Raises:
        InputError: the MJCF does not fit the description of the body, or the model has forces that hexmj ignores.
    """
    for faults in (_finished,) if finished else (_names, _joints, _sizes, _legs, _ground_and_pairs):
        for fault in faults(model, body):
            raise InputError(f"body {body.name!r}: {fault}")


def _names(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    parts = [part for leg in body.legs for part in leg.parts]
    for kind, names in {
        "body": [body.root, *body.trunk, *parts],
        "geom": [body.ground, *body.trunk, *body.feet],
        "site": body.feet,
        "key": [body.home],
        "camera": body.cameras,
    }.items():
        for name in names:
            try:
                getattr(model, kind)(name)
            except KeyError as error:
                yield f"{kind}: {error.args[0]}"


def _joints(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    kinds, found = mujoco.mjtJoint, [model.joint(i).name for i in range(model.njnt)]
    if model.njnt == 0 or model.jnt_type[0] != kinds.mjJNT_FREE or model.jnt_bodyid[0] != model.body(body.root).id:
        yield f"root {body.root!r} needs a free joint, which must be the first joint of the MJCF"
    if found[1:] != list(body.joints):
        yield f"joints after the root's: {', '.join(found[1:])}; expected, in this order: {', '.join(body.joints)}"
    hinges = (model.jnt_type == kinds.mjJNT_HINGE) & (model.jnt_limited == 1)
    if not hinges[1:].all():
        yield f"joint {body.joints[np.argmin(hinges[1:])]!r} must be a hinge with a range"
    driven = model.actuator_trnid[:, 0].tolist() == list(range(1, model.njnt))
    if model.nu and not (driven and (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()):
        yield f"{model.nu} actuators; expected one for each joint in the order of the joints, or none"


def _legs(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    root, radii = model.body(body.root).id, set()
    for leg in body.legs:
        foot, site = model.geom(leg.foot), model.site(leg.foot)
        around = foot.bodyid[0] == site.bodyid[0] and (foot.pos == site.pos).all()
        if foot.type[0] != mujoco.mjtGeom.mjGEOM_SPHERE or not around:
            yield f"geom {leg.foot!r} must be a sphere around the site {leg.foot!r}"
        radii.add(float(foot.size[0]))
        chain, part = [], model.body(foot.bodyid[0])
        while part.id not in (0, root):
            if model.body_mass[part.id] > 0 and part.name not in (*leg.parts, *body.trunk):
                yield f"body {part.name!r}, between the root and {leg.foot!r}, must be one of the leg's parts"
            chain = [model.joint(part.jntadr[0] + i).name for i in range(part.jntnum[0])] + chain
            part = model.body(part.parentid[0])
        if part.id != root or tuple(chain) != leg.joints:
            found = ", ".join(chain) or "none"
            yield f"joints from {body.root!r} to foot {leg.foot!r}: {found}; expected {', '.join(leg.joints)}"
    if len(radii) > 1:
        yield f"radii of the feet: {sorted(radii)} mm; expected the same for all"


def _ground_and_pairs(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    ground = model.geom(body.ground)
    level = not (ground.bodyid[0] or ground.pos[2] or ground.quat[1:3].any())
    if ground.type[0] != mujoco.mjtGeom.mjGEOM_PLANE or not level:
        yield f"geom {body.ground!r} must be a level plane at z = 0 in the worldbody"
    expected = {frozenset((ground.id, model.geom(part).id)) for part in (*body.trunk, *body.feet)}
    for pair in zip(model.pair_geom1, model.pair_geom2, strict=True):
        if frozenset(pair) not in expected:
            names = " and ".join(repr(model.geom(geom).name) for geom in pair)
            yield f"contact pair {names}; expected only {body.ground!r} with each foot and part of the trunk, once"
        expected -= {frozenset(pair)}
    outside = model.body_rootid[model.geom_bodyid] != model.body(body.root).id
    outside[ground.id] = False
    for geom in np.flatnonzero(outside & (model.geom_contype | model.geom_conaffinity != 0)):
        yield f"geom {model.geom(geom).name!r} would have no contacts; set obstacles by Conditions(ground=...)"


def _sizes(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    gravity = model.opt.gravity
    if gravity[:2].any() or not -gravity[2] >= LEAST_GRAVITY:
        yield f"gravity = {gravity.tolist()} mm/s^2; expected a vector that points down, as (0, 0, -9810)"
    mass = model.body_subtreemass[model.body(body.root).id]
    if not abs(mass - body.mass) <= MASS_TOLERANCE * body.mass:
        yield f"mass = {body.mass:g} g; expected the mass of the MJCF, {mass:.6g} g"
    described, found = body.lengths.shortest_leg, hinge_chains(model, body).length.min()
    if not 1 / LEG_TOLERANCE <= described / found <= LEG_TOLERANCE:
        factor = found / described
        yield f"shortest_leg = {described:g} mm; it is {found:.4g} mm in the MJCF. Use lengths.scaled({factor:.3g})"


def _finished(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    root = "damping of the root", model.dof_damping[:ROOT_QVEL], 0, 0
    contacts = "time constant of a contact pair [s]", model.pair_solref[:, 0], 0, SOFTEST * body.longest_step
    rules = [(name, attrgetter(field)(model), *limits) for name, field, *limits in RULES]
    for name, values, least, most in (*rules, root, contacts):
        if (bad := np.extract((values < least) | (values > most), values)).size:
            yield f"{name} = {bad[0]:g}; expected {least:g} to {most:g}"
