"""Sweeps: cells have the same bits on every executor, are computed once, and are cached by what they depend on."""

import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.measures.kinematic import KinematicFlss
from hexmj.sweep import Cell, over_axes, run_cells, run_study, threads_each, workers
from small_cells import (
    ENVIRONMENT,
    Wave,
    assert_same_bits,
    counted_cells,
    odd_bits,
    odd_cells,
    reporting,
    steps,
)

MINE = """
from dataclasses import dataclass
import gains

@dataclass(frozen=True)
class Tripod:
    rate: float = 1.0

    def steps(self, n):
        return [gains.GAIN * self.rate * i for i in range(n)]
"""


def calls(log: Path) -> list[str]:
    return (log / "calls").read_text().split() if (log / "calls").exists() else []


def cached(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("[!.]*.nc")}


@pytest.fixture(scope="module")
def spawned() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        yield pool


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's modules `mine` and `gains` in a folder of their own."""
    (folder := tmp_path / "user").mkdir()
    (folder / "mine.py").write_text(MINE)
    (folder / "gains.py").write_text("GAIN = 1.0\n")
    monkeypatch.syspath_prepend(folder)
    for name in ("mine", "gains"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return folder


@pytest.mark.slow
def test_bits_are_the_same_in_this_process_threads_processes_and_again(tmp_path: Path, spawned: Executor) -> None:
    direct = [odd_bits(seed) for seed in range(6)]
    with ThreadPoolExecutor(3) as threads:
        executors = {"here": None, "threads": threads, "processes": spawned}
        found = {name: run_cells(odd_cells(), tmp_path / name, executor=one) for name, one in executors.items()}
        found |= {f"{name}, not cached": run_cells(odd_cells(), executor=one) for name, one in executors.items()}
    found["again"] = run_cells(odd_cells(), tmp_path / "here")
    for data in found.values():
        assert_same_bits(data, direct)
    assert cached(tmp_path / "here") == cached(tmp_path / "threads") == cached(tmp_path / "processes")


@pytest.mark.slow
def test_a_dask_cluster_gives_the_bits_of_one_process(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    how = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "processes": False}
    with distributed.LocalCluster(**how) as cluster, workers(scheduler=cluster.scheduler_address) as executor:
        assert_same_bits(run_cells(odd_cells(), tmp_path, executor=executor), run_cells(odd_cells()))
        walks = {"n_starts": 2500, "observation_time": "start", "range_of": 700}
        elsewhere = hexmj.flss(hexmj.LDVS, [0.5, 0.7], executor=executor, **walks)
        assert elsewhere.identical(hexmj.flss(hexmj.LDVS, [0.5, 0.7], **walks))


def test_cells_receive_the_execution_arguments_that_they_take(spawned: Executor) -> None:
    cells = [Cell("takes", reporting, {"seed": 1}), Cell("does not", odd_bits, {"seed": 1})]
    assert run_cells(cells)[0].threads == -1
    assert run_cells(cells, threads=3)[0].threads == 3
    assert run_cells(cells, executor=spawned)[0].threads == 1
    assert threads_each(None, 1) is None and threads_each(5, 2) == 5


@pytest.mark.parametrize("pool", [True, False])
def test_progress_adds_up_to_one_by_shares_of_the_work(tmp_path: Path, pool: bool) -> None:
    cells = [Cell("small", reporting, {"seed": 0}), Cell("large", reporting, {"seed": 1}, work=3.0)]
    for missing, largest in (("*", 0.1875), ("large*", 0.25), ("none", 1.0)):
        for path in tmp_path.glob(missing):
            path.unlink()
        parts: list[float] = []
        with ThreadPoolExecutor(1) as executor:
            run_cells(cells, tmp_path, executor=executor if pool else None, progress=parts.append)
        assert sum(parts) == pytest.approx(1.0)
        assert pool or max(parts) == pytest.approx(largest)


def test_only_missing_cells_are_computed_and_fresh_computes_all(tmp_path: Path) -> None:
    cells, folder = counted_cells(tmp_path), tmp_path / "cells"
    run_cells(cells[:3], folder)
    again = run_cells(cells[::-1], folder)
    assert sorted(calls(tmp_path)) == [f"{i}" for i in range(6)]
    assert [float(data.number) for data in again] == [5.0, 4.0, 3.0, 2.0, 1.0, 0.0]
    then = cached(folder)
    run_cells(cells, folder, fresh=True)
    assert len(calls(tmp_path)) == 12 and cached(folder) == then


def test_an_error_names_its_cell_and_leaves_finished_cells(tmp_path: Path) -> None:
    cells = [
        *counted_cells(tmp_path, 2),
        *counted_cells(tmp_path, 1, fails=True),
        *counted_cells(tmp_path, 50, wait=0.05),
    ]
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError) as failed:
        run_cells(cells, tmp_path / "cells", executor=pool)
    assert "number 0" in failed.value.__notes__[0]
    assert 2 <= len(calls(tmp_path)) < 10
    assert len(cached(tmp_path / "cells")) == len(calls(tmp_path))


