"""Laws of sweeps: a cell's bits are the same anywhere, and nothing kept is lost."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from hexmj.errors import InputError
from hexmj.loaded import importable
from hexmj.sweeps import Cell, KeptValues, conduct, finish, over_axes, run
from small_cells import ENVIRONMENT, MINE, Wave, calls, counted_cells, odd_bits, odd_cells, of_object, told_how


def squares(rows: np.ndarray, log: str) -> np.ndarray:
    with Path(log, "calls").open("a") as file:
        file.writelines(f"{row.tolist()}\n" for row in rows)
    return (rows**2).sum(axis=1) / 3


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def assert_same_bits(these: Sequence[xr.Dataset], those: Sequence[xr.Dataset]) -> None:
    assert len(these) == len(those)
    for one, other in zip(these, those, strict=True):
        assert one.identical(other) and one.attrs == other.attrs
        for name in one.variables:
            assert one[name].dtype == other[name].dtype
            assert one[name].dtype == object or one[name].values.tobytes() == other[name].values.tobytes()


@pytest.fixture(scope="module")
def spawned() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        yield pool


# The same bits, whoever computes them


def test_the_bits_are_the_same_here_in_threads_in_processes_and_again(tmp_path: Path, spawned: Executor) -> None:
    direct = [odd_bits(seed) for seed in range(6)]
    cells = odd_cells()
    with ThreadPoolExecutor(3) as threads:
        ways = {"here": None, "threads": threads, "processes": spawned}
        found = {way: run(cells, tmp_path / way, executor=executor) for way, executor in ways.items()}
        found |= {f"{way}, not kept": run(cells, executor=executor) for way, executor in ways.items()}
    found["again"] = run(cells, tmp_path / "here")
    for one in found.values():
        assert_same_bits(one, direct)
    assert contents(tmp_path / "here") == contents(tmp_path / "threads") == contents(tmp_path / "processes")


def test_a_kept_cell_is_netcdf_that_tells_what_it_depends_on(tmp_path: Path) -> None:
    (cell,) = odd_cells(1)
    run([cell], tmp_path)
    (path,) = tmp_path.iterdir()
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert json.loads(data.attrs["cell"])["settings"] == {"seed": 0}
        assert path.stem == cell.stem(data.attrs["cell"])


def test_a_users_object_travels_to_a_process_of_its_own(tmp_path: Path, spawned: Executor) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    tripod = importable(tmp_path / "mine.py").Tripod(2.0)
    cells = [Cell(f"{n} steps", of_object, {"controller": tripod, "n": n}) for n in (2, 3)]
    cells.append(Cell("its own", of_object, {"controller": importable(tmp_path / "mine.py").Tripod(3.0), "n": 4}))
    assert_same_bits(run(cells, tmp_path / "kept", executor=spawned), run(cells))


def test_a_cell_is_told_how_only_if_it_asks(spawned: Executor) -> None:
    cells = [Cell("asks", told_how, {"seed": 1}), Cell("does not", odd_bits, {"seed": 1})]
    assert run(cells)[0].threads == -1
    assert run(cells, threads=3)[0].threads == 3
    assert run(cells, executor=spawned)[0].threads == 1
    assert run(cells, executor=spawned, threads=2)[0].threads == 2


@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("pool", [True, False])
def test_progress_adds_up_to_one_by_shares_of_the_work(tmp_path: Path, kept: bool, pool: bool) -> None:
    cells = [Cell("small", told_how, {"seed": 0}), Cell("large", told_how, {"seed": 1}, work=3.0)]
    for again in (False, True):
        told: list[float] = []
        with ThreadPoolExecutor(1) as executor:
            run(cells, tmp_path if kept else None, executor=executor if pool else None, progress=told.append)
        assert sum(told) == pytest.approx(1.0)
        assert len(told) == (2 if pool or (kept and again) else 8)
        assert max(told) == pytest.approx(0.75 if len(told) == 2 else 0.1875)


# Nothing finished is lost, nothing damaged is believed


def test_nothing_finished_is_computed_again(tmp_path: Path, spawned: Executor) -> None:
    cells = counted_cells(tmp_path)
    run(cells[:3], tmp_path / "kept")
    run(cells, tmp_path / "kept", executor=spawned)
    again = run(cells[::-1], tmp_path / "kept")
    assert sorted(calls(tmp_path)) == [f"{i}" for i in range(6)]
    assert [float(one.number) for one in again] == [5.0, 4.0, 3.0, 2.0, 1.0, 0.0]


def test_a_damaged_or_foreign_cell_is_never_believed(tmp_path: Path) -> None:
    cell, other = odd_cells(2)
    run([cell, other], tmp_path)
    path, foreign = (tmp_path / f"{one.stem(one.record())}.nc" for one in (cell, other))
    good = path.read_bytes()
    draw = np.random.default_rng(0)
    damaged = [b"", good[:-1], good[: len(good) // 2], good + b" ", b"CDF\x01", foreign.read_bytes()]
    for where in draw.integers(len(good), size=40):
        damaged.append(good[:where] + bytes([good[where] ^ 1 << draw.integers(8)]) + good[where + 1 :])
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"{path.name} is .*; delete it, and it is made anew$"):
            run([cell], tmp_path)
    path.unlink()
    run([cell], tmp_path)
    assert path.read_bytes() == good


def test_an_error_cancels_what_has_not_begun_and_keeps_what_is_finished(tmp_path: Path) -> None:
    cells = [
        *counted_cells(tmp_path, 2),
        *counted_cells(tmp_path, 1, fails=True),
        *counted_cells(tmp_path, 50, wait=0.05),
    ]
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="cell 0 fails"):
        run(cells, tmp_path / "kept", executor=pool)
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
                run(cells, tmp_path / "kept", executor=pool, progress=stop)
        else:
            some = finish(cells, tmp_path / "kept", executor=pool)
            next(some)
            del some
    assert 1 <= len(contents(tmp_path / "kept")) == len(calls(tmp_path)) < 10


SWEEP = """
import sys
from pathlib import Path
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from hexmj.sweeps import run
from small_cells import counted_cells

