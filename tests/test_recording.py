"""Recordings of the physical insect and of puppets, and the files that they make."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import xarray as xr
from hexmj.storage import netcdf
from hexmj.storage.files import sealed
from numpy.testing import assert_allclose

from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS, STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import PhysicalWalk, physical_walk, physical_walk_of_plan
from hexmj.physics.settling import settle
from hexmj.replay.recording import load_recording, record, record_plan, recorded_conditions, save_recording
from hexmj.replay.take import Take
from hexmj.rotations import rotated
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk, one_start, part_of


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    return physical_walk(draw_starts(3, seed=1), UNCOORDINATED, 0.5, 24.0)


@pytest.fixture(scope="module")
def fallen(walked: PhysicalWalk) -> int:
    fell = np.flatnonzero(np.isfinite(walked.outcomes.fall))
    assert fell.size, "this test needs a start that falls"
    return int(fell[0])


def test_a_recording_does_not_hang_on_its_file(walked, tmp_path):
    recording = record(walked, 0)
    path = save_recording(recording, tmp_path / "recording.nc")
    with load_recording(path) as loaded:
        path.write_bytes(b"")
        xr.testing.assert_identical(loaded, recording)


def test_a_recording_comes_back_from_its_file(walked, fallen, tmp_path):
    for recording in (
        record(walked, fallen, "a fall"),
        record_plan(walked.planned, walked.conditions, walked.stride),
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
    assert {"vp", "step_height", "friction", "dt", "origins"} <= set(attributes)


def test_what_was_measured_is_recorded_until_the_fall(walked, fallen):
    recording, outcomes = record(walked, fallen), walked.outcomes
    assert recording.fall_time == outcomes.fall[fallen]
    assert recording.fall_part == outcomes.fall_part[fallen]
    lost = recording.measured_margin <= 0
    assert recording.time[int(np.argmax(lost.values))] == recording.measured_loss_time
    after = recording.time.values >= outcomes.fall[fallen] + walked.stride.dt
    assert after.any()
    for name in ("measured_x", "measured_margin", "qpos", "centre_of_mass", "planned_tip"):
        values = recording[name].values.reshape(len(after), -1)
        assert np.isnan(values[after]).all(), name
        assert np.isfinite(values[~after][:-1]).all(), name
    assert np.isfinite(recording.planned_margin).all()


def test_a_film_shows_the_feet_where_the_insect_has_them(walked, fallen):
    """Positions seen from the body, turned back into the world, against MuJoCo's own."""
    take = Take.of(record(walked, fallen))
    model = compile_body(Conditions()).model
    data = mujoco.MjData(model)
    for row in range(0, len(take.qpos), 10):
        data.qpos[:] = take.qpos[row]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        feet = [data.site(foot).xpos[:2] for foot in STICK_INSECT.feet]
        assert_allclose(take.feet[row], feet, atol=1e-9)
        assert_allclose(take.centre_of_mass[row], data.subtree_com[1], atol=1e-9)


def tips_of(recording: xr.Dataset) -> np.ndarray:
    """Where the recorded joints put the tips in the root frame, (step, leg, axis) [mm]."""
    return compile_body(Conditions()).forward(recording.qpos.values[:, ROOT_QPOS:].reshape(-1, 6, 3))


def test_a_puppet_puts_its_tips_where_they_are_planned():
    stride, conditions = Stride(), Conditions()
    height, radius = conditions.standing_height, compile_body(conditions).foot_radius
    plan = walk(draw_starts(2, seed=3), LDVS, 0.4, 40.0)
    recording = record_plan(plan, conditions, stride, start=1)
    root, tips = recording.qpos.values[:, :ROOT_QPOS], tips_of(recording)
    assert_allclose(root[:, None, :3] + tips, recording.planned_tip, atol=1e-9)
    assert_allclose(tips[..., 0], plan.x[:, 1] + FIG1.origin, atol=1e-9)
    assert_allclose(tips[..., 1], plan.y[:, 1], atol=1e-9)
    lift = recording.planned_tip.values[..., 2] - radius
    assert lift.min() == pytest.approx(0.0, abs=1e-9)
    assert lift.max() == pytest.approx(conditions.step_height)
    assert_allclose(np.diff(root[:, 0]), 0.4 * stride.dt)
    assert (root[:, 2] == height + radius).all()
    stands = recording.planned_stance.values
    stays = stands[1:] & stands[:-1]
    assert np.abs(np.diff(recording.planned_tip.values[..., 0], axis=0)[stays]).max() < 1e-9
    assert "measured_x" not in recording


def swung_aside(plan: PlannedWalk) -> PlannedWalk:
    """The same walk with every tip beside its line, and swinging feet raised to heights of the plan's own."""
    out = np.sign(plan.y) * (1.0 + 0.1 * plan.x)
    return replace(plan, y=plan.y + out, height=np.where(plan.stance, 0.0, 3.0 + 0.2 * np.abs(plan.x)))


