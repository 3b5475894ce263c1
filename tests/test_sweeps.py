"""A sweep's cells have the same bits whoever computes them, are computed once, and stand along their axes."""

import gc
import weakref
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hexmj.user_code.loaded import importable

from hexmj.errors import InputError
from hexmj.sweep import Cell, finished_cells, over_axes, run_cells, run_study
from left_by_cells import calls, contents
from small_cells import (
    MINE,
    OfALeg,
    Wave,
    assert_same_bits,
    counted_cells,
    odd_bits,
    odd_cells,
    of_object,
    slips,
    told_how,
)


@pytest.fixture(scope="module")
def spawned() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        yield pool


@pytest.mark.slow
def test_the_bits_are_the_same_here_in_threads_in_processes_and_again(tmp_path: Path, spawned: Executor) -> None:
    direct = [odd_bits(seed) for seed in range(6)]
    cells = odd_cells()
    with ThreadPoolExecutor(3) as threads:
        ways = {"here": None, "threads": threads, "processes": spawned}
        found = {way: run_cells(cells, tmp_path / way, executor=executor) for way, executor in ways.items()}
        found |= {f"{way}, not kept": run_cells(cells, executor=executor) for way, executor in ways.items()}
    found["again"] = run_cells(cells, tmp_path / "here")
    for one in found.values():
        assert_same_bits(one, direct)
    assert contents(tmp_path / "here") == contents(tmp_path / "threads") == contents(tmp_path / "processes")


@pytest.mark.slow
def test_a_users_object_travels_to_a_process_of_its_own(tmp_path: Path, spawned: Executor) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    tripod = importable(tmp_path / "mine.py").Tripod(2.0)
    cells = [Cell(f"{n} steps", of_object, {"controller": tripod, "n": n}) for n in (2, 3)]
    cells.append(Cell("its own", of_object, {"controller": importable(tmp_path / "mine.py").Tripod(3.0), "n": 4}))
    assert_same_bits(run_cells(cells, tmp_path / "kept", executor=spawned), run_cells(cells))


def test_what_a_caller_throws_away_nobody_holds() -> None:
    with ThreadPoolExecutor(1) as executor:
        held = list[weakref.ref[xr.Dataset]]()
        for _, data in finished_cells(odd_cells(), executor=executor):
            held.append(weakref.ref(data))
            del data
            gc.collect()
            assert not any(one() is not None for one in held[:-1])
    assert len(held) == 6


def test_what_cannot_travel_is_refused_in_one_sentence(spawned: Executor) -> None:
    with pytest.raises(InputError, match="a cannot be sent to another process: "):
        run_cells([Cell("a", lambda: xr.Dataset(), {})], executor=spawned)


def test_what_a_worker_s_error_tells_is_told(spawned: Executor) -> None:
    with pytest.raises(RuntimeError, match=r"^OfALeg: leg 3 slips$"):
        run_cells([Cell("slips", slips, {"leg": 3})], executor=spawned)
    with ThreadPoolExecutor(1) as threads, pytest.raises(OfALeg):
        run_cells([Cell("slips", slips, {"leg": 3})], executor=threads)


def test_a_cell_is_told_how_only_if_it_asks(spawned: Executor) -> None:
    cells = [Cell("asks", told_how, {"seed": 1}), Cell("does not", odd_bits, {"seed": 1})]
    assert run_cells(cells)[0].threads == -1
    assert run_cells(cells, threads=3)[0].threads == 3
    assert run_cells(cells, executor=spawned)[0].threads == 1
    assert run_cells(cells, executor=spawned, threads=2)[0].threads == 2


@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("pool", [True, False])
def test_progress_adds_up_to_one_by_shares_of_the_work(tmp_path: Path, kept: bool, pool: bool) -> None:
    cells = [Cell("small", told_how, {"seed": 0}), Cell("large", told_how, {"seed": 1}, work=3.0)]
    for again in (False, True):
        told: list[float] = []
        with ThreadPoolExecutor(1) as executor:
            run_cells(cells, tmp_path if kept else None, executor=executor if pool else None, progress=told.append)
        assert sum(told) == pytest.approx(1.0)
        assert len(told) == (2 if pool or (kept and again) else 8)
        assert max(told) == pytest.approx(0.75 if len(told) == 2 else 0.1875)


def test_nothing_finished_is_computed_again(tmp_path: Path, spawned: Executor) -> None:
    cells = counted_cells(tmp_path)
    run_cells(cells[:3], tmp_path / "kept")
    run_cells(cells, tmp_path / "kept", executor=spawned)
    again = run_cells(cells[::-1], tmp_path / "kept")
    assert sorted(calls(tmp_path)) == [f"{i}" for i in range(6)]
    assert [float(one.number) for one in again] == [5.0, 4.0, 3.0, 2.0, 1.0, 0.0]


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


@pytest.mark.slow
def test_cells_stand_along_their_axes_in_order(tmp_path: Path) -> None:
    data = run_study(Products(), tmp_path)
    assert data.y.dims == ("height", "speed", "x")
    height, speed = data.height.values[:, None, None], data.speed.values[:, None]
    assert np.array_equal(data.y, height * np.arange(3.0) + speed)
    assert run_study(Products(), tmp_path).identical(data)
    assert len(contents(tmp_path)) == 6
