"""Laws that the physics must keep: units, mirror, time step, momentum, penetration and energy."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch
from numpy.testing import assert_allclose, assert_array_equal

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.controllers.planning import begin
from hexmj.legs import MIRROR
from hexmj.measures.compare import physical_flss
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_outcomes, physical_walk, physical_walk_of_plan
from hexmj.physics.engine import STATE
from hexmj.physics.foot_path import OrdersFromPlan
from hexmj.physics.outcomes import OutcomesSoFar
from hexmj.physics.rollout import drive
from hexmj.physics.settle import Settled, settle
from hexmj.rotations import heading, rotated, turned
from hexmj.stability import loss_time
from hexmj.starts import draw_starts

MM, G = 1e-3, 1e-3  # in m and kg
LENGTHS = (
    "body_pos", "body_ipos", "jnt_pos", "geom_pos", "geom_size", "geom_rbound", "geom_aabb", "bvh_aabb", "site_pos",
    "site_size", "pair_margin", "pair_gap",
)  # fmt: skip
TORQUES = ("actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "dof_damping")
INERTIAS = ("body_inertia", "dof_armature")
GRAVITY = 9810.0  # mm/s^2
WEIGHT = STICK_INSECT.mass * GRAVITY
FALL_HEIGHT = 20.0  # mm


def in_si(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same insect in m, kg, s: every number of the compiled model that has a length or a mass in its unit."""
    si = copy.copy(model)
    scales = [(MM, LENGTHS), (G, ("body_mass",)), (G * MM**2, TORQUES + INERTIAS)]
    for scale, names in scales:
        for name in names:
            getattr(si, name)[:] *= scale
    si.pair_solimp[:, 2] *= MM  # the width of the transition; that of joint limits is an angle
    si.pair_friction[:, 2:] *= MM  # torsion and rolling
    for qpos in (si.qpos0, si.qpos_spring, si.key_qpos[0]):
        qpos[:3] *= MM
    si.opt.gravity[:] *= MM
    si.opt.tolerance *= MM  # an acceleration
    si.opt.ccd_tolerance *= MM
    mujoco.mj_setConst(si, mujoco.MjData(si))
    si.stat.meaninertia = si.dof_M0.mean()  # as the compiler has it
    return si


def walk_of(model: mujoco.MjModel, settled: Settled, control: np.ndarray, length: float) -> np.ndarray:
    """Paths of the roots, (start, substep, 3), in a model whose unit of length is `length` mm."""
    batch = Batch(model, len(settled.starts), 2)
    parts = np.split(settled.state, np.cumsum([model.nq, model.nv]), axis=1)
    for name, values in zip(STATE, parts, strict=True):
        batch.bind(name)[:] = values
        batch.bind(name)[:, :3] /= length
    return batch.rollout(control.shape[1], control, record=("qpos",))["qpos"][:, :, :3] * length


def test_the_same_insect_in_si_units_walks_the_same_way():
    settled = settle(draw_starts(6, 0))
    targets = OrdersFromPlan(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 60.0)
    orders = list(iter(lambda: targets.ahead(np.arange(6)), None))
    control = np.concatenate([one.control for one in orders], axis=1)
    model = settled.compiled.model
    assert_allclose(model.dof_M0.mean(), model.stat.meaninertia)
    ours, si = walk_of(model, settled, control, 1.0), walk_of(in_si(model), settled, control, 1 / MM)
    length = np.linalg.norm(ours[:, -1] - ours[:, 0], axis=1)
    assert (length > 20.0).all()
    assert (np.linalg.norm(ours - si, axis=2).max(axis=1) < 0.005 * length).all()
    forgotten = in_si(model)
    forgotten.pair_solimp[:, 2] /= MM
    off = np.linalg.norm(ours - walk_of(forgotten, settled, control, 1 / MM), axis=2).max(axis=1)
    assert (off > 0.005 * length).any(), "this test would not notice a length that was left in mm"


def test_mirrored_starts_walk_mirrored_paths():
    starts, mirror = draw_starts(8, 3), list(MIRROR)
    one, other = (physical_walk(x, LDVS, 0.5, 40.0) for x in (starts, starts[:, mirror]))
    assert np.array_equal(one.outcomes.fall, other.outcomes.fall)
    assert_allclose(one.qpos[..., :3], other.qpos[..., :3] * [1, -1, 1], atol=1e-9)
    assert_allclose(one.measured.x, other.measured.x[..., mirror], atol=1e-9)
    assert np.array_equal(one.measured.stance, other.measured.stance[..., mirror])