@dataclass(frozen=True)
class Products:
    """A study of few lines."""

    heights: tuple[float, ...] = (1.0, 2.0)
    speeds: tuple[float, ...] = (0.1, 0.2, 0.3)

    def cells(self) -> list[Cell]:
        both = product(self.heights, self.speeds)
        return [Cell(f"{height:g}-{speed:g}", Wave(height).rows, {"shift": speed}) for height, speed in both]

    def result(self, data: Sequence[xr.Dataset]) -> xr.Dataset:
        table = over_axes({"height": len(self.heights), "speed": len(self.speeds)}, data)
        return table.assign_coords(height=list(self.heights), speed=list(self.speeds))


def test_cells_stand_along_their_axes_in_order(tmp_path: Path) -> None:
    data = run_study(Products(), tmp_path)
    height, speed = data.height.values[:, None, None], data.speed.values[:, None]
    assert data.y.dims == ("height", "speed", "x")
    assert np.array_equal(data.y, height * np.arange(3.0) + speed)
    assert run_study(Products(), tmp_path).identical(data)


# ---- the cache key ----


def test_every_setting_is_part_of_the_key() -> None:
    cells = [
        Cell("a", odd_bits, {"seed": 0}),
        Cell("a", odd_bits, {"seed": 1}),
        Cell("a", odd_bits, {"seed": 0, "size": 5}),
        Cell("a", reporting, {"seed": 0}),
        Cell("a", Wave().rows, {"shift": 0.0}),
        Cell("a", Wave(2.0).rows, {"shift": 0.0}),
        Cell("a", Wave(1.0, np.arange(4.0)).rows, {"shift": 0.0}),
    ]
    assert len({cell.stem(cell.record()) for cell in cells}) == len(cells)
    assert Cell("a", odd_bits, {"seed": 0}, work=9.0).record() == cells[0].record()


def test_the_key_names_sources_settings_and_four_versions(mine: Path) -> None:
    record = json.loads(Cell("a", steps, {"controller": importlib.import_module("mine").Tripod(), "n": 2}).record())
    assert {*record} == {"function", "of", "settings", "sources", "versions"}
    assert {*record["sources"]} == {"hexmj", "mine", "small_cells"}
    assert {*record["versions"]} == {"mujoco", "numpy", "scipy", "numba"}
    assert record["settings"]["controller"] == {"class": "mine:Tripod", "rate": 1.0}


def test_the_key_of_a_cell_of_hexmj_names_hexmj_alone() -> None:
    (cell,) = KinematicFlss(hexmj.LDVS, [0.5]).cells()
    assert {*json.loads(cell.record())["sources"]} == {"hexmj"}


