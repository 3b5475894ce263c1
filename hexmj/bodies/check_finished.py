"""What the model that walks has to be, after everything was added: whatever hexmj takes for granted, as tables.

`check_described` asks whether an MJCF is what its description says.  But MJCF has defaults, classes, flags and
overrides besides, so here nothing is asked but the finished model.
"""

from collections.abc import Iterator
from itertools import chain
from math import inf, isclose
from operator import attrgetter
from typing import NamedTuple

import mujoco
import numpy as np

from hexmj.body import ROOT_QVEL, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError

MASS_TOLERANCE = 1e-3
"""Share by which the model's mass may differ from the description's."""

SOFTEST = 4.0
"""Greatest time constant of a contact, in longest steps; MuJoCo makes it two steps at least, and fine steps make it two
of their own."""


class Owner(NamedTuple):
    """Whose numbers a rule is about."""

    called: str
    """In a sentence."""
    rows: slice | tuple[slice, slice]
    """Of the arrays that have one row for each of them, and their columns where not all count."""
    kind: mujoco.mjtObj = mujoco.mjtObj.mjOBJ_UNKNOWN
    """MuJoCo's, where each has a name."""


_ALL, _OBJECT = slice(None), mujoco.mjtObj
MODEL, ROOT, ROOT_DOFS = Owner("", _ALL), Owner(" of the root", slice(1)), Owner(" of the root", slice(ROOT_QVEL))
LEG_DOFS = Owner(" of a leg's joint", slice(ROOT_QVEL, None))
JOINT = Owner(" of the joint", _ALL, _OBJECT.mjOBJ_JOINT)
BODY = Owner(" of the body", _ALL, _OBJECT.mjOBJ_BODY)
ACTUATOR = Owner(" of the actuator", _ALL, _OBJECT.mjOBJ_ACTUATOR)
GEOM = Owner(" of the geom", _ALL, _OBJECT.mjOBJ_GEOM)
PAIR = Owner(" of the pair", _ALL, _OBJECT.mjOBJ_PAIR)
PAIR_ENDS = PAIR._replace(rows=np.s_[:, :2])


class Rule(NamedTuple):
    """What some numbers of the finished model have to be."""

    called: str
    """What the MJCF calls them."""
    field: str
    """Where they stand in the model."""
    of: Owner
    least: float
    most: float
    expected: str
    """Both in words."""


HOLDS, FREE, SERVO = "none: it might hold the body up", "0: the root is free", "0: a servo is no more than its gains"
TAKES = "0 or more: a joint takes energy, and gives none"

RULES = (
    Rule("number of equality constraints", "neq", MODEL, 0, 0, HOLDS),
    Rule("number of tendons", "ntendon", MODEL, 0, 0, HOLDS),
    Rule("number of flexes", "nflex", MODEL, 0, 0, HOLDS),
    Rule("number of plugins", "nplugin", MODEL, 0, 0, HOLDS),
    Rule("density", "opt.density", MODEL, 0, 0, "0, as in a vacuum"),
    Rule("viscosity", "opt.viscosity", MODEL, 0, 0, "0, as in a vacuum"),
    Rule("gravcomp", "body_gravcomp", BODY, 0, 0, "0: parts are as heavy as they are"),
    Rule("damping", "dof_damping", ROOT_DOFS, 0, 0, FREE),
    Rule("damping", "dof_dampingpoly", ROOT_DOFS, 0, 0, FREE),
    Rule("frictionloss", "dof_frictionloss", ROOT_DOFS, 0, 0, FREE),
    Rule("armature", "dof_armature", ROOT_DOFS, 0, 0, FREE),
    Rule("damping", "dof_damping", LEG_DOFS, 0, inf, TAKES),
    Rule("damping", "dof_dampingpoly", LEG_DOFS, 0, inf, TAKES),
    Rule("frictionloss", "dof_frictionloss", LEG_DOFS, 0, inf, TAKES),
    Rule("armature", "dof_armature", LEG_DOFS, 0, inf, TAKES),
    Rule("stiffness", "jnt_stiffness", ROOT, 0, 0, FREE),
    Rule("stiffness", "jnt_stiffnesspoly", ROOT, 0, 0, FREE),
    Rule("margin", "jnt_margin", JOINT, 0, 0, "0: a joint is free up to the ends of its range"),
    Rule("actuatorfrclimited", "jnt_actfrclimited", JOINT, 0, 0, "no limit but the servo's"),
    Rule("nsample, interp", "actuator_history", ACTUATOR, 0, 0, SERVO),
    Rule("delay", "actuator_delay", ACTUATOR, 0, 0, SERVO),
    Rule("dyntype", "actuator_dyntype", ACTUATOR, 0, 0, SERVO),
    Rule("damping", "actuator_damping", ACTUATOR, 0, 0, SERVO),
    Rule("damping", "actuator_dampingpoly", ACTUATOR, 0, 0, SERVO),
    Rule("actuatorgroupdisable", "opt.disableactuator", MODEL, 0, 0, "none"),
    Rule("surfacevel", "geom_surfacevel", GEOM, 0, 0, "0: nothing moves along its own surface"),
    Rule("condim", "pair_dim", PAIR, 3, inf, "3 or more: friction"),
    Rule("solreffriction", "pair_solreffriction", PAIR, 0, 0, "0: friction is as hard as the contact"),
    Rule("solimp", "pair_solimp", PAIR_ENDS, 0.9, inf, "0.9 or more, MuJoCo's own, at both ends"),
    Rule("margin", "pair_margin", PAIR, 0, 0, "0: feet stand on the ground"),
    Rule("gap", "pair_gap", PAIR, 0, 0, "0: feet stand on the ground"),
    Rule("adhesion", "pair_adhesion", PAIR, 0, 0, "0: what grasps is told by `grasp`"),
    Rule("impratio", "opt.impratio", MODEL, 1, inf, "1 or more, MuJoCo's own"),
    Rule("iterations", "opt.iterations", MODEL, 100, inf, "100 or more, MuJoCo's own"),
    Rule("ls_iterations", "opt.ls_iterations", MODEL, 50, inf, "50 or more, MuJoCo's own"),
    Rule("tolerance", "opt.tolerance", MODEL, 0, 1e-5, "at most 1e-05, MuJoCo's own in mm"),
    Rule("ls_tolerance", "opt.ls_tolerance", MODEL, 0, 0.01, "at most 0.01, MuJoCo's own"),
)