@pytest.mark.slow
def test_physical_flss_at_a_quarter_of_the_time_step_stays_within_its_interval():
    """`test_physics` has the half of it, over the observation time `walk`."""
    conditions = (Conditions(longest_substep=ms) for ms in (0.625, 0.15625))
    whole, quarter = (
        physical_flss(LDVS, [0.5], n_starts=60, observation_time="start", conditions=one) for one in conditions
    )
    assert whole.low.item() <= quarter.flss.item() <= whole.high.item()


@pytest.fixture(scope="module")
def resting():
    """Forces, (start, leg) [g mm/s^2], and heights, (start, leg) [mm], of the feet of 30 starts that stand still."""
    settled = settle(draw_starts(30, 4))
    first = next(iter(drive(settled, begin(LDVS, settled.starts, 0.0, settled.stride), 1.0)))
    columns = settled.compiled.columns
    return first.sensors[:, 0, columns.touch], heights(settled, first.sensors[:, 0])


def heights(settled: Settled, sensors: np.ndarray) -> np.ndarray:
    """Of the feet's lowest points, (..., leg) [mm]."""
    feet = sensors[..., settled.compiled.columns.foot]
    return feet.reshape(*feet.shape[:-1], 6, 3)[..., 2] - settled.compiled.foot_radius


def test_at_rest_the_feet_carry_the_weight_and_hardly_sink_in(resting):
    force, height = resting
    assert_allclose(force.sum(axis=1), WEIGHT, rtol=0.01)
    assert -height.min() < 0.02 * Conditions().standing_height


@pytest.fixture(scope="module")
def walking():
    """12 settled starts and what their sensors showed in 40 time units, (start, substep, column)."""
    settled = settle(draw_starts(12, 4))
    shown = list(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 40.0))
    assert not any(one.fell.any() for one in shown), "this test needs starts that do not fall"
    return settled, np.concatenate([one.sensors for one in shown], axis=1)


def test_over_a_walk_the_ground_carries_the_weight(walking):
    """Momentum: mean vertical force = weight + change of vertical momentum over time."""
    settled, sensors = walking
    columns, h = settled.compiled.columns, settled.compiled.model.opt.timestep
    force = sensors[:, 1:-1, columns.touch].sum(axis=2)
    height = sensors[:, :, columns.centre_of_mass][:, :, 2]
    momentum = STICK_INSECT.mass * np.diff(height, axis=1) / h
    balance = force.mean(axis=1) - (momentum[:, -1] - momentum[:, 0]) / (h * force.shape[1])
    assert_allclose(balance, WEIGHT, rtol=0.001)


def fall_energy(timestep: float, integrator: mujoco.mjtIntegrator, seconds: float, seed: int) -> np.ndarray:
    """Total energy, (step,) [g mm^2/s^2], of an insect without muscles, turning and waving its legs as it falls."""
    model = compile_body(Conditions(), timestep, looks=False).model
    model.opt.integrator = integrator
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2] += FALL_HEIGHT
    rng = np.random.default_rng(seed)
    data.qvel[3:6], data.qvel[6:] = rng.normal(0.0, 5.0, 3), rng.normal(0.0, 1.0, 18)
    energy = []
    for _ in range(round(seconds / timestep)):
        mujoco.mj_forward(model, data)
        energy.append(data.energy.sum())
        mujoco.mj_step(model, data)
    assert data.warning.number.sum() == 0
    return np.array(energy)


def test_free_flight_conserves_energy_as_far_as_the_integrator_does():
    """To 1e-9 of the potential energy lost with Runge-Kutta; ours loses a share that halves with the time step."""
    seconds, integrators = 0.05, mujoco.mjtIntegrator
    gained = WEIGHT * GRAVITY * seconds**2 / 2
    exact = fall_energy(STICK_INSECT.longest_step, integrators.mjINT_RK4, seconds, 0)
    assert np.ptp(exact) < 1e-9 * gained
    coarse, fine = (-np.diff(fall_energy(h, integrators.mjINT_IMPLICITFAST, seconds, 0)).sum() for h in (5e-4, 2.5e-4))
    assert 0 < coarse < 0.02 * gained
    assert coarse / fine == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_a_passive_fall_never_gains_energy(seed):
    """What soft contacts give back within it is below 1 % of what they and the joints' limits take."""
    energy = fall_energy(0.000625, mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 0.4, seed)
    lost = energy[0] - energy[-1]
    assert lost > WEIGHT * FALL_HEIGHT
    assert energy.max() == energy[0]
    assert (energy - np.minimum.accumulate(energy)).max() < 0.01 * lost


