"""The commands compare, flss, walk and render: their files, and the same bits whatever the threads."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import hexmj
from drawing import drawing
from film_reader import read_film
from hexmj.cli.compare import SUMMARY
from hexmj.controllers.cruse1998 import network_toml

PNG = b"\x89PNG"


@pytest.mark.thorough
def test_compare_writes_the_same_bits_with_one_and_two_threads(run, tmp_path):
    words = ["compare", "--velocities", 0.4, 0.6, "--starts", 12, "--observation time", "start", "--json", "--no-video"]
    answers, datasets = [], []
    for threads in (1, 2):
        out = tmp_path / str(threads)
        code, text, _ = run(*words, "--threads", threads, "--out", out)
        assert code == 0
        answers.append({key: value for key, value in json.loads(text).items() if key != "files"})
        datasets.append(xr.load_dataset(out / "comparison.nc"))
        assert (out / "comparison.png").read_bytes().startswith(PNG)
    assert answers[0] == answers[1]
    assert datasets[0].identical(datasets[1])
    assert answers[0]["velocity"] == [0.4, 0.6]
    for model in ("ldvs", "uncoordinated"):
        assert {"kinematic", "measured", "physical", "agreement"} <= set(answers[0][model])
    data = datasets[0]
    assert data.fall.attrs["units"] == "time unit"
    assert data.sizes == {"controller": 2, "velocity": 2, "start": 12, "leg": 6}
    manifest = json.loads((tmp_path / "1" / "manifest.json").read_text())
    assert manifest["settings"]["seed"] == 0
    assert manifest["settings"]["conditions"]["vp"] == 80.0
    assert {"mujoco", "numpy", "hexmj"} <= set(manifest["versions"])


@pytest.mark.slow
@drawing
def test_compare_makes_a_video_of_a_gait_and_its_tables_break_no_name(run, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run(
        *("compare", "--models", "ldvs", "uncoordinated", "--velocities", 0.5, "--starts", 4, "--observation time", 30),
        *("--out", tmp_path),
    )
    assert code == 0
    assert len(re.findall(r"^ ?uncoordinated  0\.5 ", out, re.MULTILINE)) == 2
    video, fps = read_film(tmp_path / "gait.mp4")
    assert fps == 30
    assert len(video) == round(30 / 80 * 30 * 2)


@pytest.mark.slow
def test_without_rendering_compare_still_delivers(tmp_path):
    """MuJoCo is told to use a screen that is not there: numbers and figure come, and a sentence on what is missing."""
    words = [
        "compare",
        "--models",
        "ldvs",
        "--velocities",
        "0.5",
        "--starts",
        "4",
        "--observation time",
        "20",
        "--out",
        str(tmp_path),
    ]
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"} | {"MUJOCO_GL": "glfw"}
    done = subprocess.run([sys.executable, "-m", "hexmj", *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0
    assert "libegl1" in done.stderr
    assert (tmp_path / "comparison.png").exists()
    assert not (tmp_path / "gait.mp4").exists()


@pytest.mark.parametrize("name", SUMMARY)
def test_controllers_that_are_called_as_what_stands_beside_them_are_refused(run, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{name}.toml").write_text(network_toml(hexmj.LDVS))
    code, _, error = run("compare", "--models", "hws", f"{name}.toml", "--starts", 2)
    assert (code, error) == (2, f"hexmj: a controller has the name {name!r}, which the results need; rename it\n")


@pytest.mark.slow
def test_physical_flss(run, tmp_path):
    words = ["flss", "--physical", "--vp", 200, "--velocities", 0.5, "--starts", 10, "--observation time", "start"]
    code, text, _ = run(*words, "--json", "--out", tmp_path)
    answer = json.loads(text)
    assert code == 0
    conditions = hexmj.Conditions(vp=200.0)
    expected = hexmj.physical_flss(hexmj.LDVS, [0.5], n_starts=10, observation_time="start", conditions=conditions)
    assert answer["flss"] == expected.flss.values.tolist()
    assert answer["settings"]["conditions"]["vp"] == 200.0
    assert xr.load_dataset(tmp_path / "flss.nc").flss.values.tolist() == answer["flss"]
    code, text, _ = run(*words)
    assert "vp 200" in text
    assert "step_height 12" in text


def test_accelerated_flss(run):
    code, text, _ = run(
        "flss", "--velocities", 0.3, "--starts", 50, "--acceleration", 0.001, "--observation time", "start", "--json"
    )
    assert code == 0
    assert json.loads(text)["duration"] == [pytest.approx(240.0)]


@pytest.mark.parametrize("physical", [False, True])
def test_walk(run, tmp_path, physical):
    words = ["walk", "--velocity", 0.5, "--observation time", 40, "--start", 3, "--json", "--out", tmp_path]
    code, text, _ = run(*words, *(["--physical"] if physical else []))
    assert code == 0
    answer = json.loads(text)
    lost = hexmj.first_loss(hexmj.draw_starts(4, 0)[3:], hexmj.LDVS, 0.5, 40.0)[0]
    assert answer["planned loss"] == (lost if np.isfinite(lost) else None)
    assert ("fall" in answer) == physical
    assert (tmp_path / "walk.png").read_bytes().startswith(PNG)
    assert hexmj.load_recording(tmp_path / "recording.nc").sizes["step"] == 400


def test_the_puppet_of_a_plan_obeys_the_path_of_its_feet(run, tmp_path):
    words = ["walk", "--velocity", 0.5, "--observation time", 16, "--step-height", 6, "--vp", 40, "--out", tmp_path]
    assert run(*words)[0] == 0
    recording = xr.load_dataset(tmp_path / "recording.nc")
    lift = np.ptp(recording.planned_tip.sel(coordinate="z").values)
    assert lift == pytest.approx(6.0, abs=0.5)
    assert recording.seconds.values[-1] == pytest.approx(16 / 40)


@pytest.mark.slow
@drawing
def test_render_from_a_recording_and_side_by_side(run, tmp_path):
    walk = ["--velocity", 0.5, "--observation time", 16]
    run("walk", *walk, "--physical", "--out", tmp_path / "walk")
    for name, words, width in (
        ("ldvs-V-0.5", [tmp_path / "walk" / "recording.nc"], 320),
        ("ldvs-V-0.5-beside-planned", [*walk, "--beside", "planned"], 640),
        ("ldvs-V-0.5-beside-uncoordinated", [*walk, "--beside", "uncoordinated"], 640),
    ):
        film = ["--width", 320, "--height", 240, "--fps", 20, "--slow-motion", 4]
        code, text, _ = run("render", *words, *film, "--json", "--out", tmp_path / "films")
        assert code == 0
        video, fps = read_film(tmp_path / "films" / f"{name}.mp4")
        assert fps == 20
        assert json.loads(text)["frames"] == len(video) == round(16 / 80 * 4 * 20)
        assert video.shape[1:] == (240, width, 3)
    assert len([*(tmp_path / "films").glob("*.mp4")]) == len([*(tmp_path / "films").glob("*-manifest.json")]) == 3
    code, _, error = run("render", tmp_path / "walk" / "recording.nc", *film, "--out", tmp_path / "films")
    assert code == 0
    assert "ldvs-V-0.5.mp4 was there; the new one takes its place" in error
    code, _, error = run("render", *walk, "--beside", "planned", *film, "--format", "gif", "--out", tmp_path / "films")
    assert code == 0
    told = [f"ldvs-V-0.5-beside-planned-{i}.nc was there; the new one takes its place" in error for i in (1, 2)]
    assert told == [True, True]


@drawing
def test_what_takes_the_place_of_another_is_told_before_it_does(run, tmp_path, monkeypatch):
    words = ["render", "--velocity", 0.5, "--observation time", 3, "--beside", "planned", "--width", 160, "--height", 120]
    assert run(*words, "--out", tmp_path)[0] == 0

    def full(*_):
        raise hexmj.InputError("the disk is full")

    monkeypatch.setattr("hexmj.replay.recording.save_recording", full)
    code, _, error = run(*words, "--out", tmp_path)
    assert code == 2
    assert error.count("the new one takes its place") == 3


DRIFTS = """
from dataclasses import dataclass
import hexmj

