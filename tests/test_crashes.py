"""Every write of a sweep fails, is cut short or is the last; every kill at a random moment: nothing is lost of it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.search.forms import FieldsForm
from hexmj.search.problems import Problem
from hexmj.search.stages import Effort, search
from hexmj.storage import netcdf
from hexmj.storage.files import PART, prepare, remove_leftovers, replacing
from hexmj.sweep import Cell, CachedValues, run_cells
from small_cells import ENVIRONMENT, moves, numbers, squares
from tests.soak.counted import LOG, Counted
from tests.soak.crashes import Nursery
from tests.soak.faults import KINDS
from tiers import few_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nursery]:
    brought_up = Nursery(tmp_path_factory.mktemp("lives"))
    yield brought_up
    brought_up.close()


@pytest.mark.parametrize(
    ("job", "kind"),
    few_of(product(["sweep", "search"], KINDS), *product(["sweep"], KINDS), ("search", "kill")),
)
def test_every_write_in_turn(nursery: Nursery, job: str, kind: str) -> None:
    points = nursery.points(job, kind)
    assert len(points) > (3 if kind == "short" else 12)
    broken = {at: nursery.broken(job, {"fault": {"at": at, "kind": kind}}) for at in points}
    assert not {at: faults for at, faults in broken.items() if faults}


@pytest.mark.parametrize("kind", ["torn", "kill"])
@pytest.mark.parametrize("job", ["physical", "physical search"])
def test_some_writes_of_physical_walks(nursery: Nursery, job: str, kind: str) -> None:
    points = np.random.default_rng(len(job)).choice(nursery.points(job, kind), size=3, replace=False)
    broken = {at: nursery.broken(job, {"fault": {"at": at, "kind": kind}}) for at in points.tolist()}
    assert not {at: faults for at, faults in broken.items() if faults}


KILLS = {"sweep on processes": 9, "physical on processes": 5, "physical search": 5, "command on processes": 1}


@pytest.mark.parametrize("job", few_of(KILLS, "sweep on processes", "physical on processes", "physical search"))
def test_kills_at_random_moments(nursery: Nursery, job: str) -> None:
    moments = np.random.default_rng([1998, len(job)]).uniform(0, nursery.unbroken(job).lived, KILLS[job]).tolist()
    broken = {moment: nursery.broken(job, {"moment": moment}) for moment in moments}
    assert not {moment: faults for moment, faults in broken.items() if faults}


@pytest.mark.parametrize("job", ["sweep", "search", "command"])
def test_a_disk_that_is_full_again_after_each_start(nursery: Nursery, job: str) -> None:
    full = ({"fault": {"at": at, "kind": "torn"}} for at in (6, 4, 8))
    assert nursery.broken(job, *full) == []


@pytest.mark.parametrize("job", ["sweep", "search", "command"])
def test_a_folder_that_can_only_be_read(nursery: Nursery, job: str) -> None:
    """Before anything is computed."""
    life = nursery.life(job, fault={"at": 0, "kind": "EROFS", "again": True})
    assert (life.code, life.computed(), life.files()) == (2, {}, {})
    assert "cannot be written" in life.told and life.told.endswith(": Read-only file system\n")


def test_what_is_finished_is_read_from_such_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Cell("numbers", numbers, {"seed": 0})
    (whole,) = run_cells([cell], tmp_path)
    for name in ("prepare", "write"):
        monkeypatch.setattr(f"hexmj.sweeps.grid.{name}", None)
    assert run_cells([cell], tmp_path)[0].identical(whole)


# What the killed left behind


def test_the_next_run_removes_what_a_killed_writer_left(tmp_path: Path) -> None:
    left, own = tmp_path / f"{PART}{'0' * 32}.nc", tmp_path / f"{PART}of-a-users.nc"
    for path in (left, own):
        path.write_bytes(b"half")
    run_cells([Cell("numbers", numbers, {"seed": 0})], tmp_path)
    assert not left.exists()
    assert own.exists()


def test_but_nothing_that_is_being_written(tmp_path: Path) -> None:
    with replacing(tmp_path / "one") as one, ThreadPoolExecutor() as pool:
        one.write_bytes(b"1")
        pool.submit(prepare, tmp_path).result()
        with replacing(tmp_path / "two") as two:
            two.write_bytes(b"2")
            remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "two"]


# Processes without a parent, and a parent without its processes


ORPHANS = """
import os, signal, time
from hexmj.cli.sweepers import Sweepers