def test_tracking_is_a_percentile_and_depth_the_most_of_all_feet():
    """The same distances and depths, kept whole: root, foot and target of every substep until the fall."""
    settled = settle(draw_starts(6, 0))
    outcomes = physical_outcomes(settled, LDVS, 0.5, 40.0)
    columns = settled.compiled.columns
    seen: list[list[np.ndarray]] = [[] for _ in range(6)]
    deepest, shown = np.zeros(6), np.zeros(6)
    for one in drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 40.0):
        for row, start in enumerate(one.ids):
            qpos, targets = one.qpos[row, : one.valid[row]], one.targets[row, : one.valid[row]]
            feet = one.sensors[row, : one.valid[row], columns.foot].reshape(-1, 6, 3)
            turned = qpos[:, None, :3] + rotated(qpos[:, None, 3:7], targets)
            off = np.linalg.norm(feet - turned, axis=2)
            seen[start].append(off[targets[:, :, 2] == -settled.conditions.standing_height])
            until = one.valid[row] - one.fell[row]
            deepest[start] = max(deepest[start], one.depth[row, :until].max())
            shown[start] = max(shown[start], -heights(settled, one.sensors[row, : one.valid[row]]).min())
    whole = np.array([np.percentile(np.concatenate(one), 95, method="inverted_cdf") for one in seen])
    assert ((whole <= outcomes.tracking) & (outcomes.tracking < whole + 0.01 + 1e-9)).all()
    assert_array_equal(outcomes.depth, deepest)
    assert (shown <= deepest).all()


def lowest_points_slide(compiled, qpos):
    """Return how far the points of the feet that are lowest in each posture, (time, position), move until the next,
    (time - 1, leg, 2) [mm]: points of MuJoCo's bodies, halfway between the lowest before and after."""
    model, data, feet = compiled.model, mujoco.MjData(compiled.model), list(compiled.body.feet)
    tibia = model.site_bodyid[[model.site(foot).id for foot in feet]]
    down = np.array([0.0, 0.0, -compiled.foot_radius])
    seen = []
    for data.qpos[:] in qpos:
        mujoco.mj_kinematics(model, data)
        seen.append((data.site_xpos[[model.site(foot).id for foot in feet]], data.xmat[tibia].reshape(6, 3, 3)))
    centre, turn = (np.array(each) for each in zip(*seen, strict=True))
    material = (down @ turn[:-1] + down @ turn[1:])[..., None] / 2  # in the frame of the tibia
    return (np.diff(centre, axis=0) + (np.diff(turn, axis=0) @ material)[..., 0])[..., :2]


