"""What a kept cell is named by: its settings, and the code within reach."""

import importlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hexmj.storage.files import digest_of
from hexmj.sweeps.code import code
from hexmj.user_code.loaded import importable

import hexmj
from hexmj.controllers.cruse1998 import presets
from hexmj.errors import InputError
from hexmj.sweep import Cell
from small_cells import MINE, WITHOUT_DASK, Wave, odd_bits, told_how
from toy_project import TOY, toy_record, write_toy


def test_every_setting_is_in_the_name() -> None:
    cells = [
        Cell("a", odd_bits, {"seed": 0}),
        Cell("a", odd_bits, {"seed": 1}),
        Cell("a", odd_bits, {"seed": 0, "size": 5}),
        Cell("a", told_how, {"seed": 0}),
        Cell("a", Wave().rows, {"shift": 0.0}),
        Cell("a", Wave(2.0).rows, {"shift": 0.0}),
        Cell("a", Wave(1.0, np.arange(4.0)).rows, {"shift": 0.0}),
    ]
    assert len({cell.stem(cell.record()) for cell in cells}) == len(cells)
    assert Cell("a", odd_bits, {"seed": 0}, work=9.0).record() == cells[0].record()


def test_a_cell_refuses_what_no_name_can_tell() -> None:
    with pytest.raises(InputError, match="'threads' of a; expected it to be left to the sweep"):
        Cell("a", told_how, {"seed": 0, "threads": 2})
    with pytest.raises(InputError, match="stands inside a function"):
        Cell("a", lambda: xr.Dataset(), {}).record()


@pytest.mark.slow
def test_what_was_typed_in_cannot_be_kept(tmp_path: Path) -> None:
    typed = "import xarray; from hexmj.sweeps import *; from pathlib import Path\n"
    typed += "def f(): return xarray.Dataset()\nrun([Cell('a', f, {})]); run([Cell('a', f, {})], Path('kept'))"
    command = [sys.executable, "-c", typed]
    ended = subprocess.run(command, cwd=tmp_path, env=WITHOUT_DASK, capture_output=True, text=True)
    assert ended.stderr.endswith("write it into a file\n") and "__main__ has no source" in ended.stderr


def test_any_name_becomes_a_name_of_a_file() -> None:
    for name in ("step 2 mm", "../../etc", ".hidden", "x" * 1000, "ö/$$ [red]\n"):
        stem = (cell := Cell(name, odd_bits, {"seed": 0})).stem(cell.record())
        assert Path(stem).name == stem and len(stem) < 120 and stem.isascii() and not stem.startswith(".")


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    return write_toy(tmp_path)


