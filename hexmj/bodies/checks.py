"""Whether a compiled MJCF is what a description says of it; each answer is one sentence."""

import mujoco
import numpy as np

from hexmj.bodies.description import ROOT_QPOS, ROOT_QVEL, Body
from hexmj.errors import InputError

MASS_TOLERANCE = 1e-3
"""Share by which the MJCF's mass may differ from the description's."""


def check_described(model: mujoco.MjModel, body: Body) -> None:
    """Refuse an MJCF, compiled as it is, that the description does not fit.

    Raises:
        InputError: a name that is not there, joints in another order, or a mass, root, foot or ground that differs.
    """
    _check_names(model, body)
    _check_root_and_joints(model, body)
    _check_legs(model, body)
    _check_actuators(model, body)
    ground = model.geom(body.ground)
    if ground.type[0] != mujoco.mjtGeom.mjGEOM_PLANE:
        raise InputError(f"body {body.name!r}: the ground {body.ground!r} is no plane; expected a geom of type plane")
    if model.opt.gravity[:2].any() or not model.opt.gravity[2] < 0:
        raise InputError(f"body {body.name!r}: gravity = {model.opt.gravity.tolist()}; expected it to point down")
    mass = model.body_subtreemass[model.body(body.root).id]
    if not abs(mass - body.mass) <= MASS_TOLERANCE * body.mass:
        raise InputError(
            f"body {body.name!r}: mass = {body.mass:g} g, but its MJCF weighs {mass:.6g} g; expected the same"
        )


def _check_names(model: mujoco.MjModel, body: Body) -> None:
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
        for name in names:
            if name not in there:
                what = kind.name.removeprefix("mjOBJ_").lower()
                valid = ", ".join(one for one in there if one) or "none"
                raise InputError(f"body {body.name!r}: its MJCF has no {what} {name!r}; valid names: {valid}")


def _check_root_and_joints(model: mujoco.MjModel, body: Body) -> None:
    root = model.body(body.root)
    first = int(root.jntadr[0])
    if root.jntnum[0] != 1 or first != 0 or model.jnt_type[first] != mujoco.mjtJoint.mjJNT_FREE:
        raise InputError(
            f"body {body.name!r}: its root {body.root!r} lacks a free joint that is the MJCF's first joint"
        )
    joints = np.array([model.joint(name).id for name in body.joints])
    for name, joint in zip(body.joints, joints, strict=True):
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE or not model.jnt_limited[joint]:
            raise InputError(f"body {body.name!r}: joint {name!r}; expected a hinge with a range")
    columns = np.arange(len(joints))
    in_order = model.jnt_qposadr[joints] == ROOT_QPOS + columns, model.jnt_dofadr[joints] == ROOT_QVEL + columns
    if not np.all(in_order):
        raise InputError(
            f"body {body.name!r}: its MJCF has the joints in the order"
            f" {', '.join(model.joint(i).name for i in range(1, model.njnt))}; expected them leg by leg as described,"
            f" {', '.join(body.joints)}, right after the root's"
        )


def _check_legs(model: mujoco.MjModel, body: Body) -> None:
    root, radii = model.body(body.root).id, set()
    for leg in body.legs:
        foot, site = model.geom(leg.foot), model.site(leg.foot)
        around = foot.bodyid[0] == site.bodyid[0] and (foot.pos == site.pos).all()
        if foot.type[0] != mujoco.mjtGeom.mjGEOM_SPHERE or not around:
            raise InputError(f"body {body.name!r}: foot {leg.foot!r}; expected a sphere around the site of that name")
        radii.add(float(foot.size[0]))
        chain, at = [], int(foot.bodyid[0])
        if model.body(at).name not in leg.parts:
            raise InputError(
                f"body {body.name!r}: foot {leg.foot!r} is on {model.body(at).name!r};"
                f" expected it on a part of its leg, {', '.join(leg.parts)}"
            )
        while at not in (0, root):
            joints = range(model.body_jntadr[at], model.body_jntadr[at] + model.body_jntnum[at])
            chain = [model.joint(joint).name for joint in joints] + chain
            at = int(model.body_parentid[at])
        if at != root or tuple(chain) != leg.joints:
            raise InputError(
                f"body {body.name!r}: from {body.root!r} to foot {leg.foot!r} lead the joints"
                f" {', '.join(chain) or 'none'}; expected {', '.join(leg.joints)}"
            )
    if len(radii) > 1:
        raise InputError(f"body {body.name!r}: its feet have the radii {sorted(radii)} mm; expected one for all")


def _check_actuators(model: mujoco.MjModel, body: Body) -> None:
    joints = [model.joint(name).id for name in body.joints]
    driven = model.actuator_trnid[:, 0].tolist()
    on_joints = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT).all()
    if model.nu and not (on_joints and driven == joints):
        raise InputError(
            f"body {body.name!r}: its MJCF has {model.nu} actuators; expected one for each joint in the order of the"
            " joints, or none, and then servos are added"
        )
