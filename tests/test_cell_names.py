"""What a kept cell is named by: its settings, and the code within reach as it ran."""

import importlib
import json
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import InitVar, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj import field_docs
from hexmj.conditions import Conditions
from hexmj.errors import InputError
from hexmj.loaded import importable
from hexmj.sweeps import Cell, KeptValues
from hexmj.sweeps import code as sources
from hexmj.sweeps.code import code
from hexmj.sweeps.plain import plain
from hexmj.timing import Stride
from small_cells import ENVIRONMENT, MINE, Wave, odd_bits, told_how


def test_settings_become_plain_json() -> None:
    settings = {
        "wave": Wave(2.0, np.array([[1.0, -0.0]])),
        "pair": (1, None, True, "text"),
        "number": np.float64(0.1),
        "inner": {"folder": Path("/nowhere"), "counts": np.arange(2)},
    }
    assert plain(settings) == {
        "wave": {"class": "small_cells.Wave", "slope": 2.0, "values": [[1.0, -0.0]]},
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


def test_naming_a_cell_reads_no_docstring_nor_does_reading_one_rename_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Docstrings of public classes parse sources, which Python 3.11 does not bear in several threads at once."""
    parsed, asked = field_docs.parsed, list[bytes]()
    monkeypatch.setattr(field_docs, "parsed", lambda source: asked.append(source) or parsed(source))
    field_docs.told.cache_clear()
    cell = Cell("a", odd_bits, {"seed": 0, "size": hexmj.Conditions()})
    with ThreadPoolExecutor(8) as pool:
        names = {one.result() for one in [pool.submit(cell.record) for _ in range(16)]}
    assert not asked
    assert "vp: " in (hexmj.Conditions.__doc__ or "")
    assert asked
    assert names == {cell.record()}


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
