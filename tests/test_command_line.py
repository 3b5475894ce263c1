"""What all commands share: help, one JSON object, names that a terminal lacks, and the line that ends an answer."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest

import hexmj
from hexmj.cli.commands import COMMANDS, options_of
from hexmj.controllers.cruse1998 import network_toml
from tiers import few_of


def test_help_names_every_command_and_imports_nothing_slow():
    script = "import sys; from hexmj.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script, "--help"], capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in COMMANDS)
    modules = set(done.stderr.split())
    assert "hexmj.cli.main" in modules
    assert not {"mujoco", "numba", "xarray", "matplotlib", "dm_control", "scipy"} & modules


@pytest.mark.parametrize("command", ["compare", "flss", "walk", "render", "search", "disturb"])
def test_every_command_has_help_with_units_and_defaults(run, command):
    code, out, _ = run(command, "--help")
    assert code == 0
    assert "[mm/s]" in out
    assert "(default: 80.0)" in out


@pytest.mark.parametrize(("command", "rivals"), [("league", True), ("variants", False)])
def test_help_tells_of_rivals_where_they_are_taken(run, command, rivals):
    """A rival has none of the constants of the 1998 network that vary."""
    assert ("a rival (wilson" in " ".join(run(command, "--help")[1].replace("│", " ").split())) == rivals


WALK = "compare", "flss", "walk", "render", "search", "converge", "terrain", "map", "disturb", "biology", "ablate"


@pytest.mark.parametrize("words", [*([one] for one in WALK), ["variants"], ["league"], ["league", "--quick"]])
def test_every_command_that_walks_tells_its_usual_conditions(words):
    """Of whoever walks unless others are asked for."""
    assert options_of(words).conditions_line().startswith("observation time ")


def test_version_is_one_line(run):
    assert run("--version") == (0, f"hexmj {version('hexmj')}\n", "")
    assert hexmj.__version__ == version("hexmj")


@pytest.mark.slow
def test_standard_output_is_one_json_object_and_nothing_else(tmp_path):
    words = ["flss", "--velocities", "0.1", "0.5", "--starts", "500", "--observation time", "start", "--json"]
    done = subprocess.run([sys.executable, "-m", "hexmj", *words], capture_output=True, text=True, check=True)
    answer = json.loads(done.stdout)
    table = hexmj.flss(hexmj.LDVS, [0.1, 0.5], n_starts=500, observation_time="start")
    for key in ("velocity", "flss", "low", "high"):
        assert answer[key] == table[key].values.tolist()
    assert answer["settings"]["observation_time"] == "start"
    assert answer["settings"]["seed"] == 0
    assert answer["sample_sd"] == [None, None]


@pytest.mark.slow
@pytest.mark.parametrize("encoding", few_of(["ascii", "latin-1", "utf-8"], "ascii"))
def test_names_that_the_terminal_lacks_are_written_as_it_can(tmp_path, encoding):
    (tmp_path / "snow.py").write_text(
        "import hexmj, dataclasses\nSnow = dataclasses.replace(hexmj.LDVS, name='\u2603')"
    )
    words = ["walk", "--model", "snow.py:Snow", "--velocity", "0.5", "--observation time", "2"]
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-m", "hexmj", *words], capture_output=True, env=environment, cwd=tmp_path, check=True
    )
    assert ("\u2603" if encoding == "utf-8" else r"\u2603") in done.stdout.decode(encoding)


SUMS = "from dataclasses import replace\nfrom hexmj import LDVS\nfrom hexmj.controllers.cruse1998 import Reading\n"
SUMS += "X = replace(LDVS, reading=Reading(cap='sum'), order='sequential')\n"


WEIGHTED = """
from dataclasses import dataclass, field
import numpy as np, hexmj

@dataclass(frozen=True)
class Weighted:
    weights: np.ndarray = field(default_factory=lambda: np.arange(3.0))
    name: str = "weighted"

    def begin(self, *how, **others):
        return hexmj.LDVS.begin(*how, **others)
