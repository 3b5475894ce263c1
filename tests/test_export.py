"""Joint angles, torques and ground forces of recordings, and their tables."""

import mujoco
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import hexmj
from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS

BODY = compile_body(hexmj.Conditions())
WEIGHT = 1e-3 * BODY.weight  # mN


@pytest.fixture(scope="module")
def walked() -> hexmj.PhysicalWalk:
    return hexmj.physical_walk(hexmj.draw_starts(3, 1), hexmj.UNCOORDINATED, 0.5, 24.0, forces=True)


@pytest.fixture(scope="module")
def recording(walked) -> hexmj.Recording:
    return hexmj.record(walked, int(np.argmin(walked.outcomes.fall)))


@pytest.mark.parametrize("conditions", [hexmj.Conditions(), hexmj.Conditions(grasp=0.5, load=1.0)])
def test_forces_carry_the_weight(conditions):
    weight = (1.0 + conditions.load) * WEIGHT
    for velocity, duration, sideways, tolerance in ((0.0, 10.0, 0.01, 1e-3), (0.3, 200.0, 0.02, 0.01)):
        how = {"conditions": conditions, "forces": True}
        walked = hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, velocity, duration, **how)
        force = hexmj.record(walked).ground_force.sum("leg").mean("step")
        assert force.sel(coordinate="z") == pytest.approx(weight, rel=tolerance)
        assert np.abs(force[:2]).max() < sideways * weight


def test_a_walk_without_forces_has_the_same_bits(walked, recording):
    plain = hexmj.physical_walk(hexmj.draw_starts(3, 1), hexmj.UNCOORDINATED, 0.5, 24.0)
    assert plain.torque is plain.ground_force is None
    for name in ("qpos", "load", "height", "centre_of_mass"):
        assert_array_equal(getattr(plain, name), getattr(walked, name))
    lacking = hexmj.record(plain, int(np.argmin(plain.outcomes.fall)))
    assert {*recording.variables} - {*lacking.variables} == {"joint_torque", "ground_force"}


def test_joints_and_tips_are_those_of_mujoco(recording):
    fallen = np.isnan(recording.qpos[:, 0])
    assert_array_equal(recording.joint_angle, recording.qpos[:, ROOT_QPOS:])
    assert tuple(recording.joint.values) == hexmj.STICK_INSECT.joints
    model, data = BODY.model, mujoco.MjData(BODY.model)
    for row in np.flatnonzero(~fallen)[::20]:
        data.qpos[:] = recording.qpos[row]
        mujoco.mj_kinematics(model, data)
        assert_allclose(recording.tip[row], [data.site(foot).xpos for foot in hexmj.STICK_INSECT.feet], atol=1e-9)
    force, contact = recording.ground_force.values, recording.measured_stance.values
    assert fallen.any() and contact.any()
    assert_array_equal(force[~contact & ~fallen.values[:, None]], 0.0)
    assert np.isnan(force[fallen]).all()
    assert np.abs(recording.joint_torque).max() <= 1e-3 * BODY.torque_limits.max()


def test_a_table_has_a_row_for_each_step(recording, run, tmp_path):
    frame = recording.to_dataframe()
    assert len(frame) == recording.sizes["step"]
    for column, values in {
        "time [s]": recording.seconds,
        "time [time units]": recording.time,
        "root x [mm]": recording.qpos[:, 0],
        "root qz": recording.qpos[:, 6],
        "L1_thorax_coxa [rad]": recording.qpos[:, ROOT_QPOS],
        "R3_femur_tibia torque [mN mm]": recording.joint_torque[:, -1],
        "L2 contact": recording.measured_stance[:, 1],
        "R1 planned x [mm]": recording.planned_tip[:, 3, 0],
        "R1 tip y [mm]": recording.tip[:, 3, 1],
        "R3 force z [mN]": recording.ground_force[:, 5, 2],
        "planned margin [mm]": recording.planned_margin,
    }.items():
        assert_array_equal(frame[column], values)
    few = recording.isel(step=slice(5, 9)).sel(leg="L1").to_dataframe()
    assert_array_equal(few["L1 force z [mN]"], frame["L1 force z [mN]"][5:9])
    assert "L2 force z [mN]" not in few
    path = hexmj.save_recording(recording, tmp_path / "walk.nc")
    code, out, _ = run("export", path, "--out", tmp_path)
    assert code == 0 and "123 columns" in out
    read = pd.read_csv(tmp_path / "walk.csv")
    pd.testing.assert_frame_equal(read, frame, check_dtype=False, check_exact=True)


def test_recordings_with_the_same_name_get_numbers(recording, run, tmp_path):
    path = hexmj.save_recording(recording, tmp_path / "walk.nc")
    assert run("export", path, path, "--out", tmp_path)[0] == 0
    assert sorted(file.name for file in tmp_path.glob("*.csv")) == ["recording-1.csv", "recording-2.csv"]


def test_bad_exports_are_refused(recording, run, tmp_path):
    hexmj.save_recording(recording, tmp_path / "walk.nc")
    for words in ((), (tmp_path / "absent.nc",)):
        assert run("export", *words, "--out", tmp_path)[0] == 2, words
    with pytest.raises(hexmj.InputError, match="step"):
        recording.isel(step=5).to_dataframe()
    assert [file.name for file in tmp_path.iterdir()] == ["walk.nc"]
