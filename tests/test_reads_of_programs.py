"""What programs open as they are imported counts for the cells that they sweep: scripts, packages, what was before."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from small_cells import BODY, WITHOUT_DASK
from tiers import few_of

NEW = "import xarray as xr\nfrom pathlib import Path\n"
SWEEPS = """
from hexmj.sweep import Cell, run_cells
if __name__ == "__main__":
    print(run_cells([Cell("swept", cell, {})], Path("kept"))[0].gain.item())
"""
READS = "def load(name):\n    return [float(path.read_text()) for path in (Path(name),)][0]\n"
GAIN = "def cell():\n    return xr.Dataset({'gain': GAIN})\n"


def sweep(folder: Path, *how: str, **files: str) -> tuple[float, int, str]:
    """What a script prints, how many cells are kept, and what it complains of."""
    for name, text in files.items():
        (path := folder / f"{name.replace('__', '/')}.py").parent.mkdir(exist_ok=True)
        path.write_text(text)
    command = [sys.executable, *how, "script.py"]
    done = subprocess.run(command, cwd=folder, env=WITHOUT_DASK, capture_output=True, text=True)
    kept = len(list((folder / "kept").iterdir())) if (folder / "kept").exists() else -1
    return float(done.stdout.split()[0] if done.stdout else "nan"), kept, done.stderr


SCRIPT = f"import hexmj\n{NEW}from mine import cell\n{SWEEPS}"
LOADS = f"{NEW}{READS}GAIN = load('ga' + 'in')\n{GAIN}"
CACHED = f"{NEW}from functools import cache\n@cache\n{READS}"
THREAD = f"from concurrent.futures import ThreadPoolExecutor as Threads\n{LOADS}"
PROGRAMS = {
    "a script": {"script": f"import hexmj\n{LOADS}{SWEEPS}"},
    "a module": {"mine": LOADS, "script": SCRIPT},
    "a helper": {
        "pk__gains": "import numpy as np\nGAIN = float(np.loadtxt('gain'))",
        "mine": f"{NEW}from pk.gains import GAIN\n{GAIN}",
        "script": SCRIPT,
    },
    **{
        f"a module in {folder}": {
            "lib__mine": LOADS,
            "script": SCRIPT.replace("import hexmj", f"import hexmj, sys\nsys.path.append({folder!r})"),
        }
        for folder in ("./lib", ".//lib", "lib/../lib")
    },
    "an installed helper as it is imported": {
        "site-packages__helper": "import numpy as np\nGAIN = float(np.loadtxt('gain'))",
        "mine": f"{NEW}from helper import GAIN\n{GAIN}",
        "script": SCRIPT.replace("import hexmj", "import hexmj, sys\nsys.path.append('site-packages')"),
    },
    **{
        f"a thread at import, {load}": {
            "mine": THREAD.replace("load('ga' + 'in')", f"float(Threads(1).submit({load}, 'gain').result())"),
            "script": SCRIPT,
        }
        for load in ("load", "__import__('numpy').loadtxt")
    },
    "an earlier sweep that kept nothing": {
        "mine": f"{CACHED}def cell():\n    return xr.Dataset({{'gain': load('gain')}})\n",
        "script": SCRIPT.replace("print", "run_cells([Cell('a', cell, {})]); print"),
    },
    "a module, while another thread sweeps": {
        "mine": LOADS,
        "other": f"{NEW}from threading import Event\nBEGUN, GO_ON = Event(), Event()\n"
        "def cell():\n    BEGUN.set()\n    GO_ON.wait()\n    return xr.Dataset({'gain': 1.0})\n",
        "script": SCRIPT.replace(
            "from mine",
            "from threading import Thread\nimport other\nfrom hexmj.sweeps import Cell, run\n"
            "beside = Thread(target=run, args=([Cell('beside', other.cell, {})],))\nbeside.start()\n"
            "other.BEGUN.wait()\nimport mine\nother.GO_ON.set()\nbeside.join()\nfrom mine",
        ),
    },
    "a helper that the script has called": {
        "helper": CACHED,
        "mine": f"{NEW}import helper\ndef cell():\n    return xr.Dataset({{'gain': helper.load('gain')}})\n",
        "script": SCRIPT.replace("import hexmj", "import hexmj, helper\nhelper.load('gain')"),
    },
}
"""Who opens the file `gain`, of which no name tells -> the files of such a program."""


@pytest.mark.slow
@pytest.mark.parametrize("program", few_of(PROGRAMS, "a script", "a helper", "a module, while another thread sweeps"))
def test_what_programs_open_is_noticed(tmp_path: Path, program: str) -> None:
    (tmp_path / "gain").write_text("2.0")
    assert sweep(tmp_path, **PROGRAMS[program]) == (2.0, 1, "")
    (tmp_path / "gain").write_text("3.0")
    assert sweep(tmp_path, **PROGRAMS[program]) == (3.0, 1, "")


@pytest.mark.thorough
def test_profiled_modules_are_heard_too(tmp_path: Path) -> None:
    """Code of a profiled script has a relative name."""
    for gain in (2.0, 3.0):
        (tmp_path / "gain").write_text(str(gain))
        assert sweep(tmp_path, "-m", "cProfile", "-o", os.devnull, **PROGRAMS["a module"]) == (gain, 1, "")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "first"), [("gain.toml", "import hexmj"), ("GAIN.CSV", "")])
def test_a_file_of_data_counts_that_a_text_names(tmp_path: Path, name: str, first: str) -> None:
    """Whoever is imported first; another in a folder that another text names."""
    (tmp_path / "data").mkdir()
    mine = f"{NEW}{READS}HERE = Path(__file__).parent / 'data'\nGAIN = load(HERE / '{name}')\n{GAIN}"
    for gain in (2.0, 3.0):
        (tmp_path / "data" / name).write_text(str(gain))
        assert sweep(tmp_path, mine=mine, script=SCRIPT.replace("import hexmj", first)) == (gain, 1, "")


@pytest.mark.slow
def test_a_log_that_a_cell_writes_is_no_reason_to_refuse_it(tmp_path: Path) -> None:
    mine = f"{NEW}def cell():\n    with open('log.txt', 'a') as log:\n        log.write('.')\n"
    mine += "    return xr.Dataset({'gain': 2.0})\n"
    for _ in range(3):
        assert sweep(tmp_path, mine=mine, script=SCRIPT) == (2.0, 1, "")
    assert (tmp_path / "log.txt").read_text() == "."


@pytest.mark.thorough
def test_a_log_that_a_script_names_and_writes_meanwhile_is_no_error(tmp_path: Path) -> None:
    """The script's texts name it, so it counts for a cell of the script; a controller in a file of its own is kept."""
    log = "LOG = open('log.txt', 'a')\nimport atexit\natexit.register(LOG.close)\n"
    cell = "def cell():\n    print('.', file=LOG, flush=True)\n    return xr.Dataset({'gain': 2.0})\n"
    gain, kept, complaint = sweep(tmp_path, script=f"import hexmj\n{NEW}{log}{cell}{SWEEPS}")
    assert (gain, kept) == (2.0, 0) and "log.txt has changed since it was opened first" in complaint
    gain, kept, complaint = sweep(
        tmp_path, mine=f"{NEW}def cell():\n    return xr.Dataset({{'gain': 2.0}})\n", script=SCRIPT + log
    )
    assert (gain, kept, complaint) == (2.0, 1, "")