if __name__ == "__main__":
    with Sweepers(processes=2).executor() as pool:
        waiting = [pool.submit(time.sleep, one) for one in (0.3, 600)]
        waiting[0].result()
        print(*pool._processes, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""


def lives(process: int) -> bool:
    """Neither gone nor a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_processes_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    """The idle and the busy one."""
    (script := tmp_path / "orphans.py").write_text(ORPHANS)
    parent = subprocess.Popen([sys.executable, script], env=ENVIRONMENT, stdout=subprocess.PIPE)
    with parent:
        assert parent.stdout
        workers = [int(one) for one in parent.stdout.readline().split()]
    assert (parent.returncode, len(workers)) == (-signal.SIGKILL, 2)
    until = time.monotonic() + 10
    while (left := [one for one in workers if lives(one)]) and time.monotonic() < until:
        time.sleep(0.05)
    for one in left:
        os.kill(one, signal.SIGKILL)
    assert not left


WRITES = """
import os, signal, sys, time
from pathlib import Path
from hexmj.cli.sweepers import Sweepers
from hexmj.storage.files import replacing

def write(told):
    with replacing(Path(told) / "whole") as part:
        Path(told, "began").touch()
        time.sleep(0.2)
        part.write_text("all of it")
    time.sleep(600)

if __name__ == "__main__":
    with Sweepers(processes=2).executor() as pool:
        pool.submit(write, sys.argv[1])
        while not Path(sys.argv[1], "began").exists():
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_they_are_writing_then_is_written_whole(tmp_path: Path) -> None:
    """Or else it may be made just after it was looked for, to be taken away."""
    (script := tmp_path / "writes.py").write_text(WRITES)
    (folder := tmp_path / "kept").mkdir()
    subprocess.run([sys.executable, script, folder], env=ENVIRONMENT)
    until = time.monotonic() + 10
    while {one.name for one in folder.iterdir()} != {"began", "whole"} and time.monotonic() < until:
        time.sleep(0.05)
    assert {one.name for one in folder.iterdir()} == {"began", "whole"}


def test_a_process_that_is_killed_is_a_sentence(nursery: Nursery) -> None:
    life = nursery.life("killed process")
    assert life.code == 2
    assert "a process that computed cells was killed, or could not be started; what is finished is kept" in life.told
    assert [path.name[:2] for path in (life.folder / "walks").iterdir()] == ["0-"]


# Folders that go away


def test_a_folder_that_is_renamed_in_the_middle(tmp_path: Path) -> None:
    folder, to = tmp_path / "kept", tmp_path / "renamed"
    cells = [Cell(f"{seed}", moves, {"folder": str(folder), "to": str(to), "seed": seed}) for seed in (0, 1)]
    with pytest.raises(InputError, match=r"kept was removed or renamed while it was in use; nothing more is written"):
        run_cells(cells, folder)
    assert not folder.exists()
    assert [path.name[:2] for path in to.iterdir()] == ["0-"]


def test_a_folder_that_goes_away_as_a_cell_is_encoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    encode, folder = netcdf.encode, tmp_path / "kept"
    monkeypatch.setattr(netcdf, "encode", lambda data: [encode(data), folder.rmdir()][0])
    with pytest.raises(InputError, match=r"kept was removed or renamed while it was in use; nothing more is written"):
        run_cells([Cell("numbers", numbers, {"seed": 0})], folder)
    assert not folder.exists()


@pytest.mark.parametrize("gone", ["folder", "file"])
def test_evaluations_that_are_removed_in_the_middle(tmp_path: Path, gone: str) -> None:
    rows, cell, folder = np.eye(4), Cell("squares", squares, {}), tmp_path / "kept"
    values = CachedValues(cell, folder)
    values(rows[:2])
    (path,) = folder.iterdir()
    path.unlink()
    if gone == "folder":
        folder.rmdir()
    with pytest.raises(InputError, match=r"\.jsonl cannot be written: (it was removed|No such file)"):
        values(rows)
    assert CachedValues(cell, folder)(rows).tolist() == [1.0] * 4
    assert CachedValues(cell, folder).known == 4


@pytest.mark.parametrize("odd", [[[1.0, 2.0], [3.0]], [1.0, 2.0]])
def test_rows_that_are_none_are_refused(odd: Any) -> None:
    with pytest.raises(InputError, match=r"^rows .*; expected"):
        CachedValues(Cell("squares", squares, {}))(odd)


def test_no_rows_have_no_values() -> None:
    assert CachedValues(Cell("squares", squares, {}))(np.array([])).tolist() == []


def test_a_line_after_one_that_was_torn_stands_by_itself(tmp_path: Path) -> None:
    rows, cell = np.eye(4), Cell("squares", squares, {})
    values = CachedValues(cell, tmp_path)
    values(rows[:2])
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-9])
    values(rows)
    assert CachedValues(cell, tmp_path).known == 3


def test_a_search_has_its_folder_alone_as_a_function_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOG, os.devnull)
    problem = Problem(FieldsForm(Counted()), 0.5, 0.5, 2.0)
    effort = Effort(population=2, budget=4, starts=2, refine_budget=0)

    def another(_: float) -> None:
        with pytest.raises(InputError, match=rf"is in use by process {os.getpid()} on "):
            search(problem, effort, folder=tmp_path)
        told.append(1)

    told: list[int] = []
    found = search(problem, effort, folder=tmp_path, progress=another)
    assert told
    assert search(problem, effort, folder=tmp_path).history.identical(found.history)
