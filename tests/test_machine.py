"""The commands doctor and rerun."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hexmj.cli import machine
from hexmj.files import read_netcdf, write_netcdf

FLSS = ["flss", "--velocity", 0.5, "--starts", 20, "--observation-time", "start"]

MINE = """
import dataclasses
import hexmj

MINE = dataclasses.replace(hexmj.LDVS, weights=hexmj.Symmetric(p1_i=12.0), name="mine")
"""


@pytest.mark.slow
def test_this_machine_passes_all_checks(run):
    code, text, _ = run("doctor", "--json")
    answer = json.loads(text)
    assert code == 0 and answer["well"], text
    assert [check["name"] for check in answer["checks"]] == [check.__name__ for check in machine.CHECKS]
    lines = run("doctor")[1].splitlines()
    assert len(lines) == len(machine.CHECKS) and all(line.startswith("ok ") for line in lines)


def fail() -> str:
    raise OSError("first line\nthe disk is full")


def test_a_failed_check_shows_the_last_line_of_its_error_and_the_others_follow(run, monkeypatch):
    monkeypatch.setattr(machine, "CHECKS", (fail, machine.versions))
    code, text, _ = run("doctor", "--json")
    answer = json.loads(text)
    wrong, other = answer["checks"]
    assert code == 1 and not answer["well"] and other["well"] and not wrong["well"]
    assert wrong["name"] == "fail" and wrong["found"] == "the disk is full"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings", "remedy"),
    [
        ("walking", {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator"}, "NUMBA_CACHE_DIR"),
        ("films", {"MUJOCO_GL": "nonsense"}, "Set MUJOCO_GL"),
        ("films", {"IMAGEIO_FFMPEG_EXE": "/nowhere"}, "IMAGEIO_FFMPEG_EXE"),
    ],
)
def test_the_remedy_fits_the_cause(tmp_path, name, settings, remedy):
    (file := tmp_path / "file").touch()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(file), "PYTHONPATH": str(Path(machine.__file__).parents[2])}
    command = [sys.executable, "-m", "hexmj", "doctor", "--json"]
    done = subprocess.run(command, env=environment | settings, capture_output=True, text=True)
    (wrong,) = (check for check in json.loads(done.stdout)["checks"] if check["name"] == name)
    assert done.returncode == 1 and not wrong["well"] and remedy in wrong["found"], wrong


@pytest.mark.parametrize("words", [FLSS, ["walk", "--velocity", 0.5, "--observation-time", 5, "--physical"]])
def test_a_repeated_command_is_equal_to_the_last_bit(run, tmp_path, words):
    assert run(*words, "--out", tmp_path / "out")[0] == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()}
    code, text, _ = run("rerun", tmp_path / "out", "--json")
    answer = json.loads(text)
    assert code == 0 and answer["equal"] and answer["versions"] == {} and answer["command"][0] == words[0]
    assert before == {path: path.read_bytes() for path in before}


def test_a_changed_number_and_another_version_are_named(run, tmp_path):
    assert run(*FLSS, "--out", tmp_path)[0] == 0
    data = read_netcdf(tmp_path / "flss.nc")
    data.flss[:] = np.nextafter(data.flss, 1.0)
    write_netcdf(data, tmp_path / "flss.nc")
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    manifest["versions"]["mujoco"] = "3.0.0"
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    code, text, _ = run("rerun", tmp_path, "--json")
    answer = json.loads(text)
    assert code == 1 and not answer["equal"]
    assert "flss" in answer["differences"]["flss.nc"] and answer["versions"]["mujoco"][0] == "3.0.0"
    code, text, _ = run("rerun", tmp_path)
    assert code == 1 and "flss.nc" in text and "3.0.0" in text


@pytest.mark.slow
def test_an_edited_controller_gives_another_result(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("edited.py").write_text(MINE)
    assert run(*FLSS, "--controller", "edited.py:MINE", "--out", "out")[0] == 0
    Path("edited.py").write_text(MINE.replace("12.0", "1.0"))
    environment = os.environ | {"PYTHONPATH": str(Path(machine.__file__).parents[2])}
    done = subprocess.run([sys.executable, "-m", "hexmj", "rerun", "out"], env=environment, capture_output=True)
    assert done.returncode == 1 and b"flss.nc" in done.stdout


@pytest.mark.parametrize("name", ["nowhere", "empty", "page"])
def test_a_folder_without_numbers_to_compare_is_refused(run, tmp_path, name):
    (tmp_path / "empty").mkdir()
    (tmp_path / "page").mkdir()
    content = {"command": ["--version"], "settings": {}, "versions": {}, "files": []}
    (tmp_path / "page" / "manifest.json").write_text(json.dumps(content))
    assert run("rerun", tmp_path / name)[0] == 2