@pytest.fixture(scope="module")
def unedited(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The record of the same code in another folder."""
    return toy_record(write_toy(tmp_path_factory.mktemp("toy")))


def test_the_name_is_of_the_code_within_reach_and_no_other(toy: Path, unedited: str) -> None:
    record = json.loads(unedited)
    within = {"toy", "toy.study", "toy.walk", "toy.louder", "toy.inner", "toy.inner.deep", "toy.inner.deeper"} | {
        *("helper", "bare.helper", "bare.deep.other", "fast", "gaits", "gaits.wave", "gaits.never"),
        *("whole", "whole.part", "whole.part.deep"),
    }
    mine = {name for name in record["sources"] if name.partition(".")[0] in {one.partition(".")[0] for one in within}}
    assert mine == within
    assert [name.rpartition("@")[2][12:] for name in record["sources"] if name.startswith("mine.py@")] == [""]
    assert set(record["versions"]) == {"python", "numpy", "scipy"}
    for name in ("toy/film.py", "toy/cli.py"):
        (toy / name).write_text(TOY[name] + "\n# edited")
    assert toy_record(toy) == unedited


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        *("toy/__init__.py", "toy/study.py", "toy/louder.py", "toy/inner/__init__.py", "toy/inner/deeper.py"),
        *("mine.py", "helper.py", "bare/helper.py", "bare/deep/other.py", "fast.pyc"),
        *("gaits/wave.py", "whole/part/deep.py"),
    ],
)
def test_an_edit_within_reach_is_another_name(toy: Path, unedited: str, name: str) -> None:
    (toy / name).write_text(TOY[name] + "\n# edited")
    assert toy_record(toy) != unedited


def test_a_helper_with_the_name_of_one_of_pythons_own_counts(toy: Path) -> None:
    (toy / "mine.py").write_text("import profile\n" + TOY["mine.py"])
    found = []
    for text in ("GAIN = 1", "GAIN = 2"):
        (toy / "profile.py").write_text(text)
        found.append(json.loads(toy_record(toy))["sources"])
    assert found[0].pop("profile") != found[1].pop("profile")
    assert found[0] == found[1]


def test_a_controllers_module_may_import_the_program_that_runs_it(tmp_path: Path) -> None:
    """In which none has a file where it is typed in, or a spec."""
    (tmp_path / "mine.py").write_text("import __main__\n")
    typed = "from hexmj.sweeps.code import code; print(code(frozenset({'mine'})).versions.keys())"
    done = subprocess.run([sys.executable, "-c", typed], env=WITHOUT_DASK, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "dict_keys(['python'])\n", done.stderr


PRINT_MAIN = """
from hexmj.sweep import Cell
from toy.study import cell
print(Cell("toy", cell, {"controller": Tripod()}).record())
"""


def test_a_script_that_runs_as_a_module_counts_what_it_imports(toy: Path) -> None:
    (toy / "toy" / "run.py").write_text("from . import louder\n" + MINE + "\n" + PRINT_MAIN)
    command = [sys.executable, "-m", "toy.run"]
    done = subprocess.run(command, cwd=toy, env=WITHOUT_DASK, capture_output=True, text=True)
    assert {"run.py", "toy", "toy.louder"} <= set(json.loads(done.stdout)["sources"]), done.stderr


def test_a_script_of_any_name_counts_what_it_imports(toy: Path) -> None:
    (toy / "script").write_text("import helper\n" + MINE + "\n" + PRINT_MAIN)
    done = subprocess.run([sys.executable, "script"], cwd=toy, env=WITHOUT_DASK, capture_output=True, text=True)
    assert {"script", "helper"} <= set(json.loads(done.stdout)["sources"]), done.stderr


@pytest.mark.parametrize("text", ["importlib.import_module('helper')", "__import__('helper')"])
def test_a_module_that_a_call_imports_counts(toy: Path, text: str) -> None:
    (toy / "mine.py").write_text(f"def steps(): return {text}\n" + MINE)
    assert "helper" in json.loads(toy_record(toy))["sources"]


def test_the_package_knows_its_own_reach() -> None:
    made = code(frozenset({"hexmj.stability"}))
    assert {"hexmj.stability", "hexmj.legs"} <= set(made.sources)
    assert not [name for name in made.sources if "film" in name or "cli" in name or "sweeps" in name]
    assert "numba" in made.versions and "llvmlite" in made.versions and "xarray" not in made.versions


@pytest.mark.parametrize(
    ("module", "file"),
    [("controllers.cruse1998.presets", presets.OWN), ("body", hexmj.STICK_INSECT.mjcf)],
)
def test_the_packages_own_data_count(module: str, file: Path) -> None:
    made = code(frozenset({f"hexmj.{module}"}))
    assert made.sources[f"hexmj.{module}, {file.name}"] == digest_of(file)


@pytest.mark.parametrize("text", ["from hexmj import loss_time", "import hexmj"])
def test_a_name_that_the_package_loads_as_it_is_used_is_followed_home(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.py").write_text(text)
    made = code(frozenset({importable(tmp_path / "mine.py").__name__}))
    assert {"hexmj", "hexmj.stability", "hexmj.legs"} <= set(made.sources)
    assert (text == "import hexmj") == any("film" in name for name in made.sources)


@pytest.mark.parametrize("content", [b"# -*- coding: latin-1 -*-\n# \xdf", b"\xef\xbb\xbf# with a mark"])
def test_a_source_counts_in_any_encoding_that_python_reads(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "mine.py").write_bytes(content + b"\nimport numpy")
    assert "numpy" in code(frozenset({importable(tmp_path / "mine.py").__name__})).versions


def test_what_carries_our_numbers_may_compute_a_users(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("import hexmj.measures.kinematic\nfrom matplotlib.path import Path")
    versions = code(frozenset({importable(tmp_path / "mine.py").__name__})).versions
    assert "matplotlib" in versions and "xarray" not in versions


def test_a_source_in_an_archive_is_refused_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with zipfile.ZipFile(tmp_path / "lib.zip", "w") as archive:
        archive.writestr("zipped_controller.py", MINE)
    monkeypatch.syspath_prepend(tmp_path / "lib.zip")
    importlib.import_module("zipped_controller")
    with pytest.raises(InputError, match=r"zipped_controller\.py cannot be read: Not a directory; expected sources as"):
        code(frozenset({"zipped_controller"}))
