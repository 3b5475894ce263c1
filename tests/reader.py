"""A user's file whose cell reads a gain in one of many ways, and what was kept of it."""

import io
import json
import os
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.storage.files import read_sealed
from hexmj.sweep import Cell, run_cells
from hexmj.user_code import opened_files
from hexmj.user_code.loaded import importable

READER = """
import functools, json, os, runpy, shutil, sqlite3, tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from glob import glob
from pathlib import Path

import hexmj
import numpy as np
import xarray as xr

@functools.cache
def remembered(path):
    return float(Path(path).read_text())

def tried(path):
    try:
        return float(Path(path).read_text())
    except OSError:
        return 0.0

def logged(log, text):
    with log.open("a") as file:
        file.write(text)
    return 1.0

def made_or_read(memo):
    try:
        memo.open("x").close()
    except FileExistsError:
        pass
    return float(memo.read_text())

@dataclass(frozen=True)
class Inner:
    file: str = ""
    def cell(self):
        return xr.Dataset({{"gain": float(Path("one/gain").read_text())}})
    def value(self, rows):
        return rows[:, 0] * float(Path("one/gain").read_text())
    def of(self, body):
        return xr.Dataset()

@dataclass(frozen=True)
class Reader:
    at: str = "one"
    file: str = ""
    @functools.cached_property
    def known(self):
        return float(Path(self.at, "gain").read_text())
    def cell(self):
        at = self.at
        with open("calls", "a") as file:
            file.write(".")
        return xr.Dataset({{"gain": {gain}}})
    def value(self, rows):
        return rows[:, 0] * {gain}
"""


def write_all(gain: str, at: str = "one") -> None:
    """Into every file of the folder."""
    Path(at, "gain").write_text(gain)
    Path(at, "gain.json").write_text(gain)
    Path(at, "gain.py").write_text(f"GAIN = {gain}")
    np.save(Path(at, "gain.npy"), float(gain))
    np.array([float(gain)]).tofile(Path(at, "gain.bin"))
    for name in ("gain.db", "a gain.db"):
        Path(at, name).unlink(missing_ok=True)
        with closing(sqlite3.connect(Path(at, name))) as data, data:
            data.executescript(f"create table told (gain); insert into told values ({gain})")
    hexmj.save(xr.Dataset({"gain": float(gain)}), Path(at, "gain.nc"))


def another_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has opened nothing so far, and remembers nothing."""
    monkeypatch.setattr(opened_files, "_AT_FIRST", {})
    monkeypatch.setattr(opened_files, "_OPENED", {})
    monkeypatch.setattr(opened_files, "_DOUBTS", {})
    sys.modules.pop(importable("reader.py").__name__)


def what_was_read(name: str = "*.nc") -> set[str]:
    """Files that the one kept cell of such a name tells, from here."""
    (kept,) = Path("kept").glob(name)
    with h5netcdf.File(io.BytesIO(read_sealed(kept) or b"")) as file:
        return {os.path.relpath(one) for one in json.loads(str(file.attrs.get("read", "{}")))} - {"."}


@pytest.fixture
def computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[float, int]]:
    """The gain that a cell reads in `at`, by a piece of Python, and how often cells were computed so far."""
    monkeypatch.chdir(tmp_path)
    for at, gain in (("one", "1.0"), ("two", "2.0")):
        (tmp_path / at / "inner").mkdir(parents=True)
        write_all(gain, at)

    Path("leads").symlink_to("one/inner")

    def computed(gain: str, file: str = "", **how: object) -> tuple[float, int]:
        (tmp_path / "reader.py").write_text(READER.format(gain=gain))
        cell = Cell("reader", importable("reader.py").Reader(file=file).cell, {})
        data = run_cells([cell], Path("kept"), **how)[0]  # pyright: ignore[reportArgumentType]
        return float(data.gain), os.stat("calls").st_size

    return computed
