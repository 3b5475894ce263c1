"""What a kept cell is named by: its settings, and the code within reach."""

import base64
import importlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from hashlib import sha256
from importlib import metadata
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import packages_distributions
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.controllers.cruse1998 import presets
from hexmj.errors import InputError
from hexmj.storage.files import digest, digest_of
from hexmj.sweeps import Cell, packages
from hexmj.sweeps.code import code
from hexmj.sweeps.packages import NAMES
from hexmj.user_code.loaded import importable
from small_cells import MINE, WITHOUT_DASK, Wave, odd_bits, told_how
from toy_project import TOY, toy_record, write_toy


def test_modules_of_another_name_than_their_distribution_are_told_by_its_version() -> None:
    for module, name in NAMES.items():
        assert packages_distributions()[module] == [name]
        assert packages.version(module) == metadata.version(name)


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


VERSIONS = """
import json
from hexmj.user_code.loaded import importable
from hexmj.sweeps.code import code
print(json.dumps(code(frozenset({{importable("{mine}").__name__}})).versions))
"""


def version_of_my_helper(mine: Path, folder: Path) -> tuple[str, str]:
    """Of `my_helper` in a folder of installed packages, and of NumPy, as a cell's name tells them."""
    found = versions_with(mine, folder)
    return found["my_helper"], found["numpy"]


