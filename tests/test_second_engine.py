"""A second engine's opinion: Pinocchio's mass matrix and bias forces are MuJoCo's, of two bodies.

Pinocchio is given the MJCF body by body, since its own reader (4.1) leaves out the masses of geoms that touch nothing
and knows no meshes but those of files.  Masses come from the MJCF; inertias of the capsules are Pinocchio's own.
"""

import mujoco
import numpy as np
import pinocchio
import pytest

from hexmj.body import ROOT_QPOS, ROOT_QVEL, STICK_INSECT, Body
from other_bodies import renamed

RELATIVE = 1e-12
"""Of the geometric mean of two degrees of freedom's inertias, and of the greatest bias force of its kind: on the root,
about it, at the joints.  Measured is 3e-14 at 1000 states."""


@pytest.fixture(params=["stick insect", "renamed, with longer legs"], scope="module")
def body(request, tmp_path_factory) -> Body:
    """The insect, and one with every name another."""
    return STICK_INSECT if request.param == "stick insect" else renamed(tmp_path_factory.mktemp("other"))


@pytest.fixture(scope="module")
def engines(body) -> tuple[mujoco.MjModel, pinocchio.Model]:
    """One body in both."""
    spec = mujoco.MjSpec.from_file(str(body.mjcf))
    model = spec.compile()
    return model, in_pinocchio(spec, model)


def in_pinocchio(spec: mujoco.MjSpec, model: mujoco.MjModel) -> pinocchio.Model:
    """The same tree of bodies, joints and capsules, with MuJoCo's armature and gravity."""
    tree = pinocchio.Model()
    places = {0: (0, pinocchio.SE3.Identity())}  # of each body: the joint that moves it, and where it is seen from that
    for one in range(1, model.nbody):
        joint, above = places[int(model.body_parentid[one])]
        here = above * placed(model.body_pos[one], model.body_quat[one])
        for j in range(model.body_jntadr[one], model.body_jntadr[one] + model.body_jntnum[one]):
            free = model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
            kind = pinocchio.JointModelFreeFlyer() if free else hinge(model, j)
            joint = tree.addJoint(joint, kind, pinocchio.SE3.Identity() if free else here, model.joint(j).name)
            here = pinocchio.SE3.Identity()
        places[one] = joint, here
    for geom in spec.geoms:
        if geom.mass > 0:
            compiled = model.geom(geom.name)
            assert compiled.type == mujoco.mjtGeom.mjGEOM_CAPSULE
            radius, half, _ = compiled.size
            joint, here = places[int(compiled.bodyid[0])]
            inertia = pinocchio.Inertia.FromCapsule(geom.mass, radius, 2.0 * half)
            tree.appendBodyToJoint(joint, inertia, here * placed(compiled.pos, compiled.quat))
    armature = np.zeros(tree.nv)
    armature[own_columns(model, tree)] = model.dof_armature
    tree.armature = armature
    tree.gravity.linear = model.opt.gravity
    return tree


def placed(position: np.ndarray, quaternion: np.ndarray) -> pinocchio.SE3:
    """A placement from MuJoCo's numbers; its quaternions begin with the real part."""
    return pinocchio.SE3(pinocchio.Quaternion(*quaternion).matrix(), position)


def hinge(model: mujoco.MjModel, joint: int) -> pinocchio.JointModelRevoluteUnaligned:
    """A hinge whose axis runs through the origin of its body."""
    assert model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE and not model.jnt_pos[joint].any()
    return pinocchio.JointModelRevoluteUnaligned(model.jnt_axis[joint])


def own_columns(model: mujoco.MjModel, tree: pinocchio.Model) -> np.ndarray:
    """Pinocchio's column of every degree of freedom of MuJoCo's, (nv,)."""
    first = [tree.joints[tree.getJointId(model.joint(j).name)].idx_v for j in range(model.njnt)]
    return np.concatenate([np.arange(ROOT_QVEL) + first[0], first[1:]])


