"""Laws of the physical walks: they do not depend on threads or batch, and tend to the plan as V_p falls."""

import time
from contextlib import chdir
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin
from hexmj.errors import InputError, SimulationError
from hexmj.measures.compare import compare, physical_flss
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_outcomes, physical_walk
from hexmj.physics import engine
from hexmj.physics.engine import STATE_BITS, Diverged, MujocoBatch
from hexmj.physics.foot_path import OrdersFromPlan
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.rollout import drive
from hexmj.physics.settle import Settled, settle
from hexmj.stability import loss_time
from hexmj.starts import draw_starts
from hexmj.timing import Stride

OUTCOMES = tuple(Outcomes.__dataclass_fields__)


def velocities(settled: Settled) -> np.ndarray:
    """Of the starts as they settled, (start, velocity), to be written to."""
    model = settled.compiled.model
    return settled.state[:, model.nq : model.nq + model.nv]


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(24, 0))


@pytest.fixture(scope="module")
def walked():
    return physical_walk(draw_starts(12, 0), LDVS, 0.5, 60.0)


@pytest.fixture(scope="module")
def hundred():
    """Starts of LDVS at V = 0.5, compared."""
    return compare(LDVS, [0.5], n_starts=100)


def test_settled_starts_stand_still_on_six_feet(settled):
    assert np.linalg.norm(velocities(settled)[:, :3], axis=1).max() < 5.0
    assert (settled.qpos[:, 2] > 9.0).all()
    first = next(iter(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 10.0)))
    assert first.standing[:, 0].all()


def test_same_bits_for_any_threads_and_any_batch(settled):
    one, two = (physical_outcomes(settled, LDVS, 0.35, 40.0, threads=n) for n in (1, 2))
    for some in (slice(5, 9), slice(7, 8)):
        part = physical_outcomes(settle(settled.starts[some]), LDVS, 0.35, 40.0)
        for name in OUTCOMES:
            assert np.array_equal(getattr(one, name), getattr(two, name), equal_nan=True)
            assert np.array_equal(getattr(one, name)[some], getattr(part, name), equal_nan=True)


def test_walks_kept_whole_have_the_same_outcomes(walked):
    outcomes = physical_outcomes(settle(draw_starts(12, 0)), LDVS, 0.5, 60.0)
    for name in OUTCOMES:
        assert np.array_equal(getattr(walked.outcomes, name), getattr(outcomes, name), equal_nan=True)


def test_measured_tips_follow_the_plan(walked):
    """Standing feet are where the plan has them, but for the place of the centre of mass and the body's sway."""
    both = walked.planned.stance & walked.measured.stance
    off = np.abs(walked.measured.feet - walked.planned.feet)[both]
    assert np.percentile(off, 95) < 2.0
    assert np.array_equal(walked.outcomes.carried_loss, loss_time(walked.measured))
    assert walked.outcomes.unreachable.sum() == 0
    assert walked.outcomes.saturation.max() < 0.02


def test_every_bounce_counts_without_a_contact_gap():
    """Measured stability is stricter the shorter the gap; what the body does is the same."""
    every, usual = (
        physical_outcomes(settle(draw_starts(20, 0), Conditions(contact_gap=ms)), LDVS, 0.5, 40.0) for ms in (0.0, 10.0)
    )
    assert np.array_equal(every.fall, usual.fall)
    assert (every.carried_loss <= usual.carried_loss).all()
    assert np.isfinite(every.carried_loss).sum() > np.isfinite(usual.carried_loss).sum()


def test_nothing_is_measured_after_a_fall():
    walked = physical_walk(draw_starts(6, 0), UNCOORDINATED, 0.7, 60.0)
    fall = walked.outcomes.fall
    assert np.isfinite(fall).all()
    for start in range(6):
        over = walked.planned.time > fall[start] + 1e-9
        assert np.isnan(walked.measured.x[over, start]).all()
        assert not walked.measured.stance[over, start].any()
        assert np.isfinite(walked.measured.x[~over, start]).all()
        assert walked.outcomes.fall_part[start] in range(len(STICK_INSECT.trunk))
    assert (walked.outcomes.clearance < 0.01).all()


@pytest.mark.parametrize("steps", [3, 1000])
def test_in_any_pieces_starts_settle_to_the_same_bits(monkeypatch, steps):
    whole = settle(draw_starts(3, 0))
    monkeypatch.setattr(engine, "INTERRUPTIBLE", steps)
    pieces = settle(draw_starts(3, 0))
    for name in ("state", "ctrl", "load", "torques"):
        assert np.array_equal(getattr(pieces, name), getattr(whole, name))


@pytest.mark.parametrize("own", [None, time.perf_counter], ids=["none", "the user's"])
def test_mujocos_clock_stops_only_while_a_batch_steps(own):
    mujoco.set_mjcb_time(own)
    try:
        with engine.stepping():
            stopped = mujoco.get_mjcb_time()
            with engine.stepping():
                pass
            assert mujoco.get_mjcb_time() is stopped is not own
        settle(draw_starts(1, 0))
        assert mujoco.get_mjcb_time() is own
    finally:
        mujoco.set_mjcb_time(None)


