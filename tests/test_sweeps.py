"""Laws of sweeps: a name tells what a cell depends on, its bits are the same anywhere, and nothing kept is lost."""

import importlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import InitVar, dataclass, field
from functools import cached_property
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.loaded import importable
from hexmj.progress import Progress
from hexmj.sweeps import Cell, KeptValues, conduct, finish, over_axes, run
from hexmj.sweeps import code as sources
from hexmj.sweeps.code import code
from hexmj.sweeps.plain import plain
from hexmj.timing import Stride

PATHS = ".", *(str(folder) for folder in Path(__file__).parents[:2])
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(PATHS)}

MINE = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Tripod:
    rate: float = 1.0

    def steps(self, n):
        return [self.rate * i for i in range(n)]
"""


@dataclass(frozen=True)
class Wave:
    """A setting with a method that can be a cell's function."""

    slope: float = 1.0
    values: np.ndarray = field(default_factory=lambda: np.arange(3.0))

    def rows(self, shift: float) -> xr.Dataset:
        return xr.Dataset({"y": ("x", self.slope * self.values + shift)})


def odd_bits(seed: int, size: int = 4) -> xr.Dataset:
    """Numbers whose bits are easily lost on the way: signs of NaN and 0, subnormals, bool, text, no rows at all."""
    draw = np.random.default_rng(seed).standard_normal(size)
    special = np.array([-np.nan, np.nan, -0.0, 5e-324, np.inf, 0.1 + 0.2])
    return xr.Dataset(
        {
            "draw": ("start", draw, {"units": "s"}),
            "special": ("bit", np.copysign(special, [-1, 1, -1, 1, -1, 1])),
            "fell": ("start", draw > 0),
            "count": ("start", np.arange(size, dtype=np.int8)),
            "none": ("nothing", np.empty(0)),
        },
        {"leg": ["R1", "L1"]},
        {"told": "as it was"},
    )


def counted(log: str, number: int, wait: float = 0.0, fails: bool = False) -> xr.Dataset:
    """Writes into a log that it was computed."""
    time.sleep(wait)
    if fails:
        raise ValueError(f"cell {number} fails")
    with Path(log, "calls").open("a") as file:
        file.write(f"{number}\n")
    return xr.Dataset({"number": float(number)})


def told_how(seed: int, threads: int | None = 7, progress: Progress | None = None) -> xr.Dataset:
    for _ in range(3 if progress else 0):
        assert progress
        progress(0.25)
    return xr.Dataset({"threads": -1 if threads is None else threads, "seed": seed})


def of_object(controller: object, n: int) -> xr.Dataset:
    return xr.Dataset({"steps": ("step", controller.steps(n))})  # pyright: ignore[reportAttributeAccessIssue]


def squares(rows: np.ndarray, log: str) -> np.ndarray:
    with Path(log, "calls").open("a") as file:
        file.writelines(f"{row.tolist()}\n" for row in rows)
    return (rows**2).sum(axis=1) / 3


def odd_cells(n: int = 6) -> list[Cell]:
    return [Cell(f"seed {seed}", odd_bits, {"seed": seed}) for seed in range(n)]


def counted_cells(log: Path, n: int = 6, **settings: object) -> list[Cell]:
    return [Cell(f"number {i}", counted, {"log": str(log), "number": i} | settings) for i in range(n)]


def calls(log: Path) -> list[str]:
    return (log / "calls").read_text().split("\n")[:-1] if (log / "calls").exists() else []


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


# What a cell is named by


def test_settings_become_plain_json() -> None:
    settings = {
        "wave": Wave(2.0, np.array([[1.0, -0.0]])),
        "pair": (1, None, True, "text"),
        "number": np.float64(0.1),
        "inner": {"folder": Path("/nowhere"), "counts": np.arange(2)},
    }
    assert plain(settings) == {
        "wave": {"class": "test_sweeps.Wave", "slope": 2.0, "values": [[1.0, -0.0]]},
        "pair": [1, None, True, "text"],
        "number": 0.1,
        "inner": {"folder": "/nowhere", "counts": [0, 1]},
    }
    assert json.loads(json.dumps(plain(settings))) == plain(settings)


@pytest.mark.parametrize(
    "value", [{1, 2}, object(), np.float32(1.0), np.array([object()]), {1: 2}, len, Wave, 1j, Path()]
)
def test_what_is_no_setting_is_refused_in_one_sentence(value: object) -> None:
    with pytest.raises(InputError, match="is no setting; expected") as raised:
        plain({"inner": (value,)})
    assert "\n" not in str(raised.value)


@dataclass(frozen=True)
class Hidden:
    """With a setting that is no field, and something computed once."""

    pull: InitVar[float] = 1.0
    name: str = "hidden"

    def __post_init__(self, pull: float) -> None:
        assert self.doubled == 2
        object.__setattr__(self, "kept", pull)

    @cached_property
    def doubled(self) -> int:
        return 2