def test_a_foot_that_rolls_does_not_slip():
    """The body turns about a lateral axis while one foot alone carries it and rolls ahead."""
    settled = settle(draw_starts(1, 0))
    compiled, qpos = settled.compiled, settled.qpos[0]
    chunk = next(iter(drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 1.0)))
    angle = 0.001 * np.arange(chunk.qpos.shape[1])
    ahead = np.outer(angle, [compiled.foot_radius, 0.0, 0.0])
    turning = np.stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], axis=-1)
    tip = compiled.forward(qpos[compiled.columns.qpos].reshape(6, -1))[0]
    rolling = np.column_stack([ahead - rotated(turning, tip), turning, np.tile(qpos[7:], (len(angle), 1))])
    sensors = np.zeros(chunk.sensors.shape)
    sensors[0, :, compiled.columns.foot][:, :3], sensors[0, :, compiled.columns.touch.start] = ahead, 1.0
    so_far = OutcomesSoFar(settled, np.full(1, np.inf))
    so_far.add(replace(chunk, qpos=rolling[None], sensors=sensors))
    assert so_far.outcomes().slip == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("controller", "velocity", "vp", "strength"),
    [(LDVS, 0.5, 400.0, 0.1), (UNCOORDINATED, 0.7, 80.0, 1.0), (LDVS, 0.01, 80.0, 1.0)],
)
def test_outcomes_are_what_the_chunks_show(controller, velocity, vp, strength):
    """Whole walks and plain arrays instead of sums; weak servos and one substep a step, falls, 0.3 mm commanded."""
    settled, duration = settle(draw_starts(6, 0), Conditions(vp=vp)), 30.0
    compiled, m, dt = settled.compiled, settled.substeps, settled.stride.dt
    compiled.model.actuator_forcerange[:] *= strength
    outcomes = physical_outcomes(settled, controller, velocity, duration)
    planned = walk(settled.starts, controller, velocity, duration)
    plan = begin(controller, settled.starts, velocity, settled.stride)
    walked = physical_walk_of_plan(settled, plan, planned)
    chunks = list(drive(settled, begin(controller, settled.starts, velocity, settled.stride), duration))
    (corners, radii), columns = compiled.trunk_corners, compiled.columns
    for start in range(6):
        rows = [(one, int(np.flatnonzero(one.ids == start)[0])) for one in chunks if start in one.ids]
        fell = rows[-1][0].fell[rows[-1][1]]
        until = [one.valid[row] for one, row in rows]
        qpos, sensors, force, depth = (
            [getattr(one, name)[row, :valid] for (one, row), valid in zip(rows, until, strict=True)]
            for name in ("qpos", "sensors", "force", "depth")
        )
        slid, contacts = 0.0, 0
        for one, places in zip(sensors, qpos, strict=True):  # from substep to substep of a chunk
            touch = one[:, columns.touch] > 0
            both = touch[1:] & touch[:-1]
            slid += np.linalg.norm(lowest_points_slide(compiled, places), axis=-1)[both].sum()
            contacts += both.sum()
        q, shown, torques = np.concatenate(qpos), np.concatenate(sensors), np.abs(np.concatenate(force))
        lowest = q[:, None, 2] + rotated(q[:, None, 3:7], corners)[..., 2] - radii
        upright = rotated(q[:, 3:7], np.array([0.0, 0.0, 1.0]))[:, 2]
        taken = len(q) - 1 if fell else round(duration / dt) * m
        assert outcomes.clearance[start] == pytest.approx(lowest.min())
        assert outcomes.tilt[start] == pytest.approx(np.arccos(upright.min()))
        assert outcomes.slip[start] == pytest.approx(slid / contacts / compiled.model.opt.timestep)
        assert outcomes.saturation[start] == (torques >= 0.999 * compiled.torque_limits).mean()
        assert outcomes.depth[start] == max(0.0, np.concatenate(depth)[: len(q) - fell].max())
        assert outcomes.speed[start] == pytest.approx((q[-1, 0] - settled.qpos[start, 0]) / (velocity * dt * taken / m))
        assert outcomes.fall[start] == (pytest.approx(taken / m * dt) if fell else np.inf)
        trunk = shown[-1, columns.trunk] > 0
        assert outcomes.fall_part[start] == (np.argmax(trunk) if fell else -1)
        steps, centre = slice(m, None, m), shown[:, columns.centre_of_mass]
        feet = shown[:, columns.foot].reshape(-1, 6, 3) - centre[:, None]
        seen = turned(feet[..., :2], -heading(q[:, 3:7]))[steps]
        known = slice(len(seen))
        assert_allclose(walked.centre_of_mass[known, start], centre[steps])
        assert_allclose(walked.measured.feet[known, start], seen, atol=1e-9)
        standing = np.concatenate([one.standing[row, :valid] for (one, row), valid in zip(rows, until, strict=True)])
        assert_array_equal(walked.measured.stance[known, start], standing[steps])
        height = shown[:, columns.foot].reshape(-1, 6, 3)[..., 2] - compiled.foot_radius
        assert_allclose(walked.height[known, start], height[steps], atol=1e-9)
        assert_array_equal(walked.load[known, start], shown[steps, columns.touch])
        for unknown in (walked.measured.x, walked.height, walked.load):
            assert np.isnan(unknown[len(seen) :, start]).all()
    assert_array_equal(outcomes.carried_loss, loss_time(walked.measured))
    assert np.isfinite(outcomes.fall).any() == (velocity == 0.7)
    assert outcomes.saturation.any() == (strength < 1.0)


def test_targets_belong_to_the_state_that_is_shown():
    """Standing legs shall stay where they are from the first substep on, the one after the last step included."""
    settled = settle(draw_starts(4, 0))
    shown = list(drive(settled, begin(LDVS, settled.starts, 0.0, settled.stride), 2.0))
    targets = np.concatenate([one.targets for one in shown], axis=1)
    assert targets.shape[1] == sum(one.qpos.shape[1] for one in shown)
    assert (targets[..., 2] == -settled.conditions.standing_height).all()
    assert (targets[..., 0] == (settled.starts + settled.stride.geometry.origin)[:, None]).all()
