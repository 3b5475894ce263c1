"""What a kept cell is named by where its code uses installed packages: their versions, or their files."""

import base64
import json
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from importlib import metadata
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import distributions, packages_distributions
from pathlib import Path

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.storage.files import digest
from hexmj.sweep import packages
from hexmj.sweeps.code import code
from hexmj.sweeps.packages import NAMES
from small_cells import WITHOUT_DASK


@pytest.mark.slow
def test_modules_of_another_name_than_their_distribution_are_told_by_its_version() -> None:
    for module, name in NAMES.items():
        assert packages_distributions()[module] == [name]
        assert packages.version(module) == metadata.version(name)


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
def test_what_is_installed_while_a_program_runs_is_found(tmp_path, monkeypatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    install(tmp_path, "first_one", "1.0", {"first_module.py": ""})
    assert packages.version("first_module").startswith("1.0@")
    install(tmp_path, "second_one", "2.0", {"second_module.py": ""})
    assert packages.version("second_module").startswith("2.0@")


INSTALLED = """
from pathlib import Path
import hexmj
import walkers.legs
from hexmj.sweeps.code import code
if "{edited}":
    Path(walkers.__file__).with_name("{edited}").write_text("GAIN = 30")
print(code(frozenset({{"walkers.legs"}})).versions["walkers"])
"""


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


@pytest.mark.slow
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


AS_A_SCRIPT = """
from pathlib import Path
import xarray as xr
from hexmj.sweep import Cell, run_cells
def gain(): return xr.Dataset({"gain": float(Path(__file__).with_name("gain").read_text())})
print(float(run([Cell("gain", gain, {})], Path("kept"))[0].gain))
"""


@pytest.mark.slow
def test_data_that_it_reads_count(tmp_path: Path) -> None:
    (script := tmp_path / "site-packages" / "walker" / "go.py").parent.mkdir(parents=True)
    script.write_text(AS_A_SCRIPT)
    for told in ("1.0", "2.0"):
        script.with_name("gain").write_text(told)
        done = subprocess.run([sys.executable, script], env=WITHOUT_DASK, capture_output=True, text=True, cwd=tmp_path)
        assert done.stdout == f"{told}\n", done.stderr


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
from hexmj.sweep import Cell, run_cells
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


def test_the_name_of_a_distribution_is_read_as_it_is_parsed():
    found = [*distributions()]
    assert len(found) > 50
    assert [packages._name(one) for one in found] == [one.name for one in found]