if __name__ == "__main__":
    folder, log, workers = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    cells = counted_cells(log, 30, wait=0.03)
    if workers:
        with ProcessPoolExecutor(workers, mp_context=get_context("fork")) as pool:
            run(cells, folder, executor=pool)
    else:
        run(cells, folder)
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
        found = run(cells, folder, executor=pool)
    assert [float(one.number) for one in found] == list(range(30))
    assert before.items() <= contents(folder).items()
    assert len(calls(tmp_path)) <= 30 + max(1, workers)
    assert_same_bits(found, run(cells, tmp_path / "fresh", executor=ThreadPoolExecutor(30)))


@pytest.mark.slow
def test_two_sweeps_share_a_folder(tmp_path: Path) -> None:
    both = [sweep(tmp_path / "kept", tmp_path, workers) for workers in (0, 2)]
    assert [one.wait() for one in both] == [0, 0]
    assert len(contents(tmp_path / "kept")) == 30
    assert not list((tmp_path / "kept").glob(".part-*"))


def test_a_full_disk_is_one_sentence_and_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = counted_cells(tmp_path, 3)
    run(cells[:1], tmp_path / "kept")
    before = contents(tmp_path / "kept")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match=r"cannot be written: No space left on device$"):
        run(cells, tmp_path / "kept")
    assert contents(tmp_path / "kept") == before


def edits(path: str, text: str) -> xr.Dataset:
    Path(path).write_text(text)
    return xr.Dataset({"a": 1.0})


def test_a_file_that_is_edited_while_a_cell_is_computed_is_refused(tmp_path: Path) -> None:
    (data := tmp_path / "gains.toml").write_text("before")
    with pytest.raises(InputError, match="edits: path of settings was edited while it was in use; start again"):
        run([Cell("edits", edits, {"path": str(data), "text": "after"})], tmp_path / "kept")
    assert not list(tmp_path.rglob("*.nc"))
    assert len(run([Cell("edits", edits, {"path": str(data), "text": "after"})], tmp_path / "kept")) == 1


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
        run([cell], tmp_path / "kept", executor=Late())
    assert not list((tmp_path / "kept").iterdir())


LEVELS = pd.MultiIndex.from_tuples([(1, 2)], names=["b", "c"])


