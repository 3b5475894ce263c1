"""Recordings of the physical insect and of puppets, and the files that they make."""

import json

import mujoco
import numpy as np
import pytest
import xarray as xr

from hexmj.errors import InputError
from hexmj.film.take import Take
from hexmj.legs import FIG1
from hexmj.loss_frequency import draw_starts
from hexmj.network import walk
from hexmj.parameters import LDVS, UNCOORDINATED, Network
from hexmj.physics import insect
from hexmj.physics.body import Body
from hexmj.physics.kinematics import joints_to_tips
from hexmj.physics.physical_walks import PhysicalWalk, physical_walk
from hexmj.recording import load_recording, record, record_plan, save_recording


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    return physical_walk(draw_starts(3, seed=1), UNCOORDINATED, 0.5, 24.0)


@pytest.fixture(scope="module")
def fallen(walked: PhysicalWalk) -> int:
    fell = np.flatnonzero(np.isfinite(walked.outcomes.fall))
    assert fell.size, "this test needs a start that falls"
    return int(fell[0])


def test_a_recording_is_read_lazily(walked, tmp_path):
    """Opening reads no table; taking one of them reads that one only."""
    path = save_recording(record(walked, 0), tmp_path / "recording.nc")
    with load_recording(path) as recording:
        tables = [name for name, values in recording.variables.items() if values.ndim and name not in recording.indexes]
        assert "qpos" in tables
        assert not any(recording.variables[name]._in_memory for name in tables)
        assert np.isfinite(recording.qpos.values[0]).all()
        assert [name for name in tables if recording.variables[name]._in_memory] == ["qpos"]


def test_a_recording_comes_back_from_its_file(walked, fallen, tmp_path):
    for recording in (
        record(walked, fallen, "a fall"),
        record_plan(walked.planned, walked.body, walked.network),
    ):
        path = save_recording(recording, tmp_path / "recording.nc")
        with load_recording(path) as loaded:
            xr.testing.assert_identical(loaded, recording)
    assert [file.name for file in tmp_path.iterdir()] == ["recording.nc"]


def test_every_variable_says_what_it_is(walked):
    recording = record(walked, 0, "one")
    for name in {*recording.data_vars, "time", "seconds"}:
        assert set(recording[name].attrs) == {"units", "long_name"}, name
    attributes = json.loads(json.dumps(recording.attrs))
    assert attributes["title"] == "one"
    assert {"vp", "step_height", "friction", "dt", "order", "origins"} <= set(attributes)


def test_what_was_measured_is_recorded_until_the_fall(walked, fallen):
    recording, outcomes = record(walked, fallen), walked.outcomes
    assert recording.fall_time == outcomes.fall[fallen]
    assert recording.fall_part == outcomes.fall_part[fallen]
    lost = recording.measured_margin <= 0
    assert recording.time[int(np.argmax(lost.values))] == recording.measured_loss_time
    after = recording.time.values >= outcomes.fall[fallen] + walked.network.dt
    assert after.any()
    for name in ("measured_x", "measured_margin", "qpos", "centre_of_mass", "planned_tip"):
        values = recording[name].values.reshape(len(after), -1)
        assert np.isnan(values[after]).all(), name
        assert np.isfinite(values[~after][:-1]).all(), name
    assert np.isfinite(recording.planned_margin).all()


def test_a_film_shows_the_feet_where_the_insect_has_them(walked, fallen):
    """Positions seen from the body, turned back into the world, against MuJoCo's own."""
    take = Take.of(record(walked, fallen))
    model = insect.load()
    data = mujoco.MjData(model)
    for row in range(0, len(take.qpos), 10):
        data.qpos[:] = take.qpos[row]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        feet = [data.site(f"{leg}_foot").xpos[:2] for leg in ("L1", "L2", "L3", "R1", "R2", "R3")]
        np.testing.assert_allclose(take.feet[row], feet, atol=1e-9)
        np.testing.assert_allclose(take.centre_of_mass[row], data.subtree_com[1], atol=1e-9)