def test_tips_beside_their_lines_and_heights_of_their_own_are_recorded():
    """Of a puppet and of the insect alike: what the plan asks for, not what the body would make of it."""
    starts, stride, conditions = draw_starts(2, seed=3), Stride(), Conditions()
    plan = swung_aside(walk(starts, LDVS, 0.3, 30.0))
    recording = record_plan(plan, conditions, stride, start=1)
    tips, wanted = tips_of(recording), one_start(plan, 1)
    assert_allclose(tips[..., 0], wanted.feet[:, 0, :, 0], atol=1e-9)
    assert_allclose(tips[..., 1], wanted.y[:, 0], atol=1e-9)
    assert_allclose(tips[..., 2] + conditions.standing_height, wanted.height[:, 0], atol=1e-9)
    assert (np.abs(wanted.y[:, 0] - FIG1.y) > 0.5).mean() > 0.5
    settled = settle(starts, conditions, stride)
    walked = physical_walk_of_plan(settled, Given(settled.starts, stride, plan), plan)
    assert np.isinf(walked.outcomes.fall[1])
    physical = record(walked, 1)
    root = physical.qpos.values[:, :ROOT_QPOS]
    turned = root[:, None, :3] + rotated(root[:, None, 3:7], tips)
    assert_allclose(physical.planned_tip, turned, atol=1e-9)
    assert_allclose(physical.planned_y, wanted.y[:, 0])
    # The insect does it: its feet are nearer to where the plan has them than to their lines.
    feet, stands = tips_of(physical), physical.measured_stance.values & wanted.stance[:, 0]
    off_plan, off_line = np.abs(feet[..., 1] - wanted.y[:, 0])[stands], np.abs(feet[..., 1] - FIG1.y)[stands]
    assert off_plan.mean() < 0.5 * off_line.mean()


class Given:
    """A plan that is known from its begin to its end."""

    def __init__(self, starts: np.ndarray, stride: Stride, whole: PlannedWalk) -> None:
        self.starts, self.stride, self.done, self._whole = starts, stride, 0, whole

    def advance(self, steps: int) -> PlannedWalk:
        self.done += steps
        return part_of(self._whole, slice(self.done - steps, self.done))


def test_a_leg_of_a_puppet_that_is_out_of_reach_keeps_its_angles():
    conditions = Conditions(standing_height=5.0, step_height=14.0)
    recording = record_plan(walk(draw_starts(1, seed=3), LDVS, 0.4, 40.0), conditions, Stride())
    joints = recording.qpos.values[:, ROOT_QPOS:].reshape(-1, 6, 3)
    tips = tips_of(recording) + recording.qpos.values[:, None, :3]
    off = np.abs(tips - recording.planned_tip.values).max(axis=-1) > 1e-6
    assert off.any()
    assert not off.all()
    assert (np.diff(joints, axis=0)[off[1:]] == 0).all()
    far = Stride(pep_min=-40.0)
    with pytest.raises(InputError, match="cannot reach its tip at time 0"):
        record_plan(walk(np.full((1, 6), -40.0), LDVS, 0.4, 1.0, stride=far), Conditions(), far)


@pytest.mark.slow
def test_files_that_are_no_recordings(walked, tmp_path):
    recording = record(walked)
    damaged = "is damaged, or was not written by hexmj.save_recording"
    made = {
        "text.nc": (b"no numbers", damaged),
        "plain.nc": (netcdf.encode(recording), damaged),
        "other.nc": (sealed(netcdf.encode(xr.Dataset({"flss": ("v", [0.5])}))), "missing: time.*planned_x.*qpos"),
        "part.nc": (sealed(netcdf.encode(recording.drop_vars("fall_time"))), "missing: fall_time"),
        "bare.nc": (sealed(netcdf.encode(recording.drop_attrs(deep=False))), "missing: attribute title"),
        "short.nc": (sealed(netcdf.encode(recording.isel(leg=slice(3)))), "leg = .*'L3'.; expected .'L1'.*'R3'"),
    }
    for name, (content, said) in made.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=said) as error:
            load_recording(tmp_path / name)
        assert str(tmp_path / name) in str(error.value)
    with pytest.raises(InputError, match=r"nothing\.nc cannot be read: No such file"):
        load_recording(tmp_path / "nothing.nc")


def test_a_recording_of_another_body_is_not_taken_for_ours(walked):
    other = replace(STICK_INSECT, name="another")
    recording = record(walked)
    assert recorded_conditions(recording) == walked.conditions
    with pytest.raises(InputError, match="is of the body 'stick_insect', not of 'another'"):
        recorded_conditions(recording, other)
    with pytest.raises(InputError, match="has 24 positions; expected 25"):
        recorded_conditions(recording.isel(position=slice(24)))


@pytest.mark.parametrize("start", [-1, 3])
def test_starts_that_do_not_exist(walked, start):
    with pytest.raises(InputError, match=f"start = {start}; expected 0 to 2"):
        record(walked, start)
    with pytest.raises(InputError, match=f"start = {start}; expected 0 to 2"):
        record_plan(walked.planned, walked.conditions, walked.stride, start)