def odd(what: str) -> object:
    return {
        "dict": {},
        "nothing": None,
        "times": xr.Dataset({"a": ("x", np.arange(3).astype("m8[ns]"))}),
        "holes": xr.Dataset({"a": ("x", np.array(["a", None], dtype=object))}),
        "scaled": xr.Dataset({"a": ("x", [1.0], {"scale_factor": 0.5})}),
        "filled": xr.Dataset({"a": ("x", [1.0], {"_FillValue": 1.0})}),
        "levels": xr.Dataset(coords=xr.Coordinates.from_pandas_multiindex(LEVELS, "x")),
    }[what]


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("dict", "what odd gives = {}; expected a Dataset"),
        ("nothing", "what odd gives = None; expected a Dataset"),
        ("times", "NetCDF cannot hold this: a is timedelta64[ns]; expected arrays, numbers and texts"),
        ("holes", "NetCDF cannot hold this: a is object; expected arrays, numbers and texts"),
        ("scaled", "NetCDF would give other numbers: a has the attribute scale_factor; expected none"),
        ("filled", "NetCDF would give other numbers: a has the attribute _FillValue; expected none"),
        ("levels", "NetCDF cannot hold this: "),
    ],
)
def test_what_is_no_data_is_refused_in_one_sentence(tmp_path: Path, what: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        run([Cell("odd", odd, {"what": what})], tmp_path)
    assert not list(tmp_path.glob("*.nc"))


def shut() -> Executor:
    (executor := ThreadPoolExecutor(1)).shutdown()
    return executor


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: run([1]), "a cell = 1; expected a Cell"),  # pyright: ignore
        (lambda: run(None), "cells = None; expected a Sequence"),  # pyright: ignore
        (lambda: run(odd_cells(2), executor=shut()), "cannot schedule new futures after shutdown"),
        (lambda: Cell(None, odd, {}), "name = None; expected a text"),  # pyright: ignore
        (lambda: Cell("odd", odd, [1]), "settings = [1]; expected a Mapping"),  # pyright: ignore
        (lambda: Cell("odd", odd, {"nope": 3}), "settings of odd: got an unexpected keyword argument 'nope'"),
        (lambda: Cell("odd", odd, {}, work=-1), "work = -1.0 of odd; expected a finite number above 0"),
        (lambda: Cell("odd", 3, {}), "function = 3; expected a function"),  # pyright: ignore
        (lambda: over_axes({"a": 2}, 3 * [xr.Dataset()]), "the data of 3 cells along {'a': 2}; expected 2"),
        (lambda: over_axes({}, []), "the data of 0 cells along {}; expected 1"),
    ],
)
def test_sweeps_of_what_is_none_are_refused_in_one_sentence(ask: Callable[[], object], sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        ask()


def test_what_cannot_travel_is_refused_in_one_sentence(spawned: Executor) -> None:
    with pytest.raises(InputError, match="a cannot be sent to another process: "):
        run([Cell("a", lambda: xr.Dataset(), {})], executor=spawned)


# Axes and studies


@dataclass(frozen=True)
class Products:
    """A study in ten lines."""

    heights: tuple[float, ...] = (1.0, 2.0)
    speeds: tuple[float, ...] = (0.1, 0.2, 0.3)

    def cells(self) -> list[Cell]:
        return [
            Cell(f"{height:g}-{speed:g}", Wave(height).rows, {"shift": speed}, work=1 / speed)
            for height, speed in product(self.heights, self.speeds)
        ]

    def result(self, data: Sequence[xr.Dataset]) -> xr.Dataset:
        whole = over_axes({"height": len(self.heights), "speed": len(self.speeds)}, data)
        return whole.assign_coords(height=list(self.heights), speed=list(self.speeds))


def test_cells_stand_along_their_axes_in_order(tmp_path: Path) -> None:
    data = conduct(Products(), tmp_path)
    assert data.y.dims == ("height", "speed", "x")
    height, speed = data.height.values[:, None, None], data.speed.values[:, None]
    assert np.array_equal(data.y, height * np.arange(3.0) + speed)
    assert conduct(Products(), tmp_path).identical(data)
    assert len(contents(tmp_path)) == 6


# Files of a user's own


def test_a_file_is_loaded_once_until_it_is_edited(tmp_path: Path) -> None:
    mine = tmp_path / "mine [1]. ö.py"
    mine.write_text(MINE)
    first = importable(mine)
    assert importable(str(mine)) is first and first.__file__ == str(mine)
    mine.write_text(MINE + "\nWIDTH = 3")
    second = importable(mine)
    assert second is not first and second.WIDTH == 3 and not hasattr(first, "WIDTH")
    assert list(tmp_path.iterdir()) == [mine]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("import nonsense_9", "No module named"), ("def", "invalid syntax"), ("1 / 0", "by zero"), (None, "No such file")],
)
def test_a_file_that_does_not_load_is_refused_in_one_sentence(tmp_path: Path, text: str | None, sentence: str) -> None:
    if text is not None:
        (tmp_path / "mine.py").write_text(text)
    with pytest.raises(InputError, match=rf"mine\.py cannot be loaded: .*{sentence}"):
        importable(tmp_path / "mine.py")


