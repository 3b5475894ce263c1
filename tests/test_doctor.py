"""Every check of `hexmj doctor` passes here and, where its failure is simulated, reports it and names a remedy."""

import json
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from drawing import drawing
from hexmj import threads
from hexmj.cli import machine_checks
from hexmj.cli.machine_checks import CHECKS, Unfit, examine
from hexmj.controllers.cruse1998 import kernel
from hexmj.errors import SimulationError
from hexmj.measures import physical
from hexmj.rendering import gl


def only(monkeypatch, name: str) -> None:
    monkeypatch.setattr(machine_checks, "CHECKS", {name: CHECKS[name]})


@drawing
def test_this_machine_is_fit(run):
    code, out, _ = run("doctor")
    lines = out.splitlines()
    assert code == 0, out
    assert len(lines) == len(CHECKS)
    assert all(line.startswith(f"well   {name}: ") for line, name in zip(lines, CHECKS, strict=True))


def an_old_mujoco(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_checks, "version", lambda name: "4.0.0" if name == "mujoco" else metadata.version(name))


def a_missing_package(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_checks, "requires", lambda name: [*(metadata.requires(name) or []), "no-such-package"])


def test_extras_need_not_be_installed(run, monkeypatch):
    only(monkeypatch, "versions")
    monkeypatch.setattr(machine_checks, "requires", lambda name: ["mujoco", 'no-such-package; extra == "rl"'])
    assert run("doctor")[0] == 0


def an_old_python(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_checks.platform, "python_version", lambda: "3.10.4")


def a_small_quota(monkeypatch, tmp_path):
    (tmp_path / "cpu.max").write_text("50000 100000\n")
    monkeypatch.setattr(machine_checks, "QUOTA", tmp_path / "cpu.max")


def no_gl(monkeypatch, tmp_path):
    monkeypatch.setenv("MUJOCO_GL", "disable")


def no_driver(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_checks, "RENDERING", "\nraise SystemExit('no driver')")


def no_ffmpeg(monkeypatch, tmp_path):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "ffmpeg"))


def no_cache(monkeypatch, tmp_path):
    def refuse(dir: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(machine_checks.tempfile, "TemporaryFile", refuse)


def no_compiler(monkeypatch, tmp_path):
    monkeypatch.setattr(kernel, "record", lambda: None)  # as it is with NUMBA_DISABLE_JIT


def a_vain_wish(monkeypatch, tmp_path):
    monkeypatch.setattr(gl, "_VAIN", ["nonsense"])


def no_walk(monkeypatch, tmp_path):
    def diverge(*arguments: object, **options: object) -> None:
        raise SimulationError("start 0 diverged")

    monkeypatch.setattr(physical, "physical_walk", diverge)


@pytest.mark.parametrize(
    ("name", "failure", "found"),
    [
        ("versions", an_old_mujoco, "mujoco 4.0.0, expected <4,>=3.17"),
        ("versions", a_missing_package, "no-such-package is not installed"),
        ("versions", an_old_python, "Python 3.10.4, expected >=3.11"),
        ("threads", a_small_quota, "would share 0.5 cores"),
        ("rendering", no_gl, "MUJOCO_GL asks for nothing"),
        ("rendering", no_driver, "no driver"),
        ("rendering", a_vain_wish, "MUJOCO_GL = nonsense is not there; expected one of egl, glfw and osmesa that is"),
        ("films", no_ffmpeg, "ffmpeg"),
        ("compiled code", no_cache, "Permission denied"),
        ("compiled code", no_compiler, "NUMBA_DISABLE_JIT is set"),
        ("walking", no_walk, "start 0 diverged"),
    ],
)
def test_a_failure_is_reported_with_its_remedy(run, monkeypatch, tmp_path, name, failure, found):
    only(monkeypatch, name)
    failure(monkeypatch, tmp_path)
    code, out, _ = run("doctor", "--json")
    answer = json.loads(out)
    (check,) = answer["checks"]
    assert code == 1
    assert answer["well"] is False
    assert check["name"] == name and check["well"] is False
    assert found in check["found"] and "packages lib" not in check["found"]
    assert check["remedy"] == CHECKS[name][1]


def test_files_in_the_current_folder_are_no_pythons_own(run, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("random.py").write_text("raise RuntimeError('mine')")
    only(monkeypatch, "rendering")
    assert run("doctor")[0] == 0


def test_what_was_left_out_is_no_failure(run, monkeypatch):
    only(monkeypatch, "films")
    monkeypatch.setitem(sys.modules, "mediapy", None)
    code, out, _ = run("doctor")
    assert code == 0
    assert out.startswith("note   films: ") and out.endswith('pip install ".[film]"\n')


@pytest.mark.slow
@drawing
def test_what_can_be_kept_nowhere_hides_no_other_check():
    """As where numba finds no folder that it may write to."""
    nowhere = "from numba.core.caching import CacheImpl as c; c._locator_classes.clear(); import hexmj.__main__ as m; "
    done = subprocess.run(
        [sys.executable, "-c", f"{nowhere} m.main()", "doctor", "--json"], capture_output=True, text=True
    )
    well = {one["name"]: one["well"] for one in json.loads(done.stdout)["checks"]}
    assert done.returncode == 1
    assert well == {name: name not in ("compiled code", "walking") for name in CHECKS}
    version = [sys.executable, "-c", f"{nowhere} m.main()", "--version"]
    assert subprocess.run(version, capture_output=True, text=True).stdout.startswith("hexmj ")


def test_one_failure_does_not_hide_the_others(monkeypatch):
    def broken() -> str:
        raise ZeroDivisionError

    monkeypatch.setattr(machine_checks, "CHECKS", {"first": (broken, "mend it"), "second": (lambda: "all is well", "")})
    first, second = examine()
    assert (first.well, first.found, first.remedy) == (False, "ZeroDivisionError", "mend it")
    assert (second.well, second.found) == (True, "all is well")


def test_quotas_are_read_where_there_are_any(monkeypatch, tmp_path):
    monkeypatch.setattr(machine_checks, "QUOTA", tmp_path / "cpu.max")
    assert "one for each core" in machine_checks.threads()
    (tmp_path / "cpu.max").write_text("max 100000\n")
    assert "one for each core" in machine_checks.threads()
    (tmp_path / "cpu.max").write_text("1000 100000\n")
    with pytest.raises(Unfit, match=r"share 0\.01 cores"):
        machine_checks.threads()


def test_elsewhere_there_is_no_quota_and_all_cores_are_counted(monkeypatch, tmp_path):
    """Linux alone tells which cores a process may use, and what a container is granted."""
    monkeypatch.setattr(machine_checks, "QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(threads.sys, "platform", "darwin")
    monkeypatch.delattr(threads.os, "sched_getaffinity", raising=False)
    assert threads.cores() >= 1
    assert machine_checks.threads().startswith(str(threads.cores()))