def versions_with(mine: Path, folder: Path) -> dict[str, str]:
    """All that a cell's name tells of packages whose code imports `my_helper` in a folder of installed packages."""
    mine.write_text("import my_helper\nimport numpy")
    environment = WITHOUT_DASK | {"PYTHONPATH": os.pathsep.join([WITHOUT_DASK["PYTHONPATH"], str(folder)])}
    command = [sys.executable, "-c", VERSIONS.format(mine=mine)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    return json.loads(done.stdout or done.stderr)


def test_an_installed_helper_counts_by_its_files_though_its_version_stays(tmp_path: Path) -> None:
    """Installed anew from elsewhere, installed anew with other content, and edited where it lies."""
    found = []
    for i, (text, where) in enumerate((("GAIN = 1", "a"), ("GAIN = 1", "b"), ("GAIN = 2", "b"))):
        folder = tmp_path / str(i) / "site-packages"
        rows = {
            "my_helper.py": text,
            "gains.txt": "1",
            "my_helper-1.0.dist-info/direct_url.json": f'{{"url": "{where}"}}',
        }
        install(folder, "my_helper", "1.0", rows | {"../bin/my_helper": where})
        found.append(version_of_my_helper(tmp_path / "mine.py", folder))
    for name in ("my_helper.py", "gains.txt"):
        (tmp_path / "0" / "site-packages" / name).write_text("GAIN = 3")
        found.append(version_of_my_helper(tmp_path / "mine.py", tmp_path / "0" / "site-packages"))
    assert found[0] == found[1] and len({*found}) == 4
    assert found[0][1] == np.__version__ and found[0][0].startswith("1.0@")


def install(folder: Path, name: str, version: str, files: dict[str, str], more: str = "") -> None:
    """Put files into a folder of installed packages, with what tells of them."""
    told = folder / f"{name}-{version}.dist-info"
    told.mkdir(parents=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n{more}")
    rows = []
    for file, text in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text)
        rows.append(f"{file},sha256={base64.urlsafe_b64encode(sha256(text.encode()).digest()).decode()},8\n")
    (told / "RECORD").write_text("".join(rows))


@pytest.mark.slow
def test_what_an_installed_helper_requires_counts(tmp_path: Path) -> None:
    """Directly or not, for an extra that another one asks for; but not what it requires elsewhere, or for an extra that
    nobody asks for.  One is there in part."""
    more = "Requires-Dist: deep-helper\nRequires-Dist: plain\nRequires-Dist: bare\nRequires-Dist: not a name\n"
    more += 'Requires-Dist: other; extra == "more"\nRequires-Dist: other; sys_platform ~= "linux"\n'
    deep = 'Requires-Dist: deepest (>0) ; extra == "fast"\nRequires-Dist: other; sys_platform == "nowhere"\n'
    install(folder := tmp_path / "site-packages", "my_helper", "1.0", {"my_helper.py": "import deep_helper"}, more)
    install(folder, "Deep.Helper", "1.0", {"deep_helper.py": "import deepest"}, deep)
    install(folder, "plain", "1.0", {}, "Requires-Dist: deep-helper[fast]\n")
    (folder / "bare-1.0.dist-info").mkdir()
    (folder / "Deep.Helper-1.0.dist-info" / "RECORD").unlink()
    found = []
    for version, text in (("1.0", "GAIN = 1"), ("1.0", "GAIN = 2"), ("2.0", "GAIN = 2")):
        for name in ("deepest", "other"):
            install(folder, name, version, {f"{name}.py": text})
        found.append(versions_with(tmp_path / "mine.py", folder))
        assert "other" not in found[-1]
        for name in ("deepest", "other"):
            shutil.rmtree(folder / f"{name}-{version}.dist-info")
    assert len({one["deepest"] for one in found}) == 3
    assert found[0]["bare"].startswith("None")
    (folder / "deep_helper.py").write_text("import deepest, json")
    assert versions_with(tmp_path / "mine.py", folder)["deep-helper"] != found[0]["deep-helper"]
    assert len({one["deep-helper"] for one in found}) == len({one["my_helper"] for one in found}) == 1


@pytest.mark.slow
def test_an_installed_helper_that_requires_this_package_may_use_all_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    helper = {"my_helper.py": ""}
    install(folder := tmp_path / "site-packages", "my_helper", "1.0", helper, "Requires-Dist: hexmj\n")
    found = []
    for edit in ("# 1", "# 2"):
        package = tmp_path / edit / "hexmj"
        shutil.copytree(packages.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
        (package / "gaits.py").write_text(f"{(package / 'gaits.py').read_text()}{edit}\n")
        monkeypatch.chdir(package.parent)  # where Python looks first
        found.append(versions_with(tmp_path / "mine.py", folder))
    assert found[0].pop("hexmj") != found[1].pop("hexmj")
    assert found[0] == found[1]


def test_what_an_installed_helper_requires_and_is_installed_to_be_edited_counts_by_its_sources(tmp_path: Path) -> None:
    """But not by what is installed within its folder."""
    (source := tmp_path / "my project").mkdir()
    origin = json.dumps({"url": source.as_uri(), "dir_info": {"editable": True}})
    install(folder := tmp_path / "site-packages", "my_helper", "1.0", {"my_helper.py": ""}, "Requires-Dist: deep\n")
    install(folder, "deep", "1.0", {"deep.pth": str(source), "deep-1.0.dist-info/direct_url.json": origin})
    found = []
    compiled = f"inner/deepest{EXTENSION_SUFFIXES[0]}"
    for name, text in (("deep.py", "1"), ("deep.py", "2"), (compiled, "3"), (".venv/site-packages/other.py", "4")):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text(text)
        found.append(versions_with(tmp_path / "mine.py", folder)["deep"])
    (source / ".#edited.py").symlink_to("nowhere")
    (source / "folder.py").mkdir()
    assert len({*found}) == 3 and found[2] == found[3] == versions_with(tmp_path / "mine.py", folder)["deep"]
    for odd in ("", "null", "[]", '{"dir_info": {"editable": true}}', '{"dir_info": null}'):
        (folder / "deep-1.0.dist-info" / "direct_url.json").write_text(odd)
        assert versions_with(tmp_path / "mine.py", folder)["deep"].startswith("1.0@")


INSTALLED = """
from pathlib import Path
import hexmj
import walkers.legs
from hexmj.sweeps.code import code
if "{edited}":
    Path(walkers.__file__).with_name("{edited}").write_text("GAIN = 30")
print(code(frozenset({{"walkers.legs"}})).versions["walkers"])
"""


@pytest.mark.slow
def test_of_an_installed_controllers_package_all_files_count(tmp_path: Path) -> None:
    """Data, too, and modules that it finds by a name; not once it is another one than that which was imported."""
    folder, found = tmp_path / "site-packages", []
    environment = WITHOUT_DASK | {"PYTHONPATH": os.pathsep.join([WITHOUT_DASK["PYTHONPATH"], str(folder)])}

    def versions_told(edited: str = "") -> str:
        command = [sys.executable, "-c", INSTALLED.format(edited=edited)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        return (done.stdout or done.stderr).strip().splitlines()[-1]

    files = {"__init__.py": "from walkers import gains", "legs.py": "GAIN = 1", "gains.py": "", "gain.json": "1"}
    install(folder, "walkers", "1.0", {f"walkers/{name}": text for name, text in files.items()})
    for name, text in (("gain.json", "1"), ("gain.json", "2"), ("found_by_name.py", "1"), ("found_by_name.py", "2")):
        (folder / "walkers" / name).write_text(text)
        (record := folder / "walkers-1.0.dist-info" / "RECORD").write_text(f"{record.read_text()}walkers/{name},,\n")
        found.append(versions_told())
    assert len({*found}) == 4 and all(one.startswith("1.0@") for one in found)
    for edited in ("legs.py", "gains.py"):
        told = versions_told(edited)
        assert told.endswith(f"{edited} was made or installed anew while this program used it; start it again")


def test_a_script_below_installed_packages_is_a_users(tmp_path: Path) -> None:
    (script := tmp_path / "site-packages" / "go.py").parent.mkdir()
    script.write_text("from hexmj.sweeps.code import code\nprint(sorted(code(frozenset({'__main__'})).versions))\n")
    done = subprocess.run([sys.executable, script], env=WITHOUT_DASK, capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "['python']\n", done.stderr


def test_a_compiled_helper_that_was_made_anew_while_it_ran_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (helper := tmp_path / f"compiled_helper{EXTENSION_SUFFIXES[0]}").write_bytes(b"gain 1")
    for name in ("before", "after"):
        (tmp_path / f"uses_it_{name}.py").write_text("import compiled_helper")
    sys.audit("import", "compiled_helper", str(helper), None, None, None)  # as Python does when it loads one
    assert code(frozenset({"uses_it_before"})).sources["compiled_helper"] == digest(b"gain 1")
    helper.write_bytes(b"gain 20")
    with pytest.raises(
        InputError, match=f"^{helper} was made or installed anew while this program used it; start it ag"
    ):
        code(frozenset({"uses_it_after"}))


SWEEP = """
from pathlib import Path
import xarray as xr
from hexmj.sweeps import Cell, run
import mine
run([Cell("gain", mine.gain, {"asked": ASKED})], Path("kept"))
"""

LAZY = """
import my_helper
import xarray as xr
def gain(asked): return xr.Dataset({'gain': my_helper.gain() if asked else 0.0})
"""


@pytest.mark.slow
def test_cells_of_such_sources_are_kept_until_one_is_edited(tmp_path: Path) -> None:
    """Not those that take what was edited since their names were made."""
    (source := tmp_path / "project").mkdir()
    origin = json.dumps({"url": source.as_uri(), "dir_info": {"editable": True}})
    helper = {"my_helper.py": "def gain():\n    from deep import GAIN\n    return GAIN"}
    install(folder := tmp_path / "site-packages", "my_helper", "1.0", helper, "Requires-Dist: deep\n")
    install(folder, "deep", "1.0", {"deep-1.0.dist-info/direct_url.json": origin})
    (tmp_path / "mine.py").write_text(LAZY)
    paths = [WITHOUT_DASK["PYTHONPATH"], str(folder), str(source), str(tmp_path)]
    environment = WITHOUT_DASK | {"PYTHONPATH": os.pathsep.join(paths)}
    every, edit = SWEEP.replace("ASKED", "True"), 'Path("project/deep.py").write_text("GAIN = 33.5")'
    told, kept = [], []
    for text, script in (
        *((text, every) for text in ("GAIN = 1", "GAIN = 1", "GAIN = 2.5")),
        ("GAIN = 4", SWEEP.replace("ASKED", "False") + edit + every),
    ):
        (source / "deep.py").write_text(text)
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        told.append(done.stderr)
        kept.append({path.name for path in (tmp_path / "kept").iterdir()})
    assert len(kept[0]) == 1 and kept[0] == kept[1] and [*map(len, kept)] == [1, 1, 2, 3]
    assert not any(told[:3]) and "deep.py has changed since it was opened first" in told[3]


@pytest.mark.slow
@pytest.mark.parametrize("record", ["my_helper,,\n", None])
def test_an_installed_helper_that_was_linked_or_has_no_list_of_files_counts_by_them(
    tmp_path: Path, record: str | None
) -> None:
    (source := tmp_path / "source").mkdir()
    install(folder := tmp_path / "site-packages", "my_helper", "1.0", {})
    list_of_files = folder / "my_helper-1.0.dist-info" / "RECORD"
    list_of_files.write_text(record) if record else list_of_files.unlink()
    (folder / "my_helper").symlink_to(source)
    found = []
    for text in ("GAIN = 1", "GAIN = 2"):
        (source / "__init__.py").write_text(text)
        found.append(version_of_my_helper(tmp_path / "mine.py", folder)[0])
    assert found[0] != found[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["my_helper.py", "my_helper/__init__.py", "my_helper/inner/gains.py", "my_helper/gains.txt"]
)
def test_an_installed_helper_of_no_package_counts_by_its_files(tmp_path: Path, name: str) -> None:
    """One that was copied there."""
    file = (folder := tmp_path / "site-packages") / name
    file.parent.mkdir(parents=True)
    if file.parent != folder and file.name != "__init__.py":
        (folder / "my_helper" / "__init__.py").write_text("")
    found = []
    for text in ("GAIN = 1", "GAIN = 2"):
        file.write_text(text)
        found.append(version_of_my_helper(tmp_path / "mine.py", folder)[0])
    assert found[0] != found[1] and all(one.startswith("unknown@") for one in found)


PRINT_MAIN = """
from hexmj.sweeps import Cell
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
    [("controllers.cruse1998.presets", presets.OWN), ("bodies.stick_insect", hexmj.STICK_INSECT.mjcf)],
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