def test_an_mjcf_that_changes_meanwhile_is_no_data_of_the_cell(tmp_path: Path) -> None:
    (tmp_path / "leg.xml").write_text(BODY.format(1.0))
    mine = f"{NEW}LEG = 'leg.xml'\ndef cell():\n    __import__('subprocess').run('echo >> leg.xml', shell=True)\n"
    gain, kept, complaint = sweep(tmp_path, mine=f"{mine}    return xr.Dataset({{'gain': 2.0}})\n", script=SCRIPT)
    assert (gain, kept) == (2.0, 0) and "leg.xml has changed since it was opened first" in complaint


@pytest.mark.slow
def test_a_module_that_is_found_by_a_computed_name_is_noticed(tmp_path: Path) -> None:
    mine = f"{NEW}import importlib\nGAIN = importlib.import_module('gaits.' + 'wave').GAIN\n{GAIN}"
    gain, kept, complaint = sweep(tmp_path, mine=mine, script=SCRIPT, gaits__wave="GAIN = 2.0")
    assert (gain, kept) == (2.0, 0) and "wave.py, of which" in complaint
    gain, kept, complaint = sweep(tmp_path, mine=f"import gaits.wave\n{mine}")
    assert (gain, kept, complaint) == (2.0, 1, "")


OTHER = (
    "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass Other:\n    name: str = 'other'\n"
    "    gain: float = 2.0\n    def begin(self, starts, velocity, stride, acceleration=None, threads=None): ...\n"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(["'best.toml'", "__import__('glob').glob('best*')[0]"], "'best.toml'"))