@pytest.mark.slow
def test_speed_keeps_to_the_command(hundred):
    """0.95 to 1.05 of the commanded speed over the observation time `walk` where the start did not fall."""
    slow = compare(LDVS, [0.3], n_starts=40)
    speed = np.concatenate([one.speed.values[np.isinf(one.fall)] for one in (slow, hundred)])
    assert len(speed) > 60
    assert ((speed > 0.95) & (speed < 1.05)).all()


@pytest.mark.slow
def test_slow_walks_tend_to_the_static_criterion():
    """At V_p = 20 mm/s both FLSS differ by at most 0.06, and both answers agree for at least 0.88 of the starts."""
    result = compare(LDVS, [0.5], n_starts=100, conditions=Conditions(vp=20.0))
    assert (abs(result.kinematic - result.physical) <= 0.06).all()
    assert (result.agreement >= 0.88).all()


def test_an_insect_alone_walks_as_among_others():
    """To the last bit, though more of its plan is asked for at once; one of these falls."""
    starts = draw_starts(1000, 0)[[3, 1]]
    both = physical_outcomes(settle(starts), LDVS, 0.7, 34.5)
    for i, start in enumerate(starts):
        alone = physical_outcomes(settle(start[np.newaxis]), LDVS, 0.7, 34.5)
        for name, values in vars(both).items():
            assert np.array_equal(getattr(alone, name), values[i : i + 1]), name
    assert np.isfinite(both.fall).any() and not np.isfinite(both.fall).all()


def test_what_one_is_told_until_it_falls_does_not_depend_on_who_walks_beside_it():
    starts = draw_starts(1000, 0)[[3, 1]]
    how: Any = {"controller": SensoryFeedback(LDVS), "velocity": 0.7, "duration": 34.5}
    both = physical_walk(starts, **how)
    fallen = both.ordered.time > both.outcomes.fall.min() + 1.0
    for i, start in enumerate(starts):
        alone = physical_walk(start[np.newaxis], **how)
        for name in ("x", "y", "stance", "aep", "height"):
            told = getattr(both.ordered, name)[:, i : i + 1]
            assert np.array_equal(getattr(alone.ordered, name), told, equal_nan=name != "stance"), name
    assert np.isnan(both.ordered.x[fallen][:, np.isfinite(both.outcomes.fall)]).all()
    assert np.isfinite(both.ordered.x[:, np.isnan(both.outcomes.fall)]).all()
    assert fallen.any() and not np.isfinite(both.outcomes.fall).all()


def test_a_start_that_does_not_settle_is_an_error_not_a_fall():
    with pytest.raises(SimulationError):
        settle(draw_starts(2, 0), Conditions(settling_time=1.0))
    with pytest.raises(SimulationError):
        settle(draw_starts(24, 0), Conditions(settling_time=0.01, longest_substep=0.3125))


def test_an_insect_that_diverges_as_it_settles_is_an_error(monkeypatch):
    def diverge(*_):
        raise Diverged(1, "mjWARN_BADQACC", {"qpos": np.zeros(25)})

    monkeypatch.setattr(MujocoBatch, "rest", diverge)
    with pytest.raises(SimulationError):
        settle(draw_starts(2, 0))


@pytest.fixture(scope="module")
def diverged(tmp_path_factory) -> SimulationError:
    """Of a walk whose start 1 is too fast from the beginning."""
    broken = settle(draw_starts(3, 0))
    velocities(broken)[1] = 1e12
    with chdir(tmp_path_factory.mktemp("log")), pytest.raises(SimulationError) as error:  # MuJoCo writes its own log
        list(drive(broken, begin(LDVS, broken.starts, 0.3, broken.stride), 10.0))
    return error.value


def test_a_diverged_simulation_is_an_error_with_its_last_good_state(diverged, settled):
    assert (diverged.state["qvel"] == 1e12).all()
    assert np.array_equal(diverged.state["qpos"], settled.qpos[1])


def test_a_roll_is_mujocos_own_steps(settled):
    """To the last bit, with what the solver goes on from, and so after steps in parts."""
    model, ids = settled.compiled.model, np.array([3])
    control = settled.ctrl[ids, np.newaxis].repeat(5, axis=1) + np.linspace(0.0, 0.1, 5)[:, np.newaxis]
    batch, data = MujocoBatch(settled.compiled, 24, 1), mujoco.MjData(model)
    batch.roll(ids, control, 4)
    batch.put(ids, settled.state[ids])
    rolled = batch.roll(ids, control, 1)
    data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = np.split(settled.state[3], [model.nq, model.nq + model.nv])
    for n in range(5):
        data.ctrl[:] = control[0, n]
        mujoco.mj_step(model, data)
        assert np.array_equal(rolled.after[0, n], np.concatenate([data.qpos, data.qvel, data.qacc_warmstart]))
        assert np.array_equal(rolled.sensors[0, n], data.sensordata)