def test_a_puppet_puts_its_tips_where_they_are_planned():
    network, body = Network(), Body()
    plan = walk(draw_starts(2, seed=3), LDVS, 0.4, 40.0)
    recording = record_plan(plan, body, network, start=1)
    root = recording.qpos.values[:, : insect.ROOT_QPOS]
    legs = insect.dimensions(insect.load())
    tips = joints_to_tips(recording.qpos.values[:, insect.ROOT_QPOS :].reshape(-1, 6, 3), legs)
    np.testing.assert_allclose(root[:, None, :3] + tips, recording.planned_tip, atol=1e-9)
    np.testing.assert_allclose(tips[..., 0], plan.x[:, 1] + FIG1.origin, atol=1e-9)
    np.testing.assert_allclose(tips[..., 1], plan.y[:, 1], atol=1e-9)
    lift = recording.planned_tip.values[..., 2] - legs.foot
    assert lift.min() == pytest.approx(0.0, abs=1e-9)
    assert lift.max() == pytest.approx(body.step_height)
    np.testing.assert_allclose(np.diff(root[:, 0]), 0.4 * network.dt)
    assert (root[:, 2] == body.standing_height + legs.foot).all()
    stands = recording.planned_stance.values
    stays = stands[1:] & stands[:-1]
    assert np.abs(np.diff(recording.planned_tip.values[..., 0], axis=0)[stays]).max() < 1e-9
    assert "measured_x" not in recording


def test_a_leg_of_a_puppet_that_is_out_of_reach_keeps_its_angles():
    body = Body(standing_height=5.0, step_height=14.0)
    plan = walk(draw_starts(1, seed=3), LDVS, 0.4, 40.0)
    recording = record_plan(plan, body, Network())
    joints = recording.qpos.values[:, insect.ROOT_QPOS :].reshape(-1, 6, 3)
    tips = joints_to_tips(joints, insect.dimensions(insect.load())) + recording.qpos.values[:, None, :3]
    off = np.abs(tips - recording.planned_tip.values).max(axis=-1) > 1e-6
    assert off.any()
    assert not off.all()
    assert (np.diff(joints, axis=0)[off[1:]] == 0).all()
    far = Network(pep_min=-40.0)
    with pytest.raises(InputError, match="cannot reach its tip at time 0"):
        record_plan(walk(np.full((1, 6), -40.0), LDVS, 0.4, 1.0, network=far), Body(), far)


def test_files_that_are_no_recordings(walked, tmp_path):
    text, other, part = tmp_path / "text.nc", tmp_path / "other.nc", tmp_path / "part.nc"
    text.write_text("no numbers")
    xr.Dataset({"flss": ("velocity", [0.5])}).to_netcdf(other, engine="h5netcdf")
    record(walked).isel(leg=slice(3)).to_netcdf(short := tmp_path / "short.nc", engine="h5netcdf")
    record(walked).drop_vars("fall_time").drop_attrs(deep=False).to_netcdf(part, engine="h5netcdf")
    for path, said in {
        text: "cannot be read as NetCDF",
        tmp_path / "nothing.nc": "is no file; expected a recording",
        other: "missing: .*planned_x.*qpos.*attribute title",
        part: "missing: fall_time, attribute title",
        short: "no recording of this insect, with 6 legs",
    }.items():
        with pytest.raises(InputError, match=said) as error:
            load_recording(path)
        assert str(path) in str(error.value)


@pytest.mark.parametrize("start", [-1, 3])
def test_starts_that_do_not_exist(walked, start):
    with pytest.raises(InputError, match=f"start = {start}; expected 0 to 2"):
        record(walked, start)
    with pytest.raises(InputError, match=f"start = {start}; expected 0 to 2"):
        record_plan(walked.planned, walked.body, walked.network, start)