BEGUN = []

@dataclass(frozen=True)
class Drifts:
    name: str = "drifts"

    def begin(self, starts, velocity, *how):
        BEGUN.append(1)
        return hexmj.LDVS.begin(starts, velocity * (1.0 if len(BEGUN) < 3 else 0.5), *how)
"""


@drawing
def test_the_plan_that_is_filmed_beside_an_insect_is_its_own(run, tmp_path):
    """Of a controller that plans otherwise when it begins for the third time."""
    (tmp_path / "drifts.py").write_text(DRIFTS)
    words = ["--velocity", 0.5, "--observation time", 3, "--beside", "planned", "--width", 160, "--height", 120]
    code, _, error = run("render", "--model", f"{tmp_path / 'drifts.py'}:Drifts", *words, "--out", tmp_path / "films")
    assert code == 0, error
    planned, walked = (xr.load_dataset(path) for path in sorted((tmp_path / "films").glob("*.nc")))
    assert planned.attrs["title"] == walked.attrs["title"] + ", planned"
    np.testing.assert_array_equal(planned.planned_x, walked.planned_x)


def test_the_last_line_of_a_puppet_tells_what_it_obeys(run, tmp_path):
    code, text, _ = run("walk", "--step-height", 5, "--observation time", 3, "--out", tmp_path)
    assert code == 0
    assert "step_height 5.0" in text
    assert "friction" not in text