@pytest.mark.parametrize("edited", ["mine.py", "gains.py"])
def test_an_edit_of_a_controllers_file_or_one_beside_it_is_another_key(mine: Path, tmp_path: Path, edited: str) -> None:
    def cell() -> Cell:
        return Cell("a", steps, {"controller": importlib.import_module("mine").Tripod(), "n": 3})

    first = run_cells([cell()], tmp_path / "cells")
    unedited = cell().record()
    assert cell().record() == unedited
    (mine / edited).write_text((mine / edited).read_text().replace("1.0", "2.0"))
    assert cell().record() != unedited
    for name in ("mine", "gains"):
        del sys.modules[name]
    importlib.invalidate_caches()
    assert run_cells([cell()], tmp_path / "cells")[0].steps.values.tolist() == [0.0, 2.0, 4.0]
    assert first[0].steps.values.tolist() == [0.0, 1.0, 2.0] and len(cached(tmp_path / "cells")) == 2


def test_any_name_becomes_a_name_of_a_file() -> None:
    for name in ("step 2 mm", "../../etc", ".hidden", "x" * 1000, "ö/$$ [red]\n"):
        stem = (cell := Cell(name, odd_bits, {"seed": 0})).stem(cell.record())
        assert Path(stem).name == stem and len(stem) < 120 and stem.isascii() and not stem.startswith(".")


@pytest.mark.parametrize(
    "ask",
    [
        lambda folder: Cell("a", lambda: xr.Dataset(), {}).record(),
        lambda folder: run_cells([Cell("a", odd_bits, {"seed": object()})], folder),
        lambda folder: over_axes({"a": 2}, 3 * [xr.Dataset()]),
        lambda folder: workers(processes=0).__enter__(),
        lambda folder: workers(scheduler="nowhere").__enter__(),
    ],
)
def test_bad_input_is_refused(tmp_path: Path, ask) -> None:
    with pytest.raises(InputError):
        ask(tmp_path)


# ---- processes that end ----

SWEEP = """
import sys
from pathlib import Path
from hexmj.sweep import run_cells, workers
from small_cells import counted_cells

if __name__ == "__main__":
    with workers(int(sys.argv[3])) as executor:
        run_cells(counted_cells(Path(sys.argv[2]), 30, wait=float(sys.argv[4])), Path(sys.argv[1]), executor=executor)
"""


def start_sweep(folder: Path, log: Path, processes: int, wait: float = 0.03) -> subprocess.Popen[bytes]:
    (script := log / "run_sweep.py").write_text(SWEEP)
    command = [sys.executable, str(script), str(folder), str(log), str(processes), str(wait)]
    return subprocess.Popen(command, env=ENVIRONMENT, start_new_session=True)


def wait_for(condition) -> None:
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_a_killed_sweep_resumes_with_equal_results(tmp_path: Path, processes: int) -> None:
    running = start_sweep(tmp_path / "cells", tmp_path, processes)
    wait_for(lambda: len(calls(tmp_path)) >= 8)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    before = cached(tmp_path / "cells")
    assert 5 <= len(before) < 30
    found = run_cells(counted_cells(tmp_path, 30, wait=0.03), tmp_path / "cells")
    assert [float(data.number) for data in found] == list(range(30))
    assert before.items() <= cached(tmp_path / "cells").items()
    assert len(calls(tmp_path)) <= 30 + processes


@pytest.mark.slow
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    running = start_sweep(tmp_path / "cells", tmp_path, 2, wait=0.2)
    wait_for(lambda: calls(tmp_path))
    running.kill()
    running.wait()
    time.sleep(1.0)
    number = len(calls(tmp_path))
    time.sleep(1.0)
    assert len(calls(tmp_path)) == number < 30


@pytest.mark.slow
def test_two_sweeps_share_a_folder(tmp_path: Path) -> None:
    both = [start_sweep(tmp_path / "cells", tmp_path, processes) for processes in (1, 2)]
    assert [running.wait(60) for running in both] == [0, 0]
    assert len(cached(tmp_path / "cells")) == 30 and not list((tmp_path / "cells").glob(".part-*"))
