"""Checks that a body's MJCF fits its description, and that the finished model has no forces that hexmj ignores."""

from collections.abc import Iterator
from math import inf
from operator import attrgetter
from sys import float_info

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

ALL, ROOT, LEGS, ABOVE_0 = slice(None), slice(ROOT_QVEL), slice(ROOT_QVEL, None), float_info.min

RULES = (
    ("integrator (implicit is 2, implicitfast 3)", "opt.integrator", ALL, 2, 3),
    ("solver (CG is 1, Newton 2)", "opt.solver", ALL, 1, 2),
    ("iterations", "opt.iterations", ALL, 100, inf),
    ("tolerance", "opt.tolerance", ALL, 0, 1e-5),
    ("number of equality constraints", "neq", ALL, 0, 0),
    ("number of tendons", "ntendon", ALL, 0, 0),
    ("density", "opt.density", ALL, 0, 0),
    ("gravcomp of a body", "body_gravcomp", ALL, 0, 0),
    ("damping of the root", "dof_damping", ROOT, 0, 0),
    ("armature of the root", "dof_armature", ROOT, 0, 0),
    ("damping of a leg's joint", "dof_damping", LEGS, 0, inf),
    ("margin of a joint", "jnt_margin", ALL, 0, 0),
    ("actuatorfrclimited of a joint (effort in a URDF)", "jnt_actfrclimited", ALL, 0, 0),
    ("dyntype of an actuator", "actuator_dyntype", ALL, 0, 0),
    ("condim of a contact pair", "pair_dim", ALL, 3, inf),
    ("solimp of a contact pair", "pair_solimp", np.s_[:, :2], 0.9, inf),
    ("damping ratio of a contact pair", "pair_solref", np.s_[:, 1], ABOVE_0, inf),
    ("margin of a contact pair", "pair_margin", ALL, 0, 0),
    ("gap of a contact pair", "pair_gap", ALL, 0, 0),
)
"""Checks of the finished model: name in the MJCF, field of the model, elements that are checked, minimum and maximum.

Outside of these ranges a walk depends on forces that hexmj does not measure, or its contacts are less accurate than in
hexmj's results."""

HARMLESS = ("equality", "filterparent", "midphase", "nativeccd", "multiccd", "island", "energy", "fwdinv", "eulerdamp")
"""MuJoCo's flags that have no effect on a walk."""


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
    for part in body.trunk:
        owner = model.body(model.geom(part).bodyid[0])
        if owner.name != part or owner.rootid[0] != root:
            yield f"trunk geom {part!r} must be on a body of the same name, attached to the root"


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
    for flags, kinds in (model.opt.disableflags, mujoco.mjtDisableBit), (model.opt.enableflags, mujoco.mjtEnableBit):
        for name, kind in kinds.__members__.items():
            flag = name.lower().partition("_")[2]  # empty for the number of flags
            if flag and flag not in HARMLESS and flags & kind.value:
                yield f"flag {flag!r} differs from MuJoCo's default"
    softest = SOFTEST * body.longest_step
    contacts = ("time constant of a contact pair [s]", "pair_solref", np.s_[:, 0], ABOVE_0, softest)
    for name, field, rows, least, greatest in (*RULES, contacts):
        values = np.atleast_1d(attrgetter(field)(model))[rows]
        if (bad := values[~((least <= values) & (values <= greatest))]).size:
            expected = f"{least:g}" if least == greatest else f"{least:g} to {greatest:g}"
            yield f"{name} = {bad.flat[0]:g}; expected {expected}"
