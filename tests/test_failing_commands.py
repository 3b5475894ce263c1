"""What fails on a command's way is one sentence: compiled code, memory, a simulation."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hexmj.user_code.loaded import importable

from hexmj.errors import SimulationError


def test_compiled_code_that_is_torn_is_a_sentence(run, monkeypatch, tmp_path):
    """As the module of numba raises it that keeps and finds code."""
    (tmp_path / "caching.py").write_text("def load(*_, **__): raise EOFError('Ran out of input')")
    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", importable(tmp_path / "caching.py").load)
    code, text, error = run("flss", "--starts", 5, "--observation time", 10)
    assert (code, text) == (2, "")
    assert "hexmj: numba cannot find or keep compiled code; delete its files" in error
    assert "(EOFError: Ran out of input)" in error


def test_a_library_that_cannot_be_loaded_is_not_blamed_on_the_output(run, monkeypatch):
    def fail(*_, **__):
        raise OSError("Could not find/load shared object file")

    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", fail)
    code, _, error = run("flss", "--starts", 5, "--observation time", 10)
    assert (code, error) == (2, "hexmj: the system: Could not find/load shared object file\n")


def test_a_folder_that_goes_meanwhile_is_not_blamed_on_the_output(run, monkeypatch, tmp_path):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")

    def fail(*_, **__):
        (tmp_path / "gone").rmdir()
        os.getcwd()

    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", fail)
    code, _, error = run("flss", "--starts", 5, "--observation time", 10)
    assert (code, error) == (2, "hexmj: the current folder is no longer there; expected one that is\n")


@pytest.mark.parametrize(
    ("failed", "why"),
    [
        (MemoryError("Unable to allocate 9 TiB"), "Unable to allocate 9 TiB"),
        (MemoryError(), "nothing is left"),
        (mujoco.FatalError("Could not allocate memory"), "Could not allocate memory"),
    ],
)
def test_memory_that_runs_out_is_a_sentence(run, monkeypatch, failed, why):
    def run_out(*_, **__):
        raise failed

    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", run_out)
    code, text, error = run("flss", "--starts", 5, "--observation time", 10)
    assert (code, text) == (2, "")
    assert f"hexmj: the memory does not suffice ({why}); expected more of it, or fewer starts" in error


def test_a_simulation_that_fails_ends_with_code_1(run, tmp_path):
    code, _, error = run("walk", "--physical", "--settling-time", 1, "--out", tmp_path)
    assert code == 1
    assert "did not settle" in error
    assert not Path(tmp_path / "recording.nc").exists()


@pytest.mark.parametrize("out", [True, False])
def test_the_state_of_a_simulation_that_diverged_is_kept_with_the_results(run, tmp_path, monkeypatch, out):
    def diverge(*_: object, **how: object) -> None:
        raise SimulationError("start 3 diverged", {"qpos": np.arange(3.0)}, "diverged-start-3.npz")

    monkeypatch.setattr("hexmj.measures.compare.physical_flss", diverge)
    monkeypatch.chdir(tmp_path)
    code, _, error = run("flss", "--physical", *(["--out", tmp_path / "results"] if out else []))
    assert code == 1
    path = tmp_path / "results" / "diverged-start-3.npz"
    if out:
        assert (
            f"start 3 diverged; its last good state is in {path}; python -m hexmj.physics.divergence {path} replays it"
            in error
        )
        assert np.load(path)["qpos"].tolist() == [0.0, 1.0, 2.0]
        assert list(tmp_path.iterdir()) == [path.parent]
    else:
        assert "start 3 diverged; give --out to keep its last good state there" in error
        assert not list(tmp_path.iterdir())


def test_an_answer_that_can_go_nowhere_is_a_sentence(run, monkeypatch):
    monkeypatch.setattr("sys.stdout", None)
    code, _, error = run("flss", "--starts", 5, "--observation time", 10, "--json")
    assert (code, error) == (2, "hexmj: standard output is closed; expected it open, for the answer\n")


@pytest.mark.slow
def test_nothing_but_the_answer_is_on_standard_output_where_the_other_one_is_closed(run, tmp_path):
    words = ["flss", "--starts", 5, "--observation time", 10, "--out", tmp_path / "out", "--velocities"]
    assert "this has taken its place" not in run(*words, 0.3)[2]
    assert "this has taken its place" in run(*words, 0.5)[2]
    command = [sys.executable, "-m", "hexmj", *map(str, words), "0.7"]
    told = subprocess.run(["sh", "-c", f"{shlex.join(command)} 2>&-"], stdout=subprocess.PIPE, text=True, check=True)
    assert told.stdout.startswith("kinematic FLSS of ldvs, 5 starts") and "hexmj:" not in told.stdout


@pytest.mark.parametrize(
    ("words", "expected"), [(["flss", "--help"], 0), (["walk", "--velo", "2"], 2), (["--help"], 0)]
)
def test_help_that_can_go_nowhere_is_no_traceback(run, monkeypatch, words, expected):
    monkeypatch.setattr("sys.stdout", None)
    code, _, error = run(*words)
    assert code == expected and "Traceback" not in error
