"""Whether a compiled MJCF is what a description says of it; each answer is one sentence."""

from collections.abc import Iterator

import mujoco
import numpy as np

from hexmj.bodies.check_finished import MASS_TOLERANCE
from hexmj.bodies.reading import segments
from hexmj.body import ROOT_QPOS, ROOT_QVEL, Body
from hexmj.errors import InputError

LEG_TOLERANCE = 1.5
"""Times by which the shortest leg may be longer or shorter than the lengths say, which limits are made of."""

LEAST_GRAVITY = 100.0
"""A sixteenth of the moon's [mm/s^2]; less was told in metres."""


def check_described(model: mujoco.MjModel, body: Body) -> None:
    """Refuse an MJCF, compiled as it is, that the description does not fit.

    Raises:
        InputError: a name that is not there, joints in another order, or a mass, root, foot or ground that differs.
    """
    for faults in (_in_names, _in_joints, _in_legs, _in_lengths, _in_ground, _in_pairs, _in_the_rest):
        for fault in faults(model, body):
            raise InputError(f"body {body.name!r}: {fault}")


def _in_names(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    parts = [part for leg in body.legs for part in leg.parts]
    kinds = mujoco.mjtObj
    for kind, number, names in (
        (kinds.mjOBJ_BODY, model.nbody, [body.root, *body.trunk, *parts]),
        (kinds.mjOBJ_GEOM, model.ngeom, [body.ground, *body.trunk, *body.feet]),
        (kinds.mjOBJ_SITE, model.nsite, body.feet),
        (kinds.mjOBJ_JOINT, model.njnt, body.joints),
        (kinds.mjOBJ_KEY, model.nkey, [body.home]),
        (kinds.mjOBJ_CAMERA, model.ncam, body.cameras),
    ):
        there = [mujoco.mj_id2name(model, kind, i) for i in range(number)]
        what, valid = kind.name.removeprefix("mjOBJ_").lower(), ", ".join(filter(None, there)) or "none"
        yield from (f"its MJCF has no {what} {name!r}; valid names: {valid}" for name in names if name not in there)


def _in_joints(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    root = model.body(body.root)
    if root.jntnum[0] != 1 or root.jntadr[0] != 0 or model.jnt_type[0] != mujoco.mjtJoint.mjJNT_FREE:
        yield f"its root {body.root!r} lacks a free joint that is the MJCF's first joint"
    joints = np.array([model.joint(name).id for name in body.joints])
    hinges = (model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE) & (model.jnt_limited[joints] == 1)
    if not hinges.all():
        yield f"joint {body.joints[np.argmin(hinges)]!r}; expected a hinge with a range"
    columns = np.stack([model.jnt_qposadr[joints] - ROOT_QPOS, model.jnt_dofadr[joints] - ROOT_QVEL])
    if (columns != np.arange(len(joints))).any():
        there = ", ".join(model.joint(i).name for i in range(1, model.njnt))
        yield (
            f"its MJCF has the joints in the order {there}; expected them leg by leg as described,"
            f" {', '.join(body.joints)}, right after the root's"
        )
    driven = model.actuator_trnid[:, 0].tolist() == joints.tolist()
    if model.nu and not (driven and (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()):
        yield (
            f"its MJCF has {model.nu} actuators; expected one for each joint in the order of the joints, or none,"
            " and then servos are added"
        )


def _in_legs(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    root, radii = model.body(body.root).id, set()
    for leg in body.legs:
        foot, site = model.geom(leg.foot), model.site(leg.foot)
        around = foot.bodyid[0] == site.bodyid[0] and (foot.pos == site.pos).all()
        if foot.type[0] != mujoco.mjtGeom.mjGEOM_SPHERE or not around:
            yield f"foot {leg.foot!r}; expected a sphere around the site of that name"
        radii.add(float(foot.size[0]))
        chain, part = [], model.body(foot.bodyid[0])
        if part.name not in leg.parts:
            yield f"foot {leg.foot!r} is on {part.name!r}; expected it on a part of its leg, {', '.join(leg.parts)}"
        while part.id not in (0, root):
            chain = [model.joint(part.jntadr[0] + i).name for i in range(part.jntnum[0])] + chain
            part = model.body(part.parentid[0])
        if part.id != root or tuple(chain) != leg.joints:
            yield (
                f"from {body.root!r} to foot {leg.foot!r} lead the joints {', '.join(chain) or 'none'};"
                f" expected {', '.join(leg.joints)}"
            )
        moved = np.zeros(model.nbody, dtype=bool)
        for i in range(1, model.nbody):
            one = model.body(i)
            joints = {model.joint(one.jntadr[0] + n).name for n in range(one.jntnum[0])}
            moved[i] = moved[one.parentid[0]] or not joints.isdisjoint(leg.joints)
            if moved[i] and model.body_mass[i] > 0 and joints.issubset(leg.joints) and one.name not in leg.parts:
                yield f"{one.name!r} is moved by {leg.joints[0]!r}; expected it among the parts of that leg"
    if len(radii) > 1:
        yield f"its feet have the radii {sorted(radii)} mm; expected one for all"


def _in_lengths(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    told, there = body.lengths.shortest_leg, segments(model, body).sum(axis=1).min()
    if not 1 / LEG_TOLERANCE <= told / there <= LEG_TOLERANCE:
        yield (
            f"its lengths are for legs of {told:g} mm, but its shortest leg is {there:.4g} mm long; expected `lengths`"
            f" of its own, such as those scaled by {there / told:.3g}"
        )


def _in_ground(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    ground = model.geom(body.ground)
    if ground.type[0] != mujoco.mjtGeom.mjGEOM_PLANE:
        yield f"the ground {body.ground!r} is no plane; expected a geom of type plane"
    if ground.bodyid[0] or ground.pos[2] or ground.quat[1:3].any():
        where = f"at z = {ground.pos[2]:g} mm, quat = {ground.quat.round(4).tolist()}"
        yield f"the ground {body.ground!r} lies {where}; expected it level at z = 0, in the world"


def _in_pairs(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    ground = model.geom(body.ground).id
    left = {frozenset((ground, model.geom(part).id)) for part in (*body.trunk, *body.feet)}
    for pair in zip(model.pair_geom1, model.pair_geom2, strict=True):
        if (touching := frozenset(pair)) not in left:
            names = " and ".join(repr(model.geom(geom).name) for geom in pair)
            yield (
                f"a pair of {names}; expected pairs of {body.ground!r} with its trunk's parts and its feet alone, each"
                " once: nothing else shall touch, as every contact of the trunk is a fall"
            )
        left -= {touching}


def _in_the_rest(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    outside = model.body_rootid[model.geom_bodyid] != model.body(body.root).id
    outside[model.geom(body.ground).id] = False
    for geom in np.flatnonzero(outside & (model.geom_contype | model.geom_conaffinity != 0)):
        yield (
            f"the geom {model.geom(geom).name!r} beside the body touches nothing, since only pairs touch; expected"
            " contype = conaffinity = 0, and what lies ahead told by `ground`"
        )
    if model.opt.gravity[:2].any() or not model.opt.gravity[2] < 0:
        yield f"gravity = {model.opt.gravity.tolist()}; expected it to point down"
    if -model.opt.gravity[2] < LEAST_GRAVITY:
        yield f"gravity = {-model.opt.gravity[2]:g} mm/s^2; expected at least {LEAST_GRAVITY:g}, as 9810 on Earth"
    mass = model.body_subtreemass[model.body(body.root).id]
    if not abs(mass - body.mass) <= MASS_TOLERANCE * body.mass:
        yield f"mass = {body.mass:g} g, but its MJCF weighs {mass:.6g} g; expected the same"