def test_what_a_script_loads_its_own_controllers_may_use(tmp_path: Path, name: str) -> None:
    script = f"import hexmj\n{NEW}BASE = hexmj.load_controller({name})\n"
    script += f"def cell():\n    return xr.Dataset({{'gain': BASE.gain}})\n{SWEEPS}"
    for gain in (2.0, 3.0):
        (tmp_path / "best.toml").write_text(f'controller = "other.py:Other"\nfields.gain = {gain}\n')
        assert sweep(tmp_path, script=script, other=OTHER) == (gain, 1, "")


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["nullcontext()", "ProcessPoolExecutor(1, get_context('spawn'))"])
def test_a_controller_that_a_script_loads_is_no_reason_to_refuse_its_own(tmp_path: Path, executor: str) -> None:
    script = f"import hexmj\n{NEW}BASE = hexmj.load_controller('other.py:Other')\n"
    script += f"def cell():\n    return xr.Dataset({{'gain': BASE.gain}})\n{SWEEPS}"
    script = script.replace("    print", f"    with {executor} as executor:\n        print")
    script = script.replace('Path("kept")', 'Path("kept"), executor=executor')
    pools = "from concurrent.futures import ProcessPoolExecutor\nfrom contextlib import nullcontext\n"
    pools += "from multiprocessing import get_context\n"
    assert sweep(tmp_path, script=pools + script, other=OTHER) == (2.0, 1, "")


@pytest.mark.slow
def test_a_controller_that_another_one_loads_by_name_is_noticed(tmp_path: Path) -> None:
    mine = f"{NEW}import hexmj\ndef cell():\n    gain = hexmj.load_controller('other.py:Other').gain\n"
    script = f"import hexmj\n{NEW}from mine import cell\nhexmj.load_controller('other.py:Other')\n{SWEEPS}"
    gain, kept, complaint = sweep(
        tmp_path, mine=f"{mine}    return xr.Dataset({{'gain': gain}})\n", other=OTHER, script=script
    )
    assert (gain, kept) == (2.0, 0) and "other.py, of which" in complaint


@pytest.mark.slow
@pytest.mark.parametrize("where", few_of(["leg.xml", "models/leg.xml"], "leg.xml"))
def test_an_mjcf_counts_that_a_text_names_with_what_it_includes(tmp_path: Path, where: str) -> None:
    """MuJoCo opens it where nobody hears it."""
    (tmp_path / "models").mkdir()
    (tmp_path / where).write_text('<mujoco><include file="inner.xml"/></mujoco>')
    path = "Path(__file__).parent / " + repr(where).replace("/", "' / '")
    mine = f"{NEW}import mujoco\ndef cell():\n    body = mujoco.MjModel.from_xml_path(str({path}))\n"
    mine += "    return xr.Dataset({'gain': body.body_mass[1]})\n"
    for mass in (1.0, 2.0):
        (tmp_path / where).with_name("inner.xml").write_text(BODY.format(mass))
        assert sweep(tmp_path, mine=mine, script=SCRIPT) == (mass, 1, "")


@pytest.mark.slow
def test_a_command_says_in_one_line_what_is_not_kept(tmp_path: Path) -> None:
    (tmp_path / "gain.py").write_text("GAIN = 2.0")
    tripod = (Path(__file__).parents[1] / "examples" / "tripod.py").read_text()
    (tmp_path / "mine.py").write_text(f"{tripod}\nGAIN = __import__('importlib').import_module('ga' + 'in')\n")
    words = [
        "flss",
        "--model",
        "mine.py:Tripod",
        "--velocities",
        "0.5",
        "--starts",
        "5",
        "--observation time",
        "5",
        "--out",
        "out",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "hexmj", *words], cwd=tmp_path, env=WITHOUT_DASK, capture_output=True, text=True
    )
    said = [line for line in done.stderr.splitlines() if "not kept" in line]
    assert len(said) == 1 and said[0].startswith("hexmj: tripod-V-0.5-from-0 is not kept: its code opens or runs ")
    assert "UserWarning" not in done.stderr and not list((tmp_path / "out" / "walks").iterdir())


def test_what_a_script_writes_between_sweeps_its_controllers_may_remember(tmp_path: Path) -> None:
    script = f"{NEW}from hexmj.sweeps import Cell, run\n"
    script += "def cell():\n    return xr.Dataset({'gain': float(Path('ga' + 'in').read_text())})\n"
    script += "for gain in (1.0, 2.0):\n    Path('gain').write_text(str(gain))\n"
    script += "    assert run_cells([Cell('script', cell, {})], Path('kept'))[0].gain == gain\nprint(gain)\n"
    gain, kept, complaint = sweep(tmp_path, script=script)
    assert (gain, kept) == (2.0, 1) and "gain has changed since it was opened first" in complaint


def test_an_mjcf_that_cannot_be_read_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "leg.xml").symlink_to("/proc/self/mem")
    *_, complaint = sweep(tmp_path, mine=f"{NEW}LEG, GAIN = 'leg.xml', 2.0\n{GAIN}", script=SCRIPT)
    assert complaint.endswith("leg.xml cannot be read: Input/output error\n")
