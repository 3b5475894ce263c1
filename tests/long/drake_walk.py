"""The same targets walked by Drake: which of the same starts fall?  `python -m tests.long.drake_walk [starts]`.

Drake (`pip install drake`, 42 MB) is no dependency, and this no test of CI.  It is given the compiled body, with the
servos as its own implicit PD control and the feet as compliant points of its SAP solver, in mm, g and s; it settles by
itself and hears nothing of MuJoCo but the joint targets, which the plan and our inverse kinematics make.
"""

import sys

import mujoco
import numpy as np
from pydrake.all import (  # pyright: ignore[reportMissingImports]
    CoulombFriction,
    DiagramBuilder,
    DiscreteContactApproximation,
    FixedOffsetFrame,
    HalfSpace,
    MultibodyPlant,
    PdControllerGains,
    RevoluteJoint,
    RigidTransform,
    RotationalInertia,
    RotationMatrix,
    SceneGraph,
    Simulator,
    SpatialInertia,
    Sphere,
)
from pydrake.common.eigen_geometry import Quaternion  # pyright: ignore[reportMissingImports]

from hexmj.body import ROOT_QPOS
from hexmj.controllers.checked_plans import begin
from hexmj.controllers.cruse1998 import LDVS
from hexmj.stats import wilson_interval
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.orders import OrdersFromPlan
from hexmj.physics.settling import Settled, settle
from hexmj.rotations import rotated
from hexmj.starts import draw_starts
from hexmj.timing import observation_time

SINK = 0.015
"""How deep a standing foot sinks in [mm], about as MuJoCo's does."""

SLIP = 1.0
"""Speed below which friction is regularised [mm/s]; MuJoCo's feet slip by 2.5 mm/s."""


