"""Recordings of the physical insect and of puppets, and their files."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS, STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.errors import InputError
from hexmj.legs import FIG1
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import PhysicalWalk, physical_walk, physical_walk_of_plan
from hexmj.physics.settle import settle
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


def test_a_recording_is_identical_after_saving_and_loading(walked, fallen, tmp_path):
    for recording in (
        record(walked, fallen, "a fall"),
        record_plan(walked.planned, walked.conditions, walked.stride),
    ):
        path = save_recording(recording, tmp_path / "recording.nc")
        loaded = load_recording(path)
        path.write_bytes(b"")  # a recording does not depend on its file
        xr.testing.assert_identical(loaded, recording)
    assert [file.name for file in tmp_path.iterdir()] == ["recording.nc"]


def test_every_variable_has_a_unit_and_a_meaning(walked):
    recording = record(walked, 0, "a title")
    for name in {*recording.data_vars, "time", "seconds"}:
        assert set(recording[name].attrs) == {"units", "long_name"}, name
    assert recording.attrs["title"] == "a title"
    assert recorded_conditions(recording) == walked.conditions


def test_measures_are_recorded_until_the_fall(walked, fallen):
    recording, outcomes = record(walked, fallen), walked.outcomes
    assert recording.fall_time == outcomes.fall[fallen]
    assert recording.fall_part == outcomes.fall_part[fallen]
    lost = recording.grounded_margin <= 0
    assert recording.time[int(np.argmax(lost.values))] == recording.grounded_loss_time
    after = recording.time.values >= outcomes.fall[fallen] + walked.stride.dt
    assert after.any()
    for name in ("measured_x", "grounded_margin", "qpos", "centre_of_mass", "planned_tip"):
        values = recording[name].values.reshape(len(after), -1)
        assert np.isnan(values[after]).all(), name
        assert np.isfinite(values[~after][:-1]).all(), name
    assert np.isfinite(recording.planned_margin).all()


def test_feet_of_a_take_are_where_mujoco_has_them(walked, fallen):
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
    """Tips of the recorded joint angles in the root frame, (step, leg, axis) [mm]."""
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


class Given:
    """A plan of known steps."""

    def __init__(self, starts: np.ndarray, stride: Stride, steps: PlannedWalk) -> None:
        self.starts, self.stride, self.done, self._steps = starts, stride, 0, steps

    def advance(self, steps: int) -> PlannedWalk:
        self.done += steps
        return part_of(self._steps, slice(self.done - steps, self.done))


def test_tips_beside_their_axes_and_heights_of_the_plan_are_recorded():
    """The puppet and the insect follow what the plan asks for."""
    starts, stride, conditions = draw_starts(2, seed=3), Stride(), Conditions()
    plan = walk(starts, LDVS, 0.3, 30.0)
    out = np.sign(plan.y) * (1.0 + 0.1 * plan.x)
    plan = replace(plan, y=plan.y + out, height=np.where(plan.stance, 0.0, 3.0 + 0.2 * np.abs(plan.x)))
    recording = record_plan(plan, conditions, stride, start=1)
    tips, wanted = tips_of(recording), one_start(plan, 1)
    assert_allclose(tips[..., 0], wanted.feet[:, 0, :, 0], atol=1e-9)
    assert_allclose(tips[..., 1], wanted.y[:, 0], atol=1e-9)
    assert_allclose(tips[..., 2] + conditions.standing_height, wanted.height[:, 0], atol=1e-9)
    settled = settle(starts, conditions, stride)
    walked = physical_walk_of_plan(settled, Given(settled.starts, stride, plan), plan)
    assert np.isinf(walked.outcomes.fall[1])
    physical = record(walked, 1)
    root = physical.qpos.values[:, :ROOT_QPOS]
    turned = root[:, None, :3] + rotated(root[:, None, 3:7], tips)
    assert_allclose(physical.planned_tip, turned, atol=1e-9)
    assert_allclose(physical.planned_y, wanted.y[:, 0])
    feet, stands = tips_of(physical), physical.measured_stance.values & wanted.stance[:, 0]
    off_plan, off_axis = np.abs(feet[..., 1] - wanted.y[:, 0])[stands], np.abs(feet[..., 1] - FIG1.y)[stands]
    assert off_plan.mean() < 0.5 * off_axis.mean()


def test_a_leg_of_a_puppet_that_is_out_of_reach_keeps_its_angles():
    conditions = Conditions(standing_height=5.0, step_height=14.0)
    recording = record_plan(walk(draw_starts(1, seed=3), LDVS, 0.4, 40.0), conditions, Stride())
    joints = recording.qpos.values[:, ROOT_QPOS:].reshape(-1, 6, 3)
    tips = tips_of(recording) + recording.qpos.values[:, None, :3]
    off = np.abs(tips - recording.planned_tip.values).max(axis=-1) > 1e-6
    assert off.any()
    assert not off.all()
    assert (np.diff(joints, axis=0)[off[1:]] == 0).all()


def test_bad_files_are_refused(walked, tmp_path):
    recording, path = record(walked), tmp_path / "bad.nc"
    xr.Dataset({"flss": ("v", [0.5])}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(InputError, match="time"):
        load_recording(path)
    for bad, name in (
        (recording.drop_vars("fall_time"), "fall_time"),
        (recording.drop_attrs(deep=False), "title"),
        (recording.drop_vars("seconds"), "seconds"),
    ):
        with pytest.raises(InputError, match=name):
            save_recording(bad, path)
    path.write_bytes(b"no numbers")
    for absent in (path, tmp_path / "absent.nc"):
        with pytest.raises(InputError, match=absent.name):
            load_recording(absent)


def test_bad_arguments_are_refused(walked):
    conditions, stride, plan = walked.conditions, walked.stride, walked.planned
    for start in (-1, 3):
        with pytest.raises(InputError, match="start"):
            record(walked, start)
    far = Stride(pep_min=-40.0)
    beyond = walk(np.full((1, 6), -40.0), LDVS, 0.4, 1.0, stride=far)
    for bad, its_stride in ((part_of(plan, slice(5, 9)), stride), (part_of(plan, slice(0)), stride), (beyond, far)):
        with pytest.raises(InputError, match="plan"):
            record_plan(bad, conditions, its_stride)
    recording = record(walked)
    for bad, body in (
        (recording, replace(STICK_INSECT, name="another")),
        (recording.isel(position=slice(24)), STICK_INSECT),
    ):
        with pytest.raises(InputError, match="body"):
            recorded_conditions(bad, body)
