"""What programs read counts for the cells that they sweep: scripts, packages beside them, installed ones, threads."""

import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from small_cells import BODY, ENVIRONMENT

SCRIPT = """
from hexmj.sweeps import Cell, run
from pathlib import Path
import xarray as xr
def load(name):
    return [float(path.read_text()) for path in (Path(name),)][0]
GAIN = load("ga" + "in")
def cell():
    return xr.Dataset({"gain": GAIN})
if __name__ == "__main__":
    print(run([Cell("script", cell, {})], Path("kept"))[0].gain.item())
"""


PACKAGE = """
import pkgutil
import xarray as xr
def cell():
    return xr.Dataset({"gain": float(pkgutil.get_data(__name__, "../gain"))})
"""


@pytest.mark.parametrize(("script", "package"), [(SCRIPT, ""), (SCRIPT.replace("def cell", "def _"), PACKAGE)])
def test_what_a_script_reads_at_its_top_level_and_a_package_beside_it_counts(
    tmp_path: Path, script: str, package: str
) -> None:
    (tmp_path / "pk").mkdir()
    (tmp_path / "pk" / "__init__.py").write_text(package)
    (tmp_path / "script.py").write_text(("from pk import cell\n" if package else "") + script)
    for gain, kept in ((1.0, 1), (1.0, 1), (2.0, 2), (1.0, 2)):
        (tmp_path / "gain").write_text(str(gain))
        told = subprocess.check_output([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT)
        assert (float(told), len(list((tmp_path / "kept").iterdir()))) == (gain, kept)
    assert not [file for file in (tmp_path / "kept").iterdir() if b"kept/" in file.read_bytes()]


ASKED_EARLY = """
from functools import cache
import xarray as xr
@cache
def gain():
    return float(open("gain").read())
def cell():
    return xr.Dataset({"gain": gain()})
"""
ASKS = """
from pathlib import Path
from remembers import cell, gain
from hexmj.sweeps import Cell, run
gain()
Path("told").write_text(str(run([Cell("remembered", cell, {})], Path("kept"))[0].gain.item()))
"""


@pytest.mark.parametrize("folder", ["./lib", ".//lib", "lib/../lib"])
def test_what_a_module_reads_counts_however_its_folder_is_written(tmp_path: Path, folder: str) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "remembers.py").write_text(ASKED_EARLY)
    (tmp_path / "script.py").write_text(f"import hexmj, sys\nsys.path.append({folder!r})\n{ASKS}")
    for gain in (1.0, 2.0):
        (tmp_path / "gain").write_text(str(gain))
        subprocess.run([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT, check=True)
        assert float((tmp_path / "told").read_text()) == gain


def test_what_a_profiled_script_reads_before_a_sweep_counts(tmp_path: Path) -> None:
    """Its code has a relative name."""
    (tmp_path / "remembers.py").write_text(ASKED_EARLY)
    (tmp_path / "script.py").write_text(ASKS)
    for gain, how in ((1.0, ["-m", "cProfile", "-o", os.devnull]), (2.0, [])):
        (tmp_path / "gain").write_text(str(gain))
        subprocess.run([sys.executable, *how, "script.py"], cwd=tmp_path, env=ENVIRONMENT, check=True)
        assert float((tmp_path / "told").read_text()) == gain


FAR_FETCHED = """
import importlib, pkgutil
from concurrent.futures import ThreadPoolExecutor
import numpy as np, xarray as xr
import installed
import mujoco
with ThreadPoolExecutor(1) as threads:
    (ONE,) = threads.map(np.loadtxt, ["one"])
(TWO,) = [importlib.import_module(f"pk.{found.name}").TWO for found in pkgutil.iter_modules(__path__)]
def cell(three):
    return xr.Dataset({"gain": ONE + TWO + three.of("three") + mujoco.MjModel.from_xml_path("four.xml").body_mass[1]})
"""

FEW, MANY = (1, 2, 3, 4, 5), (7, 8, 9, 10, 11)

INSTALLED = """
from dataclasses import dataclass
with open("five") as file:
    FIVE = float(file.read())
@dataclass(frozen=True)
class Reads:
    def of(self, name):
        with open(name) as file:
            return float(file.read()) + FIVE
"""

FAR_SCRIPT = """
from pathlib import Path
from hexmj.sweeps import Cell, run
import installed
from pk import cell
if __name__ == "__main__":
    print(run([Cell("far", cell, {"three": installed.Reads()})], Path("kept"))[0].gain.item())
"""


def test_reads_in_threads_by_an_installed_class_and_of_modules_that_are_found_count(tmp_path: Path) -> None:
    for folder in ("pk", "site-packages"):
        (tmp_path / folder).mkdir()
    for name, text in (("pk/__init__", FAR_FETCHED), ("site-packages/installed", INSTALLED), ("script", FAR_SCRIPT)):
        (tmp_path / f"{name}.py").write_text(text)
    env = ENVIRONMENT | {"PYTHONPATH": f"{ENVIRONMENT['PYTHONPATH']}{os.pathsep}site-packages"}
    (tmp_path / "four.xml").write_text('<mujoco><include file="inner.xml"/></mujoco>')
    texts = {"one": "{}", "pk/part.py": "TWO = {}", "three": "{}", "inner.xml": BODY, "five": "{}"}
    for gains, kept in (
        (FEW, 1),
        (FEW, 1),
        ((7, 2, 3, 4, 5), 2),
        ((7, 8, 3, 4, 5), 3),
        ((7, 8, 9, 4, 5), 4),
        ((7, 8, 9, 10, 5), 5),
        (MANY, 6),
        (FEW, 6),
    ):
        for (name, text), gain in zip(texts.items(), gains, strict=True):
            (tmp_path / name).write_text(text.format(gain))
        (tmp_path / f"{gains}.json").write_text("neither read nor listed")
        told = subprocess.check_output([sys.executable, "-B", "script.py"], cwd=tmp_path, env=env)
        assert (float(told), len(list((tmp_path / "kept").iterdir()))) == (sum(gains), kept)


BEFORE = """
import numpy as np
from pathlib import Path
HERE = Path(__file__).parent
GAIN = np.load(f"{HERE}/data" + "/of" + "/gain.npy")
"""

IMPORTS_BEFORE = """
import numpy as np
from lib import before
OWN = np.load("own.npy")
from hexmj.sweeps import Cell, run
from pathlib import Path
import xarray as xr
def cell():
    Path("calls").open("a").write(".")
    return xr.Dataset({"gain": before.GAIN + OWN})
if __name__ == "__main__":
    print(run([Cell("before", cell, {})], Path("kept"))[0].gain.item())
    np.save("written.npy", np.random.random())
"""


def test_what_was_read_before_the_package_was_imported_counts_if_it_is_named(tmp_path: Path) -> None:
    (data := tmp_path / "lib" / "data" / "of").mkdir(parents=True)
    (tmp_path / "lib" / "before.py").write_text(BEFORE)
    (tmp_path / "script.py").write_text(IMPORTS_BEFORE)
    for helpers, own, calls in ((1.0, 10.0, 1), (1.0, 10.0, 1), (2.0, 10.0, 2), (2.0, 20.0, 3)):
        np.save(data / "gain.npy", helpers)
        np.save(tmp_path / "own.npy", own)
        told = subprocess.check_output([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT)
        assert (float(told), (tmp_path / "calls").stat().st_size) == (helpers + own, calls)


WARMED = """
import threading
from functools import cache
from pathlib import Path
import xarray as xr
from hexmj.sweeps import Cell, run
@cache
def gain(name):
    return float(Path(name).read_text())
def cell():
    return xr.Dataset({"gain": gain("ga" + "in")})
"""


def test_what_a_thread_has_read_before_the_sweep_counts(tmp_path: Path) -> None:
    (tmp_path / "warmed.py").write_text(WARMED)
    (tmp_path / "script.py").write_text(
        "import threading, warmed\nfrom pathlib import Path\nfrom hexmj.sweeps import Cell, run\n"
        "thread = threading.Thread(target=warmed.gain, args=['gain'])\nthread.start()\nthread.join()\n"
        "print(run([Cell('warmed', warmed.cell, {})], Path('kept'))[0].gain.item())"
    )
    for gain, kept in ((1.0, 1), (2.0, 2), (1.0, 2)):
        (tmp_path / "gain").write_text(str(gain))
        told = subprocess.check_output([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT)
        assert (float(told), len(list((tmp_path / "kept").iterdir()))) == (gain, kept)


REMEMBERS = """
import json, sqlite3
from functools import cache
import xarray as xr
@cache
def gain():
    with sqlite3.connect("file:gains.db?mode=ro", uri=True) as base:
        return json.load(open("gain.json")) + base.execute("select total(x) from gains").fetchone()[0]
def cell(): return xr.Dataset({"gain": gain()})
"""

TYPED = (
    "from hexmj.sweeps import Cell, run; from pathlib import Path; import remembers; remembers.gain();"
    " print(run([Cell('typed', remembers.cell, {})], Path('kept'))[0].gain.item())"
)


def test_what_is_remembered_by_what_is_typed_counts(tmp_path: Path) -> None:
    (tmp_path / "remembers.py").write_text(REMEMBERS)
    with sqlite3.connect(tmp_path / "gains.db") as base:
        base.execute("create table gains (x real)")
    for gain in (1.0, 2.0):
        (tmp_path / "gain.json").write_text(str(gain))
        told = subprocess.check_output([sys.executable, "-c", TYPED], cwd=tmp_path, env=ENVIRONMENT, text=True)
        assert float(told) == gain
    with base:
        base.execute("insert into gains values (5.0)")
    base.close()
    told = subprocess.check_output([sys.executable, "-"], cwd=tmp_path, env=ENVIRONMENT, text=True, input=TYPED)
    assert float(told) == 7.0


FINDS = (
    "import importlib\nfind = lambda name: importlib.import_module('gaits.' + name)",
    "from importlib import import_module as load\ndef find(name): return load (f'gaits.{name}')",
    "import pandas\ndef find(name): return pandas.read_pickle('wave.pkl')",
    "import hexmj\ndef find(name): return hexmj.load_controller('mine.py:Mine')",
)


@pytest.mark.parametrize("finds", FINDS, ids=range(4))
def test_a_module_that_is_found_counts_whoever_imported_it_first(tmp_path: Path, finds: str) -> None:
    (tmp_path / "finds.py").write_text(
        f"import xarray as xr\n{finds}\ndef cell(): return xr.Dataset({{'gain': find('wave').GAIN}})"
    )
    (tmp_path / "gaits").mkdir()
    (tmp_path / "script.py").write_text(
        "import pickle\nfrom pathlib import Path\nimport hexmj\nfrom hexmj.sweeps import Cell, run\n"
        "import finds, gaits.wave\nhexmj.load_controller('mine.py:Mine')\n"
        "if not Path('wave.pkl').exists(): Path('wave.pkl').write_bytes(pickle.dumps(gaits.wave.Of()))\n"
        "print(run([Cell('finds', finds.cell, {})], Path('kept'))[0].gain.item())"
    )
    for gain, more, kept in ((1.0, 0.0, 1), (1.0, 0.0, 1), (2.0, 0.0, 2), (2.0, 5.0, 3)):
        (tmp_path / "gaits" / "wave.py").write_text(
            f"GAIN = {gain} + float(open('gaits/more').read())\nclass Of:\n    GAIN = GAIN"
        )
        (tmp_path / "gaits" / "more").write_text(str(more))
        (tmp_path / "mine.py").write_text(MINE.format(gain + more))
        told = subprocess.check_output([sys.executable, "-B", "script.py"], cwd=tmp_path, env=ENVIRONMENT)
        assert (float(told), len(list((tmp_path / "kept").iterdir()))) == (gain + more, kept)


MINE = """
from dataclasses import dataclass
@dataclass(frozen=True)
class Mine:
    name: str = "mine"
    GAIN = {}
    def begin(self, starts, velocity, stride, acceleration=None, threads=None): ...
"""


def test_what_a_script_writes_is_no_scratch_of_its_controllers(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(
        "from hexmj.sweeps import Cell, run\nfrom pathlib import Path\nimport xarray as xr\n"
        "def cell():\n    return xr.Dataset({'gain': float(Path('ga' + 'in').read_text())})\n"
        "for gain in (1.0, 2.0, 1.0):\n    Path('gain').write_text(str(gain))\n"
        "    assert run([Cell('script', cell, {})], Path('kept'))[0].gain == gain\n"
    )
    subprocess.run([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT, check=True)
    assert len(list((tmp_path / "kept").iterdir())) == 2


def test_an_mjcf_that_cannot_be_read_is_nothing_to_the_import(tmp_path: Path) -> None:
    (tmp_path / "leg.xml").symlink_to("/proc/self/mem")
    (tmp_path / "script.py").write_text("LEG = 'leg.xml'\nimport hexmj\nprint(hexmj.LDVS.name)")
    assert subprocess.check_output([sys.executable, "script.py"], cwd=tmp_path, env=ENVIRONMENT) == b"ldvs\n"