"""


def test_weights_of_a_controller_of_ones_own_are_no_preset_s(run, tmp_path):
    (tmp_path / "mine.py").write_text(WEIGHTED)
    code, out, _ = run(
        "flss", "--model", f"{tmp_path}/mine.py:Weighted", "--velocities", 0.4, "--starts", 2, "--observation time", 3
    )
    assert code == 0 and "seed 0" in out and "a search found" not in out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--model", "lasting-0.1"], "; lasting-0.1: reading lasting"),
        (["--model", "sums.py:X"], "; sums.py:X: order sequential, reading cap sum"),
        (["--model", "sums.py:X", "--order", "undelayed"], "; order undelayed; sums.py:X: reading cap sum"),
        (["--model", "mine.toml"], "seed 0, on whose starts a search found own-0.4 (others: --seed 1998)"),
        (["--model", "own-0.4"], "seed 0, on whose starts a search found own-0.4 (others: --seed 1998)"),
        (["--model", "own-0.4-without-3"], "seed 0, on whose starts a search found own-0.4 (others: --seed 1998)"),
        (["--model", "copy.toml"], "seed 0, on whose starts a search found own-0.4 (others: --seed 1998)"),
        (["--model", "found.toml"], "seed 0, on whose starts a search found found.toml (others: --seed 1998)"),
        (["--model", "evolved"], "seed 0, on whose starts a search found evolved (others: --seed 1998)"),
        (["--pep0", -9, "--geometry", "centred"], "; seed 0; pep0 -9.0; geometry centred"),
    ],
)
def test_the_last_line_says_what_a_set_brings_along(run, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    Path("sums.py").write_text(SUMS)
    Path("copy.toml").write_text(network_toml(hexmj.PRESETS["own-0.4"]))
    found = network_toml(replace(hexmj.LDVS, weights=hexmj.Symmetric(p1_i=1.25)))
    Path("found.toml").write_text(f"searched = {{seeds = [0]}}\n{found}")
    Path("mine.toml").write_text("controller = 'own-0.4'\n[fields]\norder = 'undelayed'\n")
    short = ["--velocities", 0.4, "--starts", 2, "--observation time", 3]
    assert told in run("flss", *words, *short)[1].replace("\n", " ").replace("  ", " ")


@pytest.mark.parametrize("words", [["--model", "ldvs"], ["--model", "own-0.1"], ["--model", "own", "--seed", 1998]])
def test_the_last_line_is_silent_on_what_is_as_printed_and_fresh(run, words):
    out = run("flss", *words, "--velocities", 0.4, "--starts", 2, "--observation time", 3)[1]
    assert "found" not in out
    assert "model_variant" not in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--velocity", 0.5, "--ground-at", 60], True),
        (["--velocity", 0.5, "--ground-at", 60, "--observation time", 46], False),
        (["--velocity", 0.5, "--ground-at", 60, "--ground", "flat"], False),
    ],
)
def test_the_last_line_tells_of_a_ground_that_nobody_gets_to(run, tmp_path, words, told):
    """Front feet get to 38 mm ahead of where the body is told to be."""
    usual = ["--ground", "step"] if "--ground" not in words else []
    out = run("walk", "--physical", "--observation time", 20, *usual, *words, "--out", tmp_path / "walk")[1]
    assert ("; nobody gets to what lies ahead: 10 mm are walked at most" in " ".join(out.split())) == told
    assert ("nobody" in out) == told


@pytest.mark.parametrize(
    ("at", "told"), [(150, ""), (170, "; nobody gets to what lies ahead: 120 mm are walked at most")]
)
def test_a_walk_that_accelerates_gets_less_far(run, at, told):
    """In 400 time units 200 mm at V = 0.5, less (0.5 - 0.1)^2 / (2 a) that it is late, with front feet 38 mm ahead."""
    words = ["flss", "--physical", "--starts", 1, "--velocities", 0.5, "--observation time", 400, "--acceleration", 0.001]
    out = run(*words, "--initial-velocity", 0.1, "--ground", "step", "--ground-height", 0.1, "--ground-at", at)[1]
    assert told in " ".join(out.split()) and ("nobody" in out) == bool(told)


def test_the_last_line_tells_so_of_who_stands(run, tmp_path):
    words = ["walk", "--physical", "--velocity", 0, "--observation time", 10, "--ground", "step", "--ground-at", 5000]
    out = run(*words, "--out", tmp_path)[1]
    assert "; nobody gets to what lies ahead: 0 mm are walked at most" in " ".join(out.split())


@pytest.mark.slow
@pytest.mark.parametrize(("at", "told"), [(50, False), (1000, True)])
def test_the_last_line_tells_so_of_disturbed_walks(run, tmp_path, at, told):
    """They end some time after the disturbance, which comes when it comes."""
    words = ["disturb", "--velocities", 0.5, "--disturbances", "halt", "--strategies", "reorganise", "--starts", 1]
    out = run(*words, "--observation time", "start", "--ground", "step", "--ground-at", at, "--out", tmp_path)[1]
    assert ("nobody gets to what lies ahead: 1" in " ".join(out.split())) == told


@pytest.mark.parametrize(("observation_time", "told"), [(380, ""), (390, "; the bumps end 229 mm ahead, and the plane follows")])
def test_the_last_line_tells_of_bumps_that_end(run, observation_time, told):
    """15 of them, 12 mm apart, from 53 mm on, the last of which reaches 8 mm farther; front feet are 38 mm ahead."""
    words = ["flss", "--physical", "--starts", 1, "--velocities", 0.5, "--ground", "rough", "--ground-height", 0.2]
    out = run(*words, "--ground-at", 45, "--observation time", observation_time)[1]
    assert told in " ".join(out.split()) and ("bumps" in out) == bool(told)


@pytest.mark.slow
@pytest.mark.parametrize(("length", "told"), [(80, ""), (150, "; the bumps end 264 mm ahead, and the plane follows")])
def test_the_last_line_tells_of_bumps_that_end_before_other_obstacles(run, tmp_path, length, told):
    """All walk until they are past the longest gap, 15 mm behind which their front feet come 38 mm farther."""
    words = ["terrain", "--grounds", "rough", "gap", "--heights", 0.2, "--lengths", length, "--velocities", 0.5]
    out = run(*words, "--grasps", 0, "--starts", 1, "--out", tmp_path)[1]
    assert told in " ".join(out.split()) and ("bumps" in out) == bool(told)


@pytest.mark.thorough
def test_sets_of_each_velocity_are_named_where_their_starts_are_known(run, tmp_path):
    words = ["variants", "--models", "lasting-V", "--velocities", 0.3, 0.5, "--starts", 2, "--observation time", 3]
    out = run(*words, "--out", tmp_path)[1].replace("\n", " ").replace("  ", " ")
    assert "a search found lasting-0.3, lasting-0.5 (others: --seed 1998)" in out
    assert "; lasting-0.3: reading lasting; lasting-0.5: reading lasting" in out
