"""The comparison as a sweep: it goes on where it was stopped, and its bits do not depend on who computes them."""

import errno
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj import HWS, LDVS, UNCOORDINATED, Conditions, InputError, SensoryFeedback, compare, physical_flss
from hexmj.measures import outcome_table
from hexmj.measures.compare import Comparison
from hexmj.studies.disturbance import DisturbedWalks
from hexmj.studies.stability_map import StabilityMap
from hexmj.studies.static_limit import StaticLimit
from hexmj.studies.terrain import Terrain
from hexmj.sweep import Cell, run_study
from tiers import few_of

BOTH = {"ldvs": LDVS, "uncoordinated": UNCOORDINATED}
FEW: dict[str, Any] = {"n_starts": 3, "observation_time": 10.0}
PUSHED: dict[str, Any] = FEW | {"observation_time": 60.0}
WORDS = ["compare", "--velocities", "0.5", "0.6", "0.7", "--starts", "6", "--observation time", "30"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("compare")


@pytest.fixture(scope="module")
def result(folder):
    return compare(BOTH, [0.4, 0.6], **FEW, folder=folder)


@pytest.fixture(scope="module")
def two_processes():
    with ProcessPoolExecutor(2, get_context("spawn")) as executor:
        yield executor


def test_every_controller_and_velocity_is_a_cell(result, folder):
    names = sorted(path.name.rpartition("-")[0] for path in folder.iterdir())
    assert names == ["ldvs-V-0.4", "ldvs-V-0.6", "uncoordinated-V-0.4", "uncoordinated-V-0.6"]
    assert compare(BOTH, [0.4, 0.6], **FEW).identical(result)


def test_only_what_is_missing_is_walked(result, folder, monkeypatch):
    next(folder.glob("uncoordinated-V-0.4-*")).unlink()
    computed, compute = [], Cell.compute
    monkeypatch.setattr(Cell, "compute", lambda cell, **how: (computed.append(cell.name), compute(cell, **how))[1])
    assert compare(BOTH, [0.4, 0.6], **FEW, folder=folder).identical(result)
    assert computed == ["uncoordinated-V-0.4"]
    more = compare(BOTH | {"hws": HWS}, [0.6], **FEW, folder=folder)
    assert computed[1:] == ["hws-V-0.6"]
    assert more.fall.sel(controller="ldvs").equals(result.fall.sel(controller="ldvs", velocity=[0.6]))
    table = physical_flss(LDVS, [0.4, 0.6], **FEW, folder=folder)
    assert np.array_equal(table.flss, result.physical.sel(controller="ldvs"))
    assert computed[1:] == ["hws-V-0.6"]


def test_starts_settle_once(monkeypatch):
    outcome_table.settled_starts.cache_clear()
    settled, settle = [], outcome_table.settle
    monkeypatch.setattr(outcome_table, "settle", lambda *given: (settled.append(given), settle(*given))[1])
    compare(BOTH, [0.4, 0.6], **FEW)
    assert len(settled) == 1
    compare(BOTH, [0.4], **FEW, conditions=Conditions(load=0.5))
    assert len(settled) == 2


STUDIES = {
    "compare": Comparison(BOTH, [0.6], **FEW),
    "model_variant": Comparison({"model_variant": SensoryFeedback(LDVS)}, [0.5, 0.6], **FEW),
    "map": StabilityMap(LDVS, "load", [0.0, 0.5], [0.6], **FEW),
    "terrain": Terrain(LDVS, [0.8], grounds=["step"], heights=[3.0], grasps=[0.0], n_starts=2),
    "disturb": DisturbedWalks(LDVS, [0.7], ["halt", "push"], strategies=["reorganise"], **PUSHED),
    "converge": StaticLimit(LDVS, 0.6, [200.0, 80.0], [1.0], **FEW),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(STUDIES, "compare", "model_variant", "map", "terrain", "converge"))
def test_processes_and_threads_give_the_same_bits(name, two_processes):
    here = run_study(STUDIES[name], threads=2)
    assert run_study(STUDIES[name], executor=two_processes).identical(here)
    with ThreadPoolExecutor(2) as executor:
        assert run_study(STUDIES[name], executor=executor).identical(here)


@pytest.mark.thorough
def test_a_killed_command_goes_on_and_ends_like_an_unbroken_one(run, tmp_path):
    words = [*WORDS, "--no-video", "--json", "--out"]
    command = [sys.executable, "-m", "hexmj", *words, str(tmp_path / "killed")]
    environment = os.environ | {"PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    killed = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
    walks = tmp_path / "killed" / "walks"
    while not list(walks.glob("ldvs-*")) and killed.poll() is None:
        time.sleep(0.01)
    killed.kill()
    killed.wait()
    kept = {path: path.stat().st_mtime_ns for path in walks.glob("[!.]*")}
    assert 0 < len(kept) < 6 and not (tmp_path / "killed" / "manifest.json").exists()
    answers = []
    for name, more in (("killed", ("--processes", "2")), ("unbroken", ())):
        _, text, _ = run(*words, tmp_path / name, *more)
        answers.append({key: value for key, value in json.loads(text).items() if key != "files"})
    assert answers[0] == answers[1]
    assert kept.items() <= {path: path.stat().st_mtime_ns for path in walks.iterdir()}.items()


@dataclass(frozen=True)
class Nobody:
    """No controller: it begins nothing."""

    name: str = "nobody"


@pytest.mark.parametrize(
    ("controllers", "changed", "said"),
    [
        ({}, {}, "no controller was given"),
        ("ldvs", {}, "expected a controller, a frozen dataclass"),
        ([LDVS], {}, "expected one, or several in a dict"),
        ({"nobody": Nobody()}, {}, "expected a controller, a frozen dataclass"),
        (LDVS, {"n_starts": 0}, "starts = 0; expected a whole number"),
        (LDVS, {"seed": -1}, "seed = -1; expected"),
        (LDVS, {"observation_time": "long"}, "valid names: walk, start"),
        (LDVS, {"velocities": [0.5, 0.5]}, "none of them twice"),
        (LDVS, {"velocities": [1.0]}, "0 <= V < 1"),
        (LDVS, {"velocities": [0.05], "acceleration": hexmj.Acceleration()}, r"expected at least V_r\(0\)"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_walks(tmp_path, controllers, changed, said):
    given: dict[str, Any] = {"velocities": [0.5], "n_starts": 2, "observation_time": 5.0} | changed
    with pytest.raises(InputError, match=said):
        compare(controllers, **given, folder=tmp_path / "walks")
    assert not (tmp_path / "walks").exists()


def test_a_name_that_the_results_need_is_refused(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("report.toml").write_text("[symmetric]\n")
    code, _, error = run("compare", "--models", "ldvs", "report.toml")
    assert code == 2 and "a controller has the name 'report'" in error
    code, _, error = run("compare", "--processes", 0, "--out", tmp_path / "out")
    assert code == 2 and "--processes = 0; expected at least 1" in error
    assert not (tmp_path / "out").exists()


def test_processes_for_which_the_system_has_nothing_left_are_a_sentence(run, tmp_path, monkeypatch):
    """As their semaphores where /dev/shm is full, or cannot be written to."""

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", fail)
    code, text, error = run("compare", "--processes", 2, "--out", tmp_path / "out")
    told = "--processes = 2: the system has no semaphores for them (No space left on device); expected a shared memory"
    assert (code, text) == (2, "") and told in error
    assert not (tmp_path / "out").exists()


def test_arguments_that_nobody_knows_are_refused():
    with pytest.raises(
        InputError, match="argument 'condition'; valid names: those that the call's help shows, and executor"
    ):
        compare(LDVS, [0.3], n_starts=2, observation_time=5.0, condition=1)  # pyright: ignore[reportCallIssue]