class DrakeInsect:
    """One insect in Drake."""

    def __init__(self, settled: Settled) -> None:
        """The compiled body of settled starts."""
        self._settled, model = settled, settled.compiled.model
        builder = DiagramBuilder()
        self._plant, scene = MultibodyPlant(model.opt.timestep), builder.AddSystem(SceneGraph())
        self._plant.RegisterAsSourceForSceneGraph(scene)
        self._joints = self._build(model)
        self._plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        self._plant.mutable_gravity_field().set_gravity_vector(model.opt.gravity)
        self._plant.set_penetration_allowance(SINK)
        self._plant.set_stiction_tolerance(SLIP)
        self._plant.Finalize()
        builder.AddSystem(self._plant)
        builder.Connect(
            self._plant.get_geometry_pose_output_port(), scene.get_source_pose_port(self._plant.get_source_id())
        )
        builder.Connect(scene.get_query_output_port(), self._plant.get_geometry_query_input_port())
        self._diagram = builder.Build()
        self._order = np.array([joint.position_start() - ROOT_QPOS for joint in self._joints])

    def _build(self, model: mujoco.MjModel) -> list[RevoluteJoint]:
        """Bodies, joints with servos and limits, feet on the ground; the joints in MuJoCo's order."""
        plant, compiled = self._plant, self._settled.compiled
        plant.RegisterCollisionGeometry(
            plant.world_body(), RigidTransform(), HalfSpace(), "ground", CoulombFriction(1.0, 1.0)
        )
        bodies, joints = [plant.world_body()], []
        for one in range(1, model.nbody):
            turn = placed(np.zeros(3), model.body_iquat[one]).rotation().matrix()
            about = turn @ np.diag(model.body_inertia[one]) @ turn.T
            inertia = RotationalInertia(*np.diag(about), about[0, 1], about[0, 2], about[1, 2])
            mass = SpatialInertia.MakeFromCentralInertia(model.body_mass[one], model.body_ipos[one], inertia)
            body = plant.AddRigidBody(model.body(one).name, mass)
            bodies.append(body)
            parent, here = bodies[model.body_parentid[one]], placed(model.body_pos[one], model.body_quat[one])
            if model.body_jntnum[one] == 0:
                plant.WeldFrames(parent.body_frame(), body.body_frame(), here)
            elif model.body_jntadr[one] > 0:
                j = model.body_jntadr[one]
                frame = plant.AddFrame(FixedOffsetFrame(f"{model.joint(j).name}_frame", parent.body_frame(), here))
                joint = RevoluteJoint(
                    model.joint(j).name, frame, body.body_frame(), model.jnt_axis[j],
                    *(model.jnt_range[j] - model.qpos0[model.jnt_qposadr[j]]), 0.0,
                )  # fmt: skip
                joints.append(plant.AddJoint(joint))
        for joint, actuator in zip(joints, range(len(joints)), strict=True):
            servo = plant.AddJointActuator(joint.name(), joint, model.actuator_forcerange[actuator, 1])
            servo.set_default_rotor_inertia(model.dof_armature[-1])
            stiffness, damping = model.actuator_gainprm[actuator, 0], -model.actuator_biasprm[actuator, 2]
            servo.set_controller_gains(PdControllerGains(p=stiffness, d=damping))
        for foot in compiled.body.feet:
            geom = model.geom(foot)
            plant.RegisterCollisionGeometry(
                bodies[int(geom.bodyid[0])], placed(geom.pos, geom.quat), Sphere(float(geom.size[0])), foot,
                CoulombFriction(1.0, 1.0),
            )  # fmt: skip
        return joints

    def fall(self, start: int, control: np.ndarray) -> float:
        """When a start's trunk touches the ground [s], inf if it does not.

        Args:
            start: index among the settled starts.
            control: joint targets of every physics step, (substep, joint).
        """
        settled, plant = self._settled, self._plant
        simulator = Simulator(self._diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        joints, reference = np.zeros(len(self._joints)), settled.compiled.model.qpos0[ROOT_QPOS:]
        joints[self._order] = settled.ctrl[start, : len(joints)] - reference
        height = settled.conditions.standing_height + settled.compiled.foot_radius
        plant.SetPositions(context, np.concatenate([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, height], joints]))
        h = settled.compiled.model.opt.timestep
        resting = round(settled.conditions.settling_time / 1000.0 / h)
        desired, (corners, radii) = np.zeros(2 * len(joints)), settled.compiled.trunk_corners
        port = plant.get_desired_state_input_port(plant.GetModelInstanceByName("DefaultModelInstance"))
        for step in range(resting + len(control)):
            desired[self._order] = (
                control[max(0, step - resting)] - reference
                if step >= resting
                else (settled.ctrl[start, : len(joints)] - reference)
            )
            port.FixValue(context, desired)
            simulator.AdvanceTo((step + 1) * h)
            root = plant.GetPositions(context)[:ROOT_QPOS]
            if (root[6] + rotated(root[None, :4], corners)[:, 2] - radii).min() < 0.0:
                return (step - resting) * h
        return np.inf


def placed(position: np.ndarray, quaternion: np.ndarray) -> RigidTransform:
    """A placement from MuJoCo's numbers."""
    return RigidTransform(RotationMatrix(Quaternion(quaternion / np.linalg.norm(quaternion))), position)


def main(count: int) -> None:
    """Walk the starts at two velocities in both engines, and tell how they fall."""
    starts = draw_starts(count, 0)
    settled = settle(starts)
    insect = DrakeInsect(settled)
    for velocity in (0.3, 0.5):
        duration = float(observation_time("walk", velocity, settled.stride))
        ours = physical_outcomes(settled, LDVS, velocity, duration).fall
        orders = OrdersFromPlan(settled, begin(LDVS, starts, velocity, settled.stride), duration)
        parts = []
        while told := orders.ahead(np.arange(count)):
            parts.append(told.control)
        control = np.concatenate(parts, axis=1)
        theirs = np.array([insect.fall(start, control[start]) for start in range(count)])
        fell, other = np.isfinite(ours), np.isfinite(theirs)
        agreed = int((fell == other).sum())
        low, high = wilson_interval(agreed, count)
        both = fell & other
        apart = np.abs(ours[both] / settled.conditions.vp - theirs[both])
        print(
            f"V = {velocity:g}: {fell.sum()} of {count} fall in MuJoCo, {other.sum()} in Drake, the same answer for"
            f" {agreed} ({low:.2f}-{high:.2f}); of the {both.sum()} that fall in both, half within"
            f" {np.median(apart):.2g} s",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