def drawn(model: mujoco.MjModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Any place and attitude [mm, 1], joints within their ranges [rad], any velocities [mm/s, rad/s]."""
    attitude = rng.normal(size=4)
    joints = rng.uniform(*model.jnt_range[1:].T)
    qpos = np.concatenate([rng.normal(0.0, 50.0, 3), attitude / np.linalg.norm(attitude), joints])
    return qpos, np.concatenate([rng.normal(0.0, 200.0, 3), rng.normal(0.0, 10.0, model.nv - 3)])


def by_mujoco(model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix, armature included, and bias forces: gravity, Coriolis and centrifugal."""
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    return mass, data.qfrc_bias.copy()


def by_pinocchio(
    model: mujoco.MjModel, tree: pinocchio.Model, qpos: np.ndarray, qvel: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The same in MuJoCo's order and conventions.

    Pinocchio's free joint has its linear velocity in the body's frame and the quaternion's real part last; MuJoCo's has
    the velocity in the world, so at rest in the world Pinocchio's changes by -omega x v.  Hinges of MuJoCo's are turned
    by their angle less `qpos0`.
    """
    own, turn = own_columns(model, tree), np.eye(model.nv)
    turn[:3, :3] = pinocchio.Quaternion(*qpos[3:7]).matrix().T
    q, v = pinocchio.neutral(tree), np.zeros(tree.nv)
    q[:ROOT_QPOS] = qpos[[0, 1, 2, 4, 5, 6, 3]]
    q[own[ROOT_QVEL:] + ROOT_QPOS - ROOT_QVEL] = (qpos - model.qpos0)[ROOT_QPOS:]
    v[own] = turn @ qvel
    data, apparent = tree.createData(), np.zeros(tree.nv)
    apparent[:3] = -np.cross(v[3:6], v[:3])
    mass = np.triu(pinocchio.crba(tree, data, q))
    mass += np.triu(mass, 1).T
    bias = pinocchio.rnea(tree, data, q, v, apparent)
    return turn.T @ mass[np.ix_(own, own)] @ turn, turn.T @ bias[own]


def test_both_weigh_the_same(body, engines):
    model, tree = engines
    assert pinocchio.computeTotalMass(tree) == pytest.approx(model.body_mass.sum(), rel=1e-12)
    assert pinocchio.computeTotalMass(tree) == pytest.approx(body.mass, rel=1e-5)


def test_mass_matrices_and_bias_forces_agree(engines):
    model, tree = engines
    rng = np.random.default_rng(1998)
    for qpos, qvel in (drawn(model, rng) for _ in range(200)):
        mass, bias = by_mujoco(model, qpos, qvel)
        other_mass, other_bias = by_pinocchio(model, tree, qpos, qvel)
        inertia = np.sqrt(np.diag(mass))
        assert np.abs((other_mass - mass) / np.outer(inertia, inertia)).max() < RELATIVE
        for part in (slice(3), slice(3, ROOT_QVEL), slice(ROOT_QVEL, None)):
            assert np.abs(other_bias - bias)[part].max() < RELATIVE * np.abs(bias[part]).max()


def test_armature_and_frames_matter(engines):
    """What is matched by hand would be seen if it were not."""
    model, tree = engines
    qpos, qvel = drawn(model, np.random.default_rng(0))
    mass, bias = by_mujoco(model, qpos, qvel)
    bare = tree.copy()
    bare.armature = np.zeros(tree.nv)
    without, _ = by_pinocchio(model, bare, qpos, qvel)
    assert np.abs(np.diag(mass - without)[ROOT_QVEL:] - model.dof_armature[ROOT_QVEL:]).max() < 1e-9
    turned = np.concatenate([qpos[:3], [1.0, 0.0, 0.0, 0.0], qpos[ROOT_QPOS:]])
    assert np.abs(by_pinocchio(model, tree, turned, qvel)[1] - bias).max() > 1e-3 * np.abs(bias).max()