def test_a_setting_that_no_field_tells_is_refused() -> None:
    with pytest.raises(InputError, match=r"Hidden keeps 'kept' beside its fields; expected all settings as fields"):
        plain(Hidden())


def test_a_file_among_the_settings_is_its_content(tmp_path: Path) -> None:
    for kind in (Path, str):
        for folder in ("here", "there"):
            (tmp_path / folder).mkdir(exist_ok=True)
            (tmp_path / folder / "body.xml").write_text("<mujoco/>")
        here, there = (plain(kind(tmp_path / folder / "body.xml")) for folder in ("here", "there"))
        assert here.partition("@")[2] == there.partition("@")[2] != ""
        assert (here == there) == (kind is Path)
        (tmp_path / "here" / "body.xml").write_text("<mujoco> </mujoco>")
        assert plain(kind(tmp_path / "here" / "body.xml")) != here
    assert plain(text := str(tmp_path)) == text
    assert plain("0.5" * 2000) == "0.5" * 2000
    assert plain("a.b\0") == "a.b\0"


def test_an_mjcf_is_all_that_it_includes_and_refers_to(tmp_path: Path) -> None:
    body, parts, shape = tmp_path / "body.xml", tmp_path / "parts.mjcf", tmp_path / "shapes" / "leg.stl"
    shape.parent.mkdir()
    body.write_text('<mujoco><compiler meshdir="shapes"/><include file="parts.mjcf"/></mujoco>')
    found = set()
    for text in ("<parts/>", "<parts><asset><mesh file='leg.stl'/></asset></parts>"):
        parts.write_text(text)
        for content in (b"a", b"b"):
            shape.write_bytes(content)
            found.add(plain(body))
    assert len(found) == 3


def test_an_mjcf_in_folders_is_looked_for_beside_each_file(tmp_path: Path) -> None:
    (tmp_path / "sub" / "m").mkdir(parents=True)
    (tmp_path / "main.xml").write_text('<mujoco><include file="sub/legs.xml"/></mujoco>')
    (tmp_path / "sub" / "legs.xml").write_text('<legs><include file="more.xml"/><model file="att.xml"/></legs>')
    (tmp_path / "sub" / "att.xml").write_text('<mujoco><compiler meshdir="m"/><mesh file="b.obj"/></mujoco>')
    found = {plain(tmp_path / "main.xml")}
    for name in ("more.xml", "att.xml", "m/b.obj"):
        with (tmp_path / "sub" / name).open("a") as file:
            file.write(" ")
        found.add(plain(tmp_path / "main.xml"))
    assert len(found) == 4


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


def test_a_whole_number_and_the_same_float_are_one_setting() -> None:
    for one, other in ((Conditions.of(vp=80, load=0), Conditions.of(load=-0.0)), (Stride(aep0=10), Stride())):
        assert json.dumps(plain(one)) == json.dumps(plain(other))


def test_a_cell_refuses_what_no_name_can_tell() -> None:
    with pytest.raises(InputError, match="'threads' of a; expected it to be left to the sweep"):
        Cell("a", told_how, {"seed": 0, "threads": 2})
    with pytest.raises(InputError, match="stands inside a function"):
        Cell("a", lambda: xr.Dataset(), {}).record()


def test_what_was_typed_in_cannot_be_kept(tmp_path: Path) -> None:
    typed = "import xarray; from hexmj.sweeps import *; from pathlib import Path\n"
    typed += "def f(): return xarray.Dataset()\nrun([Cell('a', f, {})]); run([Cell('a', f, {})], Path('kept'))"
    command = [sys.executable, "-c", typed]
    ended = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True)
    assert ended.stderr.endswith("write it into a file\n") and "__main__ has no source" in ended.stderr


def test_any_name_becomes_a_name_of_a_file() -> None:
    for name in ("step 2 mm", "../../etc", ".hidden", "x" * 1000, "ö/$$ [red]\n"):
        stem = (cell := Cell(name, odd_bits, {"seed": 0})).stem(cell.record())
        assert Path(stem).name == stem and len(stem) < 120 and stem.isascii() and not stem.startswith(".")


