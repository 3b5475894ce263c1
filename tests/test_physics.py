"""Laws of the physical walks: they do not depend on threads or batch, and tend to the plan as V_p falls."""

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch
from numba import cfunc
from numpy.testing import assert_allclose

from hexmj.comparison import compare, physical_flss
from hexmj.errors import InputError, SimulationError
from hexmj.legs import MIRROR
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun
from hexmj.parameters import LDVS, UNCOORDINATED, Network
from hexmj.physics import insect
from hexmj.physics.body import Body
from hexmj.physics.divergence import raise_if_diverged, replay
from hexmj.physics.drive import Push, drive
from hexmj.physics.measurement import Outcomes
from hexmj.physics.physical_walks import physical_outcomes, physical_walk
from hexmj.physics.settling import settle

OUTCOMES = tuple(Outcomes.__dataclass_fields__)


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(24, 0))


@pytest.fixture(scope="module")
def walked():
    return physical_walk(draw_starts(12, 0), LDVS, 0.5, 60.0)


def test_settled_starts_stand_still_on_six_feet(settled):
    assert np.linalg.norm(settled.qvel[:, :3], axis=1).max() < 5.0
    assert (settled.qpos[:, 2] > 9.0).all()
    first = next(iter(drive(settled, NetworkRun(settled.starts, LDVS, 0.3), 10.0)))
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
    assert walked.outcomes.unreachable.sum() == 0
    assert walked.outcomes.saturation.max() < 0.02


def test_mujocos_clock_stops_only_while_insects_walk(settled):
    assert mujoco.get_mjcb_time() is None
    for _ in drive(settled, NetworkRun(settled.starts, LDVS, 0.3), 4.0):
        assert mujoco.get_mjcb_time() is not None
    assert mujoco.get_mjcb_time() is None
    mujoco.set_mjcb_time(ours := cfunc("float64()")(lambda: 1.0).ctypes)
    try:
        list(drive(settled, NetworkRun(settled.starts, LDVS, 0.3), 4.0))
        assert mujoco.get_mjcb_time() is ours
    finally:
        mujoco.set_mjcb_time(None)


@pytest.mark.parametrize("body", [Body(friction=0.0), Body(friction=0.0, vp=400.0)])
def test_a_push_gives_the_momentum_asked_for(body):
    """Without friction the ground holds nothing back: the whole insect moves aside by impulse over mass."""
    settled = settle(draw_starts(3, 0), body)
    speed = []
    for impulse in (0.0, 30.0):
        push = Push(np.array([impulse, -impulse, impulse]), np.array([2.0, 2.0, 1e9]))
        plan = NetworkRun(settled.starts, UNCOORDINATED, 0.0)
        centre = insect.sensors(settled.mujoco_model).centre_of_mass
        y = np.concatenate(
            [one.sensors[:, :, centre][:, :, 1] for one in drive(settled, plan, 0.1 * body.vp, push=push)], axis=1
        )
        speed.append((y[:, -1] - y[:, -40]) / 39 / settled.mujoco_model.opt.timestep)  # mm/s
    assert_allclose((speed[1] - speed[0])[:2] * insect.MASS, [30.0, -30.0], rtol=0.02)
    assert speed[1][2] == speed[0][2]


def test_a_push_lasts_as_long_whatever_the_physics_step():
    """So standing insects slide as far, by 30 mm; a quarter of the step changes that by 3 %, so by less than 5."""
    slid = []
    for longest in (0.625, 0.15625):
        settled = settle(draw_starts(3, 0), Body(longest_substep=longest))
        push = Push(np.full(3, 800.0), np.full(3, 2.0))
        y = [
            one.qpos[:, -1, 1] for one in drive(settled, NetworkRun(settled.starts, UNCOORDINATED, 0.0), 8.0, push=push)
        ]
        slid.append(y[-1])
    assert_allclose(slid[1], slid[0], rtol=0.05)


def test_every_bounce_counts_without_a_contact_gap():
    """Measured stability is stricter the shorter the gap; what the body does is the same."""
    gaps = [physical_outcomes(settle(draw_starts(20, 0), Body(contact_gap=ms)), LDVS, 0.5, 40.0) for ms in (0.0, 10.0)]
    assert np.array_equal(gaps[0].fall, gaps[1].fall)
    assert (gaps[0].measured_loss <= gaps[1].measured_loss).all()
    assert np.isfinite(gaps[0].measured_loss).sum() > np.isfinite(gaps[1].measured_loss).sum()


def test_nothing_is_measured_after_a_fall():
    walked = physical_walk(draw_starts(6, 0), UNCOORDINATED, 0.7, 60.0)
    fall = walked.outcomes.fall
    assert np.isfinite(fall).all()
    for start in range(6):
        over = walked.planned.time > fall[start] + 1e-9
        assert np.isnan(walked.measured.x[over, start]).all()
        assert not walked.measured.stance[over, start].any()
        assert np.isfinite(walked.measured.x[~over, start]).all()
        assert insect.TRUNK[walked.outcomes.fall_part[start]]
    assert (walked.outcomes.clearance < 0.01).all()


