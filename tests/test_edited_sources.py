"""Sources, and files of settings, that are edited while a program uses them: they count as they ran, or are refused."""

import ast
import gc
import json
import os
import py_compile
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.sweep import Cell, CachedValues, module_sources, packages
from hexmj.sweeps.code import code
from hexmj.user_code import parsing
from hexmj.user_code.loaded import importable
from small_cells import MINE, WITHOUT_DASK
from toy_project import write_toy


def test_a_source_that_was_edited_since_the_program_began_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    name, file = "hexmj.errors", module_sources.PACKAGE / "errors.py"
    monkeypatch.setitem(module_sources.AT_FIRST, str(file), 0)
    with pytest.raises(InputError, match=r"errors\.py was edited since this program began; start it again"):
        module_sources.read_module.__wrapped__(name, file)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_that_is_forked_while_a_source_is_parsed_parses_its_own() -> None:
    begun = Event()

    def parses() -> None:
        with parsing.alone():
            begun.set()
            time.sleep(0.3)

    def hears() -> None:
        parsing.parsed(b"1")
        sys.exit(("ignore", None, Warning, None, 0) in warnings.filters)

    with ThreadPoolExecutor(1) as threads:
        threads.submit(parses)
        begun.wait()
        child = get_context("fork").Process(target=hears)
        child.start()
    child.join(20)
    child.kill()
    assert child.exitcode == 0


@contextmanager
def somebody_parses() -> Iterator[None]:
    """A thread that reads literals all the while, and takes its turn amid what the collector calls, as in Dask's
    workers."""
    ended, limits, often = Event(), gc.get_threshold(), sys.getswitchinterval()

    def calls(*_: object) -> None:
        sum(range(30))

    def reads() -> None:
        while not ended.is_set():
            with suppress(SystemError):  # Python 3.11's; nobody but who reads can help it
                ast.literal_eval("[(1, 2), [3, (4, 5)]]")

    gc.callbacks.append(calls)
    gc.set_threshold(50)
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(1) as threads:
            threads.submit(reads)
            try:
                yield
            finally:
                ended.set()
    finally:
        gc.callbacks.remove(calls)
        gc.set_threshold(*limits)
        sys.setswitchinterval(often)


def test_what_others_parse_meanwhile_disturbs_nothing() -> None:
    """Python 3.11 counts the depth of all that threads parse at once as that of one."""
    source = (module_sources.PACKAGE / "sweeps" / "packages.py").read_bytes()
    with somebody_parses():
        for _ in range(50):
            parsing.parsed(source)
            packages._requirement('numpy>=1; python_version < "4" and (extra == "one" or extra == "two")')
    assert gc.isenabled()


USED = """
import sys
from pathlib import Path
import used, controller
from hexmj.sweep import Cell
from toy.study import cell

def record():
    return Cell("toy", cell, {"controller": controller.Tripod()}).record()

first = record() if sys.argv[1] != "edit" else ""
Path("used.py").write_text("GAIN = 5.0")
if sys.argv[1] == "again":
    import importlib
    importlib.reload(used)
print(record())
assert first in ("", record())
"""


def used_record(folder: Path, how: str) -> subprocess.CompletedProcess[str]:
    (folder / "used.py").write_text("GAIN = 0.5")
    (folder / "controller.py").write_text("import used\n" + MINE)
    command = [sys.executable, "-B", "-c", USED, how]
    return subprocess.run(command, cwd=folder, env=WITHOUT_DASK, capture_output=True, text=True)


def test_a_module_that_was_edited_as_it_was_used_counts_as_it_ran(tmp_path: Path) -> None:
    """Whether the file was edited before the first record or after; run again, no one knows which is meant."""
    write_toy(tmp_path)
    unedited, edited, again = (used_record(tmp_path, how) for how in ("record", "edit", "again"))
    assert unedited.returncode == edited.returncode == 0, edited.stderr
    assert json.loads(unedited.stdout) == json.loads(edited.stdout)
    assert "used.py was edited while this program used it; start it again" in again.stderr


LATE = """
from pathlib import Path
from hexmj.sweep import Cell, run_cells
import late_cells
late_cells.record()
Path("helper.py").write_text("GAIN = 7.0")
run([Cell("late", late_cells.cell, {})], Path("kept"))
"""


@pytest.mark.slow
def test_a_module_that_is_edited_before_a_cell_imports_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "helper.py").write_text("GAIN = 1.0")
    (tmp_path / "late_cells.py").write_text(
        "import xarray as xr\nfrom hexmj.sweeps import Cell\n"
        "def cell():\n    import helper\n    return xr.Dataset({'a': helper.GAIN})\n"
        "def record(): return Cell('late', cell, {}).record()"
    )
    command = [sys.executable, "-c", LATE]
    done = subprocess.run(command, cwd=tmp_path, env=WITHOUT_DASK, capture_output=True, text=True)
    assert "helper.py was edited while this program used it; start it again" in done.stderr
    assert not list(tmp_path.rglob("*.nc"))


