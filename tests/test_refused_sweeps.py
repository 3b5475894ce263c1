"""Cells and sweeps that make no sense, and data that no file can hold, are refused in one sentence."""

import os
import re
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.sweep import Cell, over_axes, run_cells
from small_cells import odd_cells

LEVELS = pd.MultiIndex.from_tuples([(1, 2)], names=["b", "c"])


def odd(what: str) -> object:
    return {
        "dict": {},
        "nothing": None,
        "times": xr.Dataset({"a": ("x", np.arange(3).astype("m8[ns]"))}),
        "holes": xr.Dataset({"a": ("x", np.array(["a", None], dtype=object))}),
        "scaled": xr.Dataset({"a": ("x", [1.0], {"scale_factor": 0.5})}),
        "filled": xr.Dataset({"a": ("x", [1.0], {"_FillValue": 1.0})}),
        "kept": xr.Dataset({"a": 1.0}, attrs={"cell": "mine"}),
        "levels": xr.Dataset(coords=xr.Coordinates.from_pandas_multiindex(LEVELS, "x")),
    }[what]


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("dict", "what odd gives = {}; expected a Dataset"),
        ("nothing", "what odd gives = None; expected a Dataset"),
        ("times", "NetCDF cannot hold this: a is timedelta64[ns]; expected arrays, numbers and texts"),
        ("holes", "NetCDF cannot hold this: a is object; expected arrays, numbers and texts"),
        ("scaled", "NetCDF would be read otherwise: a has the attribute scale_factor; expected none"),
        ("filled", "NetCDF would be read otherwise: a has the attribute _FillValue; expected none"),
        ("kept", "what odd gives has the attribute 'cell', which kept cells have; rename it"),
        ("levels", "NetCDF cannot hold this: "),
    ],
)
def test_what_is_no_data_is_refused_in_one_sentence(tmp_path: Path, what: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        run_cells([Cell("odd", odd, {"what": what})], tmp_path)
    assert not list(tmp_path.glob("*.nc"))


def odd_elsewhere(what: str) -> object:
    """Goes by the name of `odd`, as `functools.wraps` makes it."""
    return odd(what)


odd_elsewhere = wraps(odd)(odd_elsewhere)


def test_a_wrapper_that_goes_by_the_name_of_what_it_wraps_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="odd is not what its module has under that name"):
        run_cells([Cell("odd", odd_elsewhere, {"what": "dict"})], tmp_path)


def test_a_cell_may_change_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("data").mkdir()
    cells = [Cell(f"goes {i}", goes, {"folder": str(tmp_path / "data"), "i": i}) for i in range(2)]
    run_cells(cells, Path("kept"))
    assert len(list((tmp_path / "kept").glob("*.nc"))) == 2


def goes(folder: str, i: int) -> xr.Dataset:
    os.chdir(folder)
    return xr.Dataset({"i": i})


def shut() -> Executor:
    (executor := ThreadPoolExecutor(1)).shutdown()
    return executor


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: run_cells([1]), "a cell = 1; expected a Cell"),  # pyright: ignore
        (lambda: run_cells(None), "cells = None; expected a Sequence"),  # pyright: ignore
        (lambda: run_cells(odd_cells(2), executor=shut()), "cannot schedule new futures after shutdown"),
        (lambda: Cell(None, odd, {}), "name = None; expected a text"),  # pyright: ignore
        (lambda: Cell("odd", odd, [1]), "settings = [1]; expected a dict"),  # pyright: ignore
        (lambda: Cell("odd", odd, {"nope": 3}), "settings of odd: got an unexpected keyword argument 'nope'"),
        (
            lambda: Cell("odd", max, {}),
            "the function of odd: no signature found for builtin <built-in function max>; expected one",
        ),
        (lambda: Cell("odd", odd, {}, work=-1), "work = -1.0 of odd; expected a finite number above 0"),
        (lambda: Cell("odd", 3, {}), "function = 3; expected a function"),  # pyright: ignore
        (lambda: over_axes({"a": 2}, 3 * [xr.Dataset()]), "the data of 3 cells along {'a': 2}; expected 2"),
        (lambda: over_axes({}, []), "the data of 0 cells along {}; expected 1"),
        (
            lambda: over_axes({"a": 1}, [xr.Dataset(coords={"a": [1]})]),
            "axis 'a' of cells, whose data have one of that",
        ),
    ],
)
def test_sweeps_of_what_is_none_are_refused_in_one_sentence(ask: Callable[[], object], sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)):
        ask()


@pytest.mark.parametrize("what", ["a file", "a link to nothing"])
def test_a_folder_that_is_none_is_a_sentence(tmp_path: Path, what: str) -> None:
    kept = tmp_path / "kept"
    kept.write_text("") if what == "a file" else kept.symlink_to("nowhere")
    with pytest.raises(InputError, match="kept is a file, or a link to nothing; expected a folder"):
        hexmj.flss(hexmj.LDVS, 0.5, n_starts=2, observation_time=1.0, folder=kept)


@dataclass(frozen=True)
class Remembers:
    """A controller that keeps something beside its fields once it plans."""

    name: str = "remembers"

    def begin(self, *given: Any, **how: Any) -> Any:
        object.__setattr__(self, "table", 1.0)
        return hexmj.LDVS.begin(*given, **how)


@pytest.mark.parametrize("keeps", [True, False])
def test_a_setting_that_comes_about_is_refused(tmp_path: Path, keeps: bool) -> None:
    with pytest.raises(InputError, match="Remembers keeps 'table' beside its fields; expected all settings as fields"):
        hexmj.flss(Remembers(), 0.5, n_starts=2, observation_time=1.0, folder=tmp_path / "kept" if keeps else None)