# The evaluations of a search


def ledger(tmp_path: Path, folder: Path | None = None) -> KeptValues:
    return KeptValues(Cell("squares", squares, {"log": str(tmp_path)}), folder or tmp_path / "kept")


def test_a_ledger_computes_no_row_twice_and_gives_the_same_bits(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).standard_normal((20, 5))
    first = ledger(tmp_path)
    values = np.concatenate([first(rows[:7]), first(rows[[3, 8, 8, 9]])[1:], first(rows[10:])])
    direct = (rows**2).sum(axis=1) / 3
    assert values.tobytes() == direct[[*range(7), 8, 8, 9, *range(10, 20)]].tobytes()
    again = ledger(tmp_path)
    assert again.known == 19
    assert again(rows).tobytes() == direct.tobytes()
    assert len(calls(tmp_path)) == 20
    assert ledger(tmp_path).known == 20


def test_a_ledger_loses_at_most_a_line_that_is_not_whole(tmp_path: Path) -> None:
    rows = np.random.default_rng(2).standard_normal((6, 3))
    values = ledger(tmp_path)(rows)
    (path,) = (tmp_path / "kept").iterdir()
    good = path.read_bytes()
    begin = good.index(b"\n") + 1
    for size in range(begin, len(good), 13):
        path.write_bytes(good[:size])
        again = ledger(tmp_path)
        assert again.known == good[: size + 1].count(b"\n") - 1
        assert again(rows).tobytes() == values.tobytes()
        assert ledger(tmp_path).known == 6
    for where in range(begin, len(good), 7):
        path.write_bytes(good[:where] + bytes([good[where] ^ 4]) + good[where + 1 :])
        again = ledger(tmp_path)
        assert again.known >= 4
        assert again(rows).tobytes() == values.tobytes()


def test_a_ledger_believes_no_line_of_another_and_no_number_that_is_none(tmp_path: Path) -> None:
    ledger(tmp_path)(np.ones((2, 2)))
    (path,) = (tmp_path / "kept").iterdir()
    other = KeptValues(Cell("squares", squares, {"log": str(tmp_path.parent)}), tmp_path / "other")
    record, lines = path.read_text().split("\n", 1)
    row = np.ones(2).tobytes()
    for line in (
        *map(other._line, [row, row], [3.0, -1.0]),
        "zz 0x1p-1 00000000\n",
        "00\n",
        ledger(tmp_path)._line(row, np.nan),
    ):
        path.write_text(f"{record}\n{line}")
        assert ledger(tmp_path).known == 0
    path.write_text(f"{record}\n{lines}")
    assert ledger(tmp_path).known == 1


def test_a_ledger_of_another_search_is_refused(tmp_path: Path) -> None:
    ledger(tmp_path)(np.ones((2, 2)))
    (path,) = (tmp_path / "kept").iterdir()
    path.write_bytes(path.read_bytes().replace(b"squares", b"circles", 1))
    with pytest.raises(InputError, match="is damaged, or of another search"):
        ledger(tmp_path)


def test_ledgers_of_two_runs_share_a_file(tmp_path: Path) -> None:
    one, other = ledger(tmp_path), ledger(tmp_path)
    for n in range(5):
        one(np.full((3, 2), float(n)))
        other(np.full((3, 2), n + 0.5))
    assert ledger(tmp_path).known == 10