def test_speed_keeps_to_the_command():
    """0.95 to 1.05 of the commanded speed over the window `walk` where the start did not fall."""
    result = compare(LDVS, [0.3, 0.5], starts=40)
    speed = result.speed.where(np.isinf(result.fall)).values
    speed = speed[np.isfinite(speed)]
    assert len(speed) > 30
    assert ((speed > 0.95) & (speed < 1.05)).all()


def test_slow_walks_tend_to_the_static_criterion():
    """At V_p = 20 mm/s both FLSS differ by at most 0.06, and both answers agree for at least 0.88 of the starts."""
    result = compare(LDVS, [0.3, 0.5, 0.8], starts=100, body=Body(vp=20.0))
    assert (abs(result.kinematic - result.physical) <= 0.06).all()
    assert (result.agreement >= 0.88).all()


def test_mirrored_starts_give_mirrored_outcomes():
    starts = draw_starts(10, 2)
    one = physical_outcomes(settle(starts), LDVS, 0.4, 40.0)
    other = physical_outcomes(settle(starts[:, MIRROR]), LDVS, 0.4, 40.0)
    assert np.array_equal(one.planned_loss, other.planned_loss)
    assert np.array_equal(np.isfinite(one.fall), np.isfinite(other.fall))
    assert one.speed == pytest.approx(other.speed, abs=0.01)


def test_a_start_that_does_not_settle_is_an_error_not_a_fall():
    with pytest.raises(SimulationError, match="start 0 did not settle in 1 ms"):
        settle(draw_starts(2, 0), Body(settling_time=1.0))


def test_a_diverged_simulation_is_an_error_with_a_state_to_replay(settled, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    broken = settle(draw_starts(3, 0))
    broken.qvel[1] = 1e12
    with pytest.raises(
        SimulationError, match=r"start 1 diverged while walking at V = 0.3, at 0 time units: mjWARN_\w+"
    ) as error:
        list(drive(broken, NetworkRun(broken.starts, LDVS, 0.3), 10.0))
    path = tmp_path / "diverged-start-1.npz"
    assert str(path) in str(error.value)
    model, data = replay(path)
    assert data.qvel[0] == 1e12
    assert model.opt.timestep == broken.mujoco_model.opt.timestep
    data.ctrl[:] = np.load(path)["ctrl"][0]
    mujoco.mj_step(model, data)
    assert data.warning.number.any()


def test_a_state_to_replay_has_the_step_the_contacts_and_the_push_of_its_roll(settled, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    batch = Batch(settled.mujoco_model, 2, 1)
    batch.expand("opt.timestep")[1], batch.expand("pair_solref")[1, :, 0] = 1e-4, 2e-4
    batch.bind("xfrc_applied")[1, 1, 1] = 7.0
    batch.bind("qpos")[1] = np.nan
    state = {"qpos": settled.qpos, "qvel": settled.qvel, "qacc_warmstart": settled.warmstart}
    with pytest.raises(SimulationError, match=r"start 1 diverged while walking at V = 0.3, at 4 time units: .* finite"):
        raise_if_diverged(batch, np.arange(2), 4.0, np.full(2, 0.3), state)
    model, data = replay(tmp_path / "diverged-start-1.npz")
    assert model.opt.timestep == 1e-4
    assert (model.pair_solref[:, 0] == 2e-4).all()
    assert np.array_equal(data.qpos, settled.qpos[1])
    assert data.xfrc_applied[1, 1] == 7.0
    assert insect.body_of(model) == settled.body


def test_starts_out_of_reach_are_refused():
    with pytest.raises(InputError, match="start 0, leg 1: the tip at -30 mm is out of reach"):
        settle(np.full((1, 6), -30.0), network=Network(pep_min=-30.0))


def test_targets_out_of_reach_are_counted():
    low = Body(standing_height=7.0, step_height=14.0)
    outcomes = physical_outcomes(settle(draw_starts(4, 0), low), LDVS, 0.5, 40.0)
    assert outcomes.unreachable.sum() > 0


def test_comparison_holds_every_answer():
    result = compare({"a": LDVS, "b": UNCOORDINATED}, [0.3, 0.6], starts=20, window="start")
    assert result.sizes == {"model": 2, "velocity": 2, "start": 20, "leg": 6}
    total = result.both + result.only_kinematic + result.only_physical + result.none
    assert (total == 20).all()
    assert np.allclose(result.agreement, (result.both + result.none) / 20)
    assert np.allclose(result.physical, np.isfinite(result.fall).mean("start"))
    assert ((result.physical_low <= result.physical) & (result.physical <= result.physical_high)).all()


def test_halving_the_physics_step_hardly_changes_physical_flss():
    """Measured with 200 starts at V = 0.3, 0.5, 0.7: 0.155, 0.365, 0.690 became 0.160, 0.365, 0.695."""
    coarse, fine = (physical_flss(LDVS, [0.5], body=Body(longest_substep=ms)).flss.item() for ms in (0.625, 0.3125))
    assert abs(coarse - fine) <= 0.02
