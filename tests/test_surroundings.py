"""What a command finds around it that libraries would make a traceback of."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from hexmj.cli import machine_checks
from hexmj.controllers.checked_plans import said
from tiers import few_of

WALK = ("walk", "--physical", "--observation time", "1")
FEW = ("flss", "--velocities", "0.5", "--starts", "3", "--observation time", "start")


def done_with(words: tuple[str, ...], **around: str) -> subprocess.CompletedProcess[str]:
    """A command that ends within a minute; its code and what it said, and never a traceback."""
    done = subprocess.run(
        [sys.executable, "-m", "hexmj", *words],
        env=os.environ | around, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_where_nothing_tells_of_processes_a_sentence_does(run, monkeypatch, tmp_path: Path):
    """Dask, which xarray imports, makes a traceback of it."""
    pytest.importorskip("dask")
    monkeypatch.setattr("hexmj.cli.surroundings.PROCESSES", tmp_path)
    told = f"{tmp_path} does not tell of this process; expected that it does, for Dask asks for its cores"
    assert run("flss") == (2, "", f"hexmj: {told}\n")
    assert run("--version")[0] == run("flss", "--help")[0] == 0
    monkeypatch.setattr(machine_checks, "CHECKS", {"threads": machine_checks.CHECKS["threads"]})
    code, text, _ = run("doctor")
    assert code == 1 and told in " ".join(text.split())


@cache
def flss_in(columns: str) -> str:
    """What `flss` prints in a terminal of so many columns."""
    return done_with(("flss", "--velocities", "0.5", "--starts", "4", "--observation time", "5"), COLUMNS=columns).stdout


@pytest.mark.parametrize("columns", ["1", "7", "39"])
def test_a_terminal_of_few_columns_gets_its_help(columns: str):
    assert done_with(("--help",), COLUMNS=columns).returncode == 0


@pytest.mark.thorough
@pytest.mark.parametrize("columns", ["0", "00", "wide"])
def test_no_width_is_as_wide_as_usual(columns: str):
    assert flss_in(columns) == flss_in("80") != ""


@pytest.mark.thorough
def test_figures_go_to_files_whatever_the_backend(tmp_path: Path):
    done = done_with((*FEW, "--out", str(tmp_path)), MPLBACKEND="nonsense")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "flss.png").exists()


@pytest.mark.thorough
def test_figures_are_the_same_whatever_a_matplotlibrc_asks_for(tmp_path: Path):
    """TeX is not there, and would not take a title with a per cent sign."""
    (wish := tmp_path / "matplotlibrc").write_text("text.usetex: True\nfont.size: 30\nlines.linewidth: 8\n")
    for out, around in (("plain", {}), ("asked", {"MATPLOTLIBRC": str(wish)})):
        done = done_with((*FEW, "--out", str(tmp_path / out)), **around)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "plain" / "flss.png").read_bytes() == (tmp_path / "asked" / "flss.png").read_bytes()


@pytest.mark.thorough
def test_empty_numbers_for_libraries_are_none_at_all():
    done = done_with(FEW, NUMBA_NUM_THREADS="", SOURCE_DATE_EPOCH="")
    said = [line for line in done.stderr.splitlines() if "% in " not in line]
    assert (done.returncode, said) == (0, [])


@pytest.mark.parametrize(
    ("name", "number"),
    [
        *(("NUMBA_NUM_THREADS", one) for one in ("0", "-3", "many", str(2**31))),
        *(("SOURCE_DATE_EPOCH", one) for one in ("-3", "now", "253402300800", "9" * 5000)),
    ],
)
def test_numbers_for_libraries_that_are_none(name: str, number: str):
    done = done_with(FEW, **{name: number})
    assert done.returncode == 2
    assert f"{name} = {number[:80]}; expected a whole number" in done.stderr


@pytest.mark.slow
def test_a_film_without_glfw_is_a_sentence(tmp_path: Path):
    words = "render", "--observation time", "1", "--out", str(tmp_path / "film")
    done = done_with(words, PYGLFW_LIBRARY="/nonexistent", MUJOCO_GL="")
    assert done.returncode == 1
    assert "Nothing can be rendered here (MuJoCo found no GLFW, as where PYGLFW_LIBRARY leads to none)" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("wish", few_of(["off", "nonsense", "osmesa"], "off"))
def test_who_draws_nothing_needs_no_gl_and_who_draws_gets_a_sentence(wish: str, tmp_path: Path):
    done = done_with((*WALK, "--out", str(tmp_path / "walk")), MUJOCO_GL=wish)
    assert done.returncode == 0, done.stderr
    done = done_with(("render", "--observation time", "1", "--out", str(tmp_path / "film")), MUJOCO_GL=wish)
    if done.returncode:  # OSMesa may be there
        assert done.returncode == 1
        assert done.stderr.startswith("hexmj: Nothing can be rendered here (")


def test_a_folder_that_has_gone(tmp_path: Path):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = f'rmdir "{gone}"; exec "{sys.executable}" -P -m hexmj --version'
    there = {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, filter(None, sys.path)))}
    done = subprocess.run(
        ["sh", "-c", script], cwd=gone, env=os.environ | there, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (2, "hexmj: the current folder is no longer there; expected one that is\n")


@pytest.mark.slow
def test_who_walks_in_a_folder_that_has_gone_needs_none(tmp_path: Path):
    gone = tmp_path / "gone"
    gone.mkdir()
    program = "import hexmj; print(hexmj.first_loss(hexmj.draw_starts(2, 0), hexmj.LDVS, 0.3, 5.0).shape)"
    script = f'rmdir "{gone}"; exec "{sys.executable}" -P -c "{program}"'
    there = {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, filter(None, sys.path)))}
    done = subprocess.run(["sh", "-c", script], cwd=gone, env=os.environ | there, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("(2,)\n", "")


@pytest.mark.parametrize("moves", [False, True])
def test_a_thread_leaves_the_folder_to_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves: bool):
    """Which may change it while a plan is at work, unless that changes it as well."""
    before = Path.cwd()
    begun, moved = threading.Event(), threading.Event()

    def plan() -> None:
        with said("a plan"):
            if moves:
                os.chdir("/")
            begun.set()
            moved.wait(60)

    thread = threading.Thread(target=plan)
    thread.start()
    begun.wait(60)
    monkeypatch.chdir(tmp_path)
    moved.set()
    thread.join()
    assert Path.cwd() == (before if moves else tmp_path)


def test_helpers_of_a_plan_do_not_move_the_program():
    before = Path.cwd()
    with said("a plan"), ThreadPoolExecutor(1) as helper:
        helper.submit(os.chdir, "/").result()
    assert Path.cwd() == before


def test_no_thread_is_a_sentence(run: Any, monkeypatch: pytest.MonkeyPatch):
    def no_thread(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", no_thread)
    code, _, error = run("flss", "--velocities", "0.5", "--starts", 3, "--observation time", "start")
    assert (code, error) == (2, "hexmj: the memory, or a limit of processes, does not suffice for a thread\n")