def test_what_a_body_shows_where_it_stands_is_mujocos_own(settled):
    """Feet, centre of mass and contacts of the trunk, whether it is above the ground, at it, or in it."""
    model, columns, states, rng = settled.compiled.model, settled.compiled.columns, settled.state.copy(), default_rng(0)
    states[:, 2] += np.linspace(-1.0, 1.0, 24) * settled.conditions.standing_height
    states[:, 3:7] = Rotation.from_euler("xyz", rng.normal(0.0, 0.3, (24, 3))).as_quat(scalar_first=True)
    batch, data, ids = MujocoBatch(settled.compiled, 24, 1), mujoco.MjData(model), np.arange(24)
    batch.stand(ids, states, settled.ctrl)
    for i in ids:
        mujoco.mj_setState(model, data, states[i], STATE_BITS)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_sensorPos(model, data)
        for shown in (columns.foot, columns.centre_of_mass, columns.trunk):
            assert np.array_equal(batch.sensors[i, shown], data.sensordata[shown])
    falls = (batch.sensors[:, columns.trunk] > 0).any(axis=1)
    assert 4 < falls.sum() < 20


def test_every_start_is_stable_fallen_or_refused_with_a_reason():
    """Under conditions drawn at random: no walk ends in any other way."""
    rng, seen = default_rng(5), set()
    for case in range(8):
        low, high = (20.0, 6.0, 8.0, 0.0, 0.2, 0.0), (300.0, 14.0, 13.0, 2.0, 2.0, 12.0)
        names = ("vp", "step_height", "standing_height", "load", "friction", "grasp")
        drawn = Conditions(**dict(zip(names, rng.uniform(low, high).tolist(), strict=True)))
        try:
            outcomes = physical_walk(draw_starts(3, case), LDVS, rng.uniform(0.2, 0.9), 30.0, conditions=drawn).outcomes
            assert ((outcomes.fall > 0) & np.isfinite(outcomes.clearance) & np.isfinite(outcomes.slip)).all()
            seen |= set(np.isfinite(outcomes.fall).tolist())
        except (InputError, SimulationError) as refused:
            assert str(refused)
            seen.add("refused")
    assert False in seen and len(seen) > 1


def test_starts_out_of_reach_are_refused():
    with pytest.raises(InputError):
        settle(np.full((1, 6), -30.0), stride=Stride(pep_min=-30.0))


def test_legs_out_of_reach_keep_their_last_angles_however_the_plan_is_divided():
    """Chunk by chunk or step by step: the same targets, all numbers, and as many misses."""
    settled = settle(draw_starts(4, 0), Conditions(standing_height=7.0, step_height=14.0))
    plans = [OrdersFromPlan(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 40.0) for _ in range(2)]
    chunks, steps = (
        list(iter(lambda one=one, steps=steps: one.ahead(np.arange(4), steps), None))
        for one, steps in zip(plans, (None, 1), strict=True)
    )
    (control, missed), (control_by_step, missed_by_step) = (
        [np.concatenate([getattr(one, name) for one in each], axis=1) for name in ("control", "missed")]
        for each in (chunks, steps)
    )
    assert np.array_equal(control, control_by_step)
    assert np.array_equal(missed, missed_by_step)
    angles, out = control[:, :-1].reshape(4, -1, 6, 3), missed
    assert out.any()
    assert np.array_equal(angles[:, 1:][out[:, 1:]], angles[:, :-1][out[:, 1:]])


def test_feet_grasp_while_the_plan_lets_them_stand():
    """From the substep on in which a step of the plan begins; the one after the last step is like the last."""
    settled = settle(draw_starts(3, 0), Conditions(grasp=0.5))
    orders = OrdersFromPlan(settled, begin(UNCOORDINATED, settled.starts, 0.5, settled.stride), 12.0)
    ids, m = np.array([2, 0]), settled.substeps
    grasp = np.concatenate([one.control[:, :, 18:] for one in iter(lambda: orders.ahead(ids), None)], axis=1)
    stance = walk(settled.starts, UNCOORDINATED, 0.5, 12.0).stance[:, ids].swapaxes(0, 1)
    assert np.array_equal(grasp[:, :-1].reshape(2, -1, m, 6), stance[:, :, np.newaxis].repeat(m, axis=2))
    assert np.array_equal(grasp[:, -1], stance[:, -1])
    assert not stance.all()


@pytest.mark.slow
def test_halving_the_physics_step_hardly_changes_physical_flss(hundred):
    """Measured with 200 starts at V = 0.3, 0.5, 0.7: 0.155, 0.365, 0.690 became 0.160, 0.365, 0.695."""
    assert Conditions().longest_substep == 0.625
    fine = physical_flss(LDVS, [0.5], n_starts=50, conditions=Conditions(longest_substep=0.3125))
    usual = np.isfinite(hundred.fall.values.squeeze()[:50]).mean()
    assert abs(usual - fine.flss.item()) <= 0.02