CHOICES = {
    "integrator": (mujoco.mjtIntegrator, ("IMPLICITFAST", "IMPLICIT")),
    "solver": (mujoco.mjtSolver, ("NEWTON", "CG")),
}
"""Option -> its kinds in MuJoCo, and the names of those with which walks are what they are measured as."""

HARMLESS = ("equality", "filterparent", "midphase", "nativeccd", "multiccd", "island", "energy", "fwdinv", "eulerdamp")
"""Flags that may be anything; the last is for Euler's integrator alone, which is never used."""


def check_finished(model: mujoco.MjModel, conditions: Conditions) -> None:
    """Refuse a finished model in which something is in force that nothing else knows of.

    Raises:
        InputError: the first thing that is not as expected.
    """
    body = conditions.body
    faults = (_in_parts(model, body), _in_options(model), _in_numbers(model), _in_contacts(model, body))
    for fault in chain(*faults, _in_conditions(model, conditions)):
        raise InputError(f"body {body.name!r}: {fault}")


def _in_parts(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    for part in body.trunk:
        if (on := model.body(model.geom(part).bodyid[0])).name != part:
            yield f"the geom {part!r} is on the body {on.name!r}; expected it on the body of its own name"
    for part in (*body.trunk, *(part for leg in body.legs for part in leg.parts)):
        if model.body(part).rootid[0] != model.body(body.root).id:
            yield f"the part {part!r} does not hang on the root; expected it to, on {body.root!r}"
    joints = [model.joint(i) for i in range(1, model.njnt)]
    for joint in (joint for joint in joints if joint.name not in body.joints):
        which = f"the joint {joint.name!r}" if joint.name else f"a joint of {model.body(joint.bodyid[0]).name!r}"
        yield f"{which} is no leg's; expected none but the root's and the legs'"


def _in_options(model: mujoco.MjModel) -> Iterator[str]:
    for option, (kinds, valid) in CHOICES.items():
        kind = kinds(getattr(model.opt, option)).name.split("_")[1]
        if kind not in valid:
            yield f"{option} = {kind}; expected {' or '.join(valid)}"
    for flags, kinds, able in (
        (model.opt.disableflags, mujoco.mjtDisableBit, "disabled"),
        (model.opt.enableflags, mujoco.mjtEnableBit, "enabled"),
    ):
        for name, kind in kinds.__members__.items():
            flag = name.lower().partition("_")[2]  # empty where their number is told
            if flag and flag not in HARMLESS and flags & kind.value:
                yield f"the flag {flag!r} is {able}; expected flags as MuJoCo has them, but for {', '.join(HARMLESS)}"


def _in_numbers(model: mujoco.MjModel) -> Iterator[str]:
    for rule in RULES:
        values = np.atleast_1d(attrgetter(rule.field)(model))[rule.of.rows]
        fits = ((rule.least <= values) & (values <= rule.most)).reshape(len(values), -1).all(axis=1)
        for i in np.flatnonzero(~fits):
            whose = f"{rule.of.called} {_which(model, rule.of.kind, int(i))}".rstrip()
            yield f"{rule.called} = {values[i].tolist()}{whose}; expected {rule.expected}"


def _which(model: mujoco.MjModel, kind: mujoco.mjtObj, i: int) -> str:
    """The name of one of a kind; of a pair without one, those of its geoms."""
    if name := mujoco.mj_id2name(model, kind, i):
        return repr(name)
    if kind == PAIR.kind:
        return " and ".join(repr(model.geom(pairs[i]).name) for pairs in (model.pair_geom1, model.pair_geom2))
    return ""


def _in_contacts(model: mujoco.MjModel, body: Body) -> Iterator[str]:
    most = SOFTEST * body.longest_step
    for i in np.flatnonzero(~((model.pair_solref > 0).all(axis=1) & (model.pair_solref[:, 0] <= most))):
        which = _which(model, PAIR.kind, int(i))
        yield (
            f"solref = {model.pair_solref[i].tolist()} of the pair {which}; expected a time constant"
            f" above 0 and at most {most:g} s, {SOFTEST:g} of its longest steps, and a damping ratio above 0"
        )


def _in_conditions(model: mujoco.MjModel, conditions: Conditions) -> Iterator[str]:
    body, load, ground = conditions.body, conditions.load, conditions.ground
    mass, expected = model.body_subtreemass[model.body(body.root).id], body.mass * (1.0 + load)
    if not abs(mass - expected) <= MASS_TOLERANCE * expected:
        yield f"with load = {load:g} it weighs {mass:.6g} g; expected {expected:.6g} g"
    level, expected = model.geom(body.ground).pos[2], -body.lengths.shortest_leg if ground == "gap" else 0.0
    if not isclose(level, expected, abs_tol=1e-9):
        yield f"with ground = {ground!r} its plane lies at z = {level:g} mm; expected {expected:g} mm"