TOY = {
    "toy/__init__.py": "from toy.louder import louder\nfrom toy.walk import walk\nwalk = louder(walk)",
    "toy/study.py": "import numpy\nfrom toy import walk\nfrom typing import TYPE_CHECKING\n"
    "if TYPE_CHECKING:\n    import toy.film\ndef cell(controller=None): ...",
    "toy/louder.py": "def louder(what): return what",
    "toy/walk.py": "def walk():\n    import toy.inner.deep\n    return deep, 'own.toml', 'data/more.toml'",
    "toy/inner/__init__.py": "GAIN = 1",
    "toy/inner/deep.py": "from . import deeper",
    "toy/inner/deeper.py": "import scipy.stats",
    "toy/own.toml": "p = 1",
    "toy/data/more.toml": "q = 1",
    "here.json": "{}",
    "toy/film.py": "import matplotlib\ndef show(): ...",
    "toy/cli.py": "import toy.study",
    "helper.py": "",
    "bare/helper.py": "",
    "bare/deep/other.py": "",
    "fast.pyc": "",
    "mine.py": "from helper import *\nfrom bare import helper\nimport bare.deep.other\n"
    "if not True:\n    import fast\nHERE = 'here.json'\n" + MINE,
}
PRINT_STEM = """
from hexmj.loaded import importable
from hexmj.sweeps import code as sources
from hexmj.sweeps import Cell
from toy.study import cell
one = Cell("toy", cell, {"controller": importable("mine.py").Tripod()})
print(one.record())
"""


def toy_record(folder: Path) -> str:
    command = [sys.executable, "-c", PRINT_STEM]
    return subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=True).stdout


def write_toy(tmp_path: Path) -> Path:
    for name, text in TOY.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


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
        *("toy.walk, own.toml", "toy.walk, data/more.toml", "helper", "bare.helper", "bare.deep.other", "fast"),
    }
    assert {name for name in record["sources"] if name.startswith(("toy", "helper", "bare", "fast"))} == within
    assert [name.rpartition("@")[2][12:] for name in record["sources"] if name.startswith("mine.py@")] == [
        "",
        ", here.json",
    ]
    assert set(record["versions"]) == {"python", "numpy", "scipy"}
    for name in ("toy/film.py", "toy/cli.py"):
        (toy / name).write_text(TOY[name] + "\n# edited")
    assert toy_record(toy) == unedited


@pytest.mark.parametrize(
    "name",
    [
        *("toy/__init__.py", "toy/study.py", "toy/louder.py", "toy/inner/__init__.py", "toy/inner/deeper.py"),
        *("toy/own.toml", "toy/data/more.toml", "here.json", "mine.py", "helper.py"),
        *("bare/helper.py", "bare/deep/other.py", "fast.pyc"),
    ],
)
def test_an_edit_within_reach_is_another_name(toy: Path, unedited: str, name: str) -> None:
    (toy / name).write_text(TOY[name] + "\n# edited")
    assert toy_record(toy) != unedited


def test_the_package_knows_its_own_reach() -> None:
    made = code(frozenset({"hexmj.stability"}))
    assert {"hexmj.stability", "hexmj.legs"} <= set(made.sources)
    assert not [name for name in made.sources if "film" in name or "cli" in name or "sweeps" in name]
    assert "numba" in made.versions and "llvmlite" in made.versions and "xarray" not in made.versions