FOUND_LATE = """
from pathlib import Path
from hexmj.sweep import Cell, run_cells
import late_cells
run([Cell("late", late_cells.cell, {})], Path("kept"))
"""


@pytest.mark.slow
def test_a_module_that_is_found_only_as_a_cell_is_computed_is_refused(tmp_path: Path) -> None:
    """No name that was made before can tell what it holds."""
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "helper.py").write_text("GAIN = 1.0")
    (tmp_path / "late_cells.py").write_text(
        "import sys\nimport xarray as xr\n"
        "def cell():\n    sys.path.insert(0, 'lib')\n    import helper\n    return xr.Dataset({'a': helper.GAIN})\n"
    )
    command = [sys.executable, "-c", FOUND_LATE]
    done = subprocess.run(command, cwd=tmp_path, env=WITHOUT_DASK, capture_output=True, text=True)
    assert "late: helper of sources has changed while it was in use" in done.stderr
    assert not list(tmp_path.rglob("*.nc"))


STALE = """
import sys
if sys.argv[1] == "before": import stale
from hexmj.sweep import Cell
import stale
from toy.study import cell
print(Cell("toy", cell, {"controller": stale.Tripod()}).record())
"""


@pytest.mark.parametrize("when", ["before", "after"])
def test_bytecode_of_another_source_is_refused(tmp_path: Path, when: str) -> None:
    """Python knows it by its time and size alone; whether the module ran before the package was imported or after."""
    write_toy(tmp_path)
    environment = {name: value for name, value in WITHOUT_DASK.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command, ended = [sys.executable, "-c", STALE, when], []
    for gain in ("12.0", "01.0"):
        (tmp_path / "stale.py").write_text(f"{MINE}GAIN = {gain}")
        os.utime(tmp_path / "stale.py", (1e9, 1e9))
        ended.append(subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True))
    assert json.loads(ended[0].stdout), ended[0].stderr
    assert "stale.py ran as " in ended[1].stderr
    assert ended[1].stderr.endswith(".pyc keeps it, not as it is; delete that and start again\n")


SOUND = """
import sys
from hexmj.user_code.loaded import importable
from hexmj.sweep import Cell
import sound
print(Cell("sound", sound.cell, {"controller": importable("mine.py").Tripod()}).record())
"""


@pytest.mark.parametrize("how", [{}, {"PYTHONNODEBUGRANGES": "1"}])
def test_bytecode_that_does_what_its_source_says_is_not_refused(tmp_path: Path, how: dict[str, str]) -> None:
    """With a NaN, which is unequal to itself, and a set, whatever its order; made with columns of lines or without."""
    text = "NAN = 1e999 - 1e999\nKNOWN = 'a' in {'a', 'b', 'c', 'd'}\ndef cell(controller): ..."
    (tmp_path / "sound.py").write_text(text)
    (tmp_path / "mine.py").write_text(MINE)
    environment = {name: value for name, value in WITHOUT_DASK.items() if name != "PYTHONDONTWRITEBYTECODE"}
    for more in (how, {}):
        command = [sys.executable, "-c", SOUND]
        done = subprocess.run(command, cwd=tmp_path, env=environment | more, capture_output=True, text=True)
        assert "sound" in json.loads(done.stdout)["sources"], done.stderr
    assert list(tmp_path.glob("__pycache__/sound.*.pyc"))


def test_stale_bytecode_beside_a_file_that_runs_from_its_source_is_not_refused(tmp_path: Path) -> None:
    for gain in ("12.0", "01.0"):
        (tmp_path / "mine.py").write_text(f"{MINE}GAIN = {gain}")
        os.utime(tmp_path / "mine.py", (1e9, 1e9))
        if gain == "12.0":
            py_compile.compile(str(tmp_path / "mine.py"))
    made = code(frozenset({importable(tmp_path / "mine.py").__name__}))
    assert [name for name in made.sources if name.startswith("mine.py@")]


def edited_rows(rows: np.ndarray, data: str) -> np.ndarray:
    Path(data).write_text("after")
    return rows.sum(axis=1)


def test_evaluations_during_which_a_file_is_edited_are_not_kept(tmp_path: Path) -> None:
    (data := tmp_path / "gains.toml").write_text("before")
    values = CachedValues(Cell("rows", edited_rows, {"data": str(data)}), tmp_path / "kept")
    with pytest.raises(InputError, match="rows: data of settings has changed while it was in use; start again"):
        values(np.eye(2))
    assert CachedValues(Cell("rows", edited_rows, {"data": str(data)}), tmp_path / "kept").known == 0
