"""Nothing finished of a sweep is lost, whatever ends it, and nothing damaged is believed."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hexmj.user_code.loaded import importable

from hexmj.errors import InputError
from hexmj.sweep import Cell, finished_cells, run_cells
from left_by_cells import calls, contents
from small_cells import ENVIRONMENT, MINE, assert_same_bits, counted_cells, odd_cells, of_object


def test_a_kept_cell_is_netcdf_that_tells_what_it_depends_on(tmp_path: Path) -> None:
    (cell,) = odd_cells(1)
    run_cells([cell], tmp_path)
    (path,) = tmp_path.iterdir()
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert json.loads(data.attrs["cell"])["settings"] == {"seed": 0}
        assert path.stem == cell.stem(data.attrs["cell"])


def test_a_damaged_or_foreign_cell_is_never_believed(tmp_path: Path) -> None:
    cell, other = odd_cells(2)
    run_cells([cell, other], tmp_path)
    path, foreign = (tmp_path / f"{one.stem(one.record())}.nc" for one in (cell, other))
    good = path.read_bytes()
    draw = np.random.default_rng(0)
    damaged = [b"", good[:-1], good[: len(good) // 2], good + b" ", b"CDF\x01", foreign.read_bytes()]
    for where in draw.integers(len(good), size=40):
        damaged.append(good[:where] + bytes([good[where] ^ 1 << draw.integers(8)]) + good[where + 1 :])
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"{path.name} is .*; delete it, and it is made anew$"):
            run_cells([cell], tmp_path)
    path.unlink()
    path.symlink_to("nowhere/cell.nc")
    with pytest.raises(InputError, match=rf"{path.name} is a link to nothing; delete it, and it is made anew$"):
        run_cells([cell], tmp_path)
    path.unlink()
    run_cells([cell], tmp_path)
    assert path.read_bytes() == good


def test_an_error_cancels_what_has_not_begun_and_keeps_what_is_finished(tmp_path: Path) -> None:
    cells = [
        *counted_cells(tmp_path, 2),
        *counted_cells(tmp_path, 1, fails=True),
        *counted_cells(tmp_path, 50, wait=0.05),
    ]
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="cell 0 fails"):
        run_cells(cells, tmp_path / "kept", executor=pool)
    assert 2 <= len(calls(tmp_path)) < 10
    assert len(contents(tmp_path / "kept")) == len(calls(tmp_path))


@pytest.mark.parametrize("end", ["ctrl-c", "close"])
def test_a_caller_who_goes_away_cancels_what_has_not_begun(tmp_path: Path, end: str) -> None:
    cells = counted_cells(tmp_path, 50, wait=0.02)

    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as pool:
        if end == "ctrl-c":
            with pytest.raises(KeyboardInterrupt):
                run_cells(cells, tmp_path / "kept", executor=pool, progress=stop)
        else:
            some = finished_cells(cells, tmp_path / "kept", executor=pool)
            next(some)
            del some
    assert 1 <= len(contents(tmp_path / "kept")) == len(calls(tmp_path)) < 10


SWEEP = """
import sys
from pathlib import Path
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from hexmj.sweep import run_cells
from small_cells import counted_cells

if __name__ == "__main__":
    folder, log, workers = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    cells = counted_cells(log, 30, wait=0.03)
    if workers:
        with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
            run_cells(cells, folder, executor=pool)
    else:
        run_cells(cells, folder)
"""


def sweep(folder: Path, log: Path, workers: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", SWEEP, str(folder), str(log), str(workers)]
    return subprocess.Popen(command, env=ENVIRONMENT, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 2])
def test_a_killed_sweep_goes_on_where_it_was(tmp_path: Path, workers: int) -> None:
    folder = tmp_path / "kept"
    running = sweep(folder, tmp_path, workers)
    while running.poll() is None and len(calls(tmp_path)) < 8:
        time.sleep(0.01)
    os.killpg(running.pid, signal.SIGKILL)
    running.wait()
    before = {name: content for name, content in contents(folder).items() if not name.startswith(".part-")}
    assert 5 <= len(before) < 30
    cells = counted_cells(tmp_path, 30, wait=0.03)
    with ThreadPoolExecutor(10) as pool:
        found = run_cells(cells, folder, executor=pool)
    assert [float(one.number) for one in found] == list(range(30))
    assert before.items() <= contents(folder).items()
    assert len(calls(tmp_path)) <= 30 + max(1, workers)
    assert_same_bits(found, run_cells(cells, tmp_path / "fresh", executor=ThreadPoolExecutor(30)))


@pytest.mark.slow
def test_two_sweeps_share_a_folder(tmp_path: Path) -> None:
    both = [sweep(tmp_path / "kept", tmp_path, workers) for workers in (0, 2)]
    assert [one.wait() for one in both] == [0, 0]
    assert len(contents(tmp_path / "kept")) == 30
    assert not list((tmp_path / "kept").glob(".part-*"))


def test_a_full_disk_is_one_sentence_and_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = counted_cells(tmp_path, 3)
    run_cells(cells[:1], tmp_path / "kept")
    before = contents(tmp_path / "kept")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"cannot be written: No space left on device$"):
        run_cells(cells, tmp_path / "kept")
    assert contents(tmp_path / "kept") == before


def edits(path: str, text: str) -> xr.Dataset:
    Path(path).write_text(text)
    return xr.Dataset({"a": 1.0})


def test_a_file_that_is_edited_while_a_cell_is_computed_is_refused(tmp_path: Path) -> None:
    (data := tmp_path / "gains.toml").write_text("before")
    with pytest.raises(InputError, match="edits: path of settings has changed while it was in use; start again"):
        run_cells([Cell("edits", edits, {"path": str(data), "text": "after"})], tmp_path / "kept")
    assert not list(tmp_path.rglob("*.nc"))
    assert len(run_cells([Cell("edits", edits, {"path": str(data), "text": "after"})], tmp_path / "kept")) == 1


def test_a_worker_with_other_code_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    cell = Cell("a", of_object, {"controller": importable(tmp_path / "mine.py").Tripod(), "n": 2})

    class Late(Executor):
        """Another process, begun after an edit."""

        def submit(self, fn, /, *args, **kwargs):  # pyright: ignore[reportIncompatibleMethodOverride]
            (tmp_path / "mine.py").write_text(MINE + "# edited")
            sys.modules.pop(type(cell.settings["controller"]).__module__)
            future: Future[xr.Dataset] = Future()
            try:
                future.set_result(fn(*args, **kwargs))
            except InputError as error:
                future.set_exception(error)
            return future

    with pytest.raises(InputError, match=r"mine\.py was edited while it was in use; start again$"):
        run_cells([cell], tmp_path / "kept", executor=Late())
    assert not list((tmp_path / "kept").iterdir())