@pytest.mark.parametrize("text", ["from hexmj import loss_time", "import hexmj"])
def test_a_name_that_the_package_loads_as_it_is_used_is_followed_home(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.py").write_text(text)
    made = code(frozenset({importable(tmp_path / "mine.py").__name__}))
    assert {"hexmj", "hexmj.stability", "hexmj.legs"} <= set(made.sources)
    assert (text == "import hexmj") == any("film" in name for name in made.sources)


def test_a_source_that_was_edited_since_the_program_began_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    name, file = "hexmj.errors", sources.PACKAGE / "errors.py"
    monkeypatch.setitem(sources._AT_FIRST, file, 0)
    with pytest.raises(InputError, match=r"errors\.py was edited since this program began; start it again"):
        sources._read.__wrapped__(name, file)


PRINT_MAIN = """
from hexmj.sweeps import Cell
from toy.study import cell
print(Cell("toy", cell, {"controller": Tripod()}).record())
"""

USED = """
import sys
from pathlib import Path
import used, controller
from hexmj.sweeps import Cell
from hexmj.sweeps.cells import plain
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
    command = [sys.executable, "-c", USED, how]
    return subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True)


def test_a_module_that_was_edited_as_it_was_used_counts_as_it_ran(toy: Path) -> None:
    """Whether the file was edited before the first record or after; run again, no one knows which is meant."""
    unedited, edited, again = (used_record(toy, how) for how in ("record", "edit", "again"))
    assert unedited.returncode == edited.returncode == 0, edited.stderr
    assert json.loads(unedited.stdout) == json.loads(edited.stdout)
    assert "used.py was edited while this program used it; start it again" in again.stderr


@pytest.mark.parametrize("content", [b"# -*- coding: latin-1 -*-\n# \xdf", b"\xef\xbb\xbf# with a mark"])
def test_a_source_counts_in_any_encoding_that_python_reads(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "mine.py").write_bytes(content + b"\nimport numpy")
    assert "numpy" in code(frozenset({importable(tmp_path / "mine.py").__name__})).versions


LATE = """
from pathlib import Path
from hexmj.sweeps import Cell, run
import late_cells
late_cells.record()
Path("helper.py").write_text("GAIN = 7.0")
run([Cell("late", late_cells.cell, {})], Path("kept"))
"""


def test_a_module_that_is_edited_before_a_cell_imports_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "helper.py").write_text("GAIN = 1.0")
    (tmp_path / "late_cells.py").write_text(
        "import xarray as xr\nfrom hexmj.sweeps import Cell\n"
        "def cell():\n    import helper\n    return xr.Dataset({'a': helper.GAIN})\n"
        "def record(): return Cell('late', cell, {}).record()"
    )
    command = [sys.executable, "-c", LATE]
    done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True)
    assert "helper.py was edited while this program used it; start it again" in done.stderr
    assert not list(tmp_path.rglob("*.nc"))


READ = """
from pathlib import Path
from hexmj.sweeps import Cell
import reads
if __name__ == "__main__":
    Path("gains.toml").write_text("g = 9.0")
    print(Cell("reads", reads.cell, {}).record())
"""


def test_a_data_file_counts_as_it_was_when_its_module_ran_too(tmp_path: Path) -> None:
    """The module may have read it then, or may read it now; in a new program both are the same."""
    (tmp_path / "reads.py").write_text("GAINS = open('gains.toml').read()\ndef cell(): ...")
    sources_of = []
    for text in ("g = 1.0", "g = 9.0"):
        (tmp_path / "gains.toml").write_text(text)
        command = [sys.executable, "-c", READ]
        done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, check=True)
        sources_of.append(json.loads(done.stdout)["sources"])
    assert sources_of[0]["reads, gains.toml"] != sources_of[1]["reads, gains.toml"]


def edited_rows(rows: np.ndarray, data: str) -> np.ndarray:
    Path(data).write_text("after")
    return rows.sum(axis=1)


def test_evaluations_during_which_a_file_is_edited_are_not_kept(tmp_path: Path) -> None:
    (data := tmp_path / "gains.toml").write_text("before")
    values = KeptValues(Cell("rows", edited_rows, {"data": str(data)}), tmp_path / "kept")
    with pytest.raises(InputError, match="rows: data of settings was edited while it was in use; start again"):
        values(np.eye(2))
    assert KeptValues(Cell("rows", edited_rows, {"data": str(data)}), tmp_path / "kept").known == 0


def test_a_helper_with_the_name_of_one_of_pythons_own_counts(toy: Path) -> None:
    (toy / "mine.py").write_text("import profile\n" + TOY["mine.py"])
    found = []
    for text in ("GAIN = 1", "GAIN = 2"):
        (toy / "profile.py").write_text(text)
        found.append(json.loads(toy_record(toy))["sources"])
    assert found[0].pop("profile") != found[1].pop("profile")
    assert found[0] == found[1]


def test_a_script_that_runs_as_a_module_counts_what_it_imports(toy: Path) -> None:
    (toy / "toy" / "run.py").write_text("from . import louder\n" + MINE + "\n" + PRINT_MAIN)
    command = [sys.executable, "-m", "toy.run"]
    done = subprocess.run(command, cwd=toy, env=ENVIRONMENT, capture_output=True, text=True)
    assert {"run.py", "toy", "toy.louder"} <= set(json.loads(done.stdout)["sources"]), done.stderr


def test_a_script_of_any_name_counts_what_it_imports(toy: Path) -> None:
    (toy / "script").write_text("import helper\n" + MINE + "\n" + PRINT_MAIN)
    done = subprocess.run([sys.executable, "script"], cwd=toy, env=ENVIRONMENT, capture_output=True, text=True)
    assert {"script", "helper"} <= set(json.loads(done.stdout)["sources"]), done.stderr


def test_a_source_in_an_archive_is_refused_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with zipfile.ZipFile(tmp_path / "lib.zip", "w") as archive:
        archive.writestr("zipped_controller.py", MINE)
    monkeypatch.syspath_prepend(tmp_path / "lib.zip")
    importlib.import_module("zipped_controller")
    with pytest.raises(InputError, match=r"zipped_controller\.py cannot be read: Not a directory; expected sources as"):
        code(frozenset({"zipped_controller"}))


def test_what_a_file_tries_in_vain_does_not_stop_it(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("try:\n    from . import foo\nexcept ImportError:\n    foo = 3")
    assert importable(tmp_path / "mine.py").foo == 3


def test_data_files_count_as_they_are_now(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("DATA = 'gains.toml'")
    name, found = importable(tmp_path / "mine.py").__name__, []
    for text in ("a = 1", "a = 2", "a = 1"):
        (tmp_path / "gains.toml").write_text(text)
        found.append(code(frozenset({name})).sources)
    assert found[0] == found[2] != found[1]


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
from test_sweeps import counted_cells

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
