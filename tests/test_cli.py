"""The command line: JSON, files, exit codes, and the same bits whatever the threads."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from film_reader import read_film
from hexmj.cli.main import COMMANDS
from hexmj.errors import SimulationError
from hexmj.loaded import importable

PNG = b"\x89PNG"


def test_help_names_every_command_and_imports_nothing_slow():
    script = "import sys; from hexmj.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script, "--help"], capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in COMMANDS)
    assert not {"mujoco", "numba", "xarray", "matplotlib", "dm_control", "scipy"} & set(done.stderr.split())


@pytest.mark.parametrize("command", ["compare", "flss", "walk", "render", "search", "disturb"])
def test_every_command_has_help_with_units_and_defaults(run, command):
    code, out, _ = run(command, "--help")
    assert code == 0
    assert "[mm/s]" in out
    assert "(default: 80.0)" in out


def test_version_is_one_line(run):
    assert run("--version") == (0, f"hexmj {version('hexmj')}\n", "")


def test_bash_completes_commands_and_options_and_nothing_else(run, tmp_path):
    code, script, _ = run("--completion", "bash")
    assert code == 0
    (tmp_path / "hexmj.bash").write_text(script)
    for words, known in (
        ("ren", {"render"}),
        ("flss --st", {"--starts", "--step-height", "--standing-height"}),
        ("flss --window ", {"walk", "start"}),
        ("walk --order un", {"undelayed"}),
        ("view --host ", set()),
        ("flss --out hexmj.", {"hexmj.bash"}),
    ):
        typed = ["hexmj", *re.sub(" $", " ''", words).split()]
        ask = f"source hexmj.bash; COMP_WORDS=({' '.join(typed)}); COMP_CWORD={len(typed) - 1}; _tyro_hexmj"
        told = subprocess.run(
            ["bash", "-c", ask + '; echo "${COMPREPLY[@]}"'], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert set(told.stdout.split()) == known


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_shell_is_told_what_each_command_does(run, shell):
    _, script, _ = run("--completion", shell)
    assert "'view': {'description': 'Look at an insect while it walks, or at a recording: in MuJoCo’s viewer" in script
    assert not [name for name in COMMANDS if f"'{name}': {{'description': '{name}'" in script]


def test_fish_completes_by_a_pipe_since_no_argument_may_be_so_long(run, tmp_path):
    code, script, _ = run("--completion", "fish")
    assert code == 0
    assert re.findall(r".*\$python_cmd .*", script) == [
        '    set -l results (printf "%s\\n" "$pycode" | $python_cmd - $words $current)'
    ]
    if fish := shutil.which("fish"):
        (tmp_path / "hexmj.fish").write_text(script)
        ask = [fish, "--no-config", "-c", "source hexmj.fish; complete -C 'hexmj ren'"]
        told = subprocess.run(ask, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert told.stdout.split()[0] == "render"


@pytest.mark.parametrize(
    "words", [["--completion"], ["--completion", "ksh"], ["flss", "--tyro-print-completion", "sh"]]
)
def test_other_shells_are_refused_in_a_sentence(run, words):
    code, out, error = run(*words)
    assert (code, out) == (2, "")
    assert error.startswith("hexmj: ") and error.endswith("expected one of bash, zsh, fish\n")
    assert words != ["--completion"] or error == "hexmj: --completion stands alone; expected one of bash, zsh, fish\n"


def test_kinematic_side_never_imports_mujoco():
    script = (
        "import sys, numpy as np, hexmj\n"
        "hexmj.flss(hexmj.LDVS, [0.5], n_starts=10); hexmj.walk(np.zeros((1, 6)), hexmj.LDVS, 0.5, 10.0)\n"
        "assert 'mujoco' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_standard_output_is_one_json_object_and_nothing_else(tmp_path):
    words = ["flss", "--velocities", "0.1", "0.5", "--starts", "500", "--window", "start", "--json"]
    done = subprocess.run([sys.executable, "-m", "hexmj", *words], capture_output=True, text=True, check=True)
    answer = json.loads(done.stdout)
    table = hexmj.flss(hexmj.LDVS, [0.1, 0.5], n_starts=500, window="start")
    for key in ("velocity", "flss", "low", "high"):
        assert answer[key] == table[key].values.tolist()
    assert answer["settings"]["window"] == "start"
    assert answer["settings"]["seed"] == 0
    assert answer["sample_sd"] == [None, None]


def test_compare_writes_the_same_bits_with_one_and_two_threads(run, tmp_path):
    words = ["compare", "--velocities", 0.4, 0.6, "--starts", 12, "--window", "start", "--json", "--no-video"]
    answers, datasets = [], []
    for threads in (1, 2):
        out = tmp_path / str(threads)
        code, text, _ = run(*words, "--threads", threads, "--out", out)
        assert code == 0
        answers.append({key: value for key, value in json.loads(text).items() if key != "files"})
        datasets.append(xr.load_dataset(out / "comparison.nc"))
        assert (out / "comparison.png").read_bytes().startswith(PNG)
    assert answers[0] == answers[1]
    assert datasets[0].identical(datasets[1])
    assert answers[0]["velocity"] == [0.4, 0.6]
    for model in ("ldvs", "uncoordinated"):
        assert {"kinematic", "measured", "physical", "agreement"} <= set(answers[0][model])
    data = datasets[0]
    assert data.fall.attrs["units"] == "time unit"
    assert data.sizes == {"controller": 2, "velocity": 2, "start": 12, "leg": 6}
    manifest = json.loads((tmp_path / "1" / "manifest.json").read_text())
    assert manifest["settings"]["seed"] == 0
    assert manifest["settings"]["conditions"]["vp"] == 80.0
    assert {"mujoco", "numpy", "hexmj"} <= set(manifest["versions"])


def test_compare_makes_a_video_of_a_gait_and_its_tables_break_no_name(run, monkeypatch, tmp_path):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run(
        *("compare", "--models", "ldvs", "uncoordinated", "--velocities", 0.5, "--starts", 4, "--window", 30),
        *("--out", tmp_path),
    )
    assert code == 0
    assert len(re.findall(r"^ ?uncoordinated  0\.5 ", out, re.MULTILINE)) == 2
    video, fps = read_film(tmp_path / "gait.mp4")
    assert fps == 30
    assert len(video) == round(30 / 80 * 30 * 2)


@pytest.mark.slow
def test_without_rendering_compare_still_delivers(tmp_path):
    """MuJoCo is told to use a screen that is not there: numbers and figure come, and a sentence on what is missing."""
    words = [
        "compare",
        "--models",
        "ldvs",
        "--velocities",
        "0.5",
        "--starts",
        "4",
        "--window",
        "20",
        "--out",
        str(tmp_path),
    ]
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "MUJOCO_GL": "glfw"}
    done = subprocess.run([sys.executable, "-m", "hexmj", *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0
    assert "libegl1" in done.stderr
    assert (tmp_path / "comparison.png").exists()
    assert not (tmp_path / "gait.mp4").exists()


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_names_that_the_terminal_lacks_are_written_as_it_can(tmp_path, encoding):
    (tmp_path / "snow.py").write_text(
        "import hexmj, dataclasses\nSnow = dataclasses.replace(hexmj.LDVS, name='\u2603')"
    )
    words = ["walk", "--model", "snow.py:Snow", "--velocity", "0.5", "--window", "2"]
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-m", "hexmj", *words], capture_output=True, env=environment, cwd=tmp_path, check=True
    )
    assert ("\u2603" if encoding == "utf-8" else r"\u2603") in done.stdout.decode(encoding)


def test_compiled_code_that_is_torn_is_a_sentence(run, monkeypatch, tmp_path):
    """As the module of numba raises it that keeps and finds code."""
    (tmp_path / "caching.py").write_text("def load(*_, **__): raise EOFError('Ran out of input')")
    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", importable(tmp_path / "caching.py").load)
    code, text, error = run("flss", "--starts", 5, "--window", 10)
    assert (code, text) == (2, "")
    assert "hexmj: numba cannot find or keep compiled code; delete its files" in error
    assert "(EOFError: Ran out of input)" in error


def test_memory_that_runs_out_is_a_sentence(run, monkeypatch):
    def run_out(*_, **__):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr("hexmj.measures.kinematic.first_loss", run_out)
    code, text, error = run("flss", "--starts", 5, "--window", 10)
    assert (code, text) == (2, "")
    assert "hexmj: the memory does not suffice (Unable to allocate 9 TiB); expected fewer starts" in error


def test_physical_flss(run, tmp_path):
    words = ["flss", "--physical", "--vp", 200, "--velocities", 0.5, "--starts", 10, "--window", "start"]
    code, text, _ = run(*words, "--json", "--out", tmp_path)
    answer = json.loads(text)
    assert code == 0
    conditions = hexmj.Conditions.of(vp=200.0)
    expected = hexmj.physical_flss(hexmj.LDVS, [0.5], n_starts=10, window="start", conditions=conditions)
    assert answer["flss"] == expected.flss.values.tolist()
    assert answer["settings"]["conditions"]["vp"] == 200.0
    assert xr.load_dataset(tmp_path / "flss.nc").flss.values.tolist() == answer["flss"]
    code, text, _ = run(*words)
    assert "vp 200" in text
    assert "step_height 12" in text


def test_accelerated_flss(run):
    code, text, _ = run(
        "flss", "--velocities", 0.3, "--starts", 50, "--acceleration", 0.001, "--window", "start", "--json"
    )
    assert code == 0
    assert json.loads(text)["duration"] == [pytest.approx(240.0)]


@pytest.mark.parametrize("physical", [False, True])
def test_walk(run, tmp_path, physical):
    words = ["walk", "--velocity", 0.5, "--window", 40, "--start", 3, "--json", "--out", tmp_path]
    code, text, _ = run(*words, *(["--physical"] if physical else []))
    assert code == 0
    answer = json.loads(text)
    lost = hexmj.first_loss(hexmj.draw_starts(4, 0)[3:], hexmj.LDVS, 0.5, 40.0)[0]
    assert answer["planned loss"] == (lost if np.isfinite(lost) else None)
    assert ("fall" in answer) == physical
    assert (tmp_path / "walk.png").read_bytes().startswith(PNG)
    assert hexmj.load_recording(tmp_path / "recording.nc").sizes["step"] == 400


def test_render_from_a_recording_and_side_by_side(run, tmp_path):
    walk = ["--velocity", 0.5, "--window", 16]
    run("walk", *walk, "--physical", "--out", tmp_path / "walk")
    for name, words, width in (
        ("ldvs-V-0.5", [tmp_path / "walk" / "recording.nc"], 320),
        ("ldvs-V-0.5-beside-planned", [*walk, "--beside", "planned"], 640),
        ("ldvs-V-0.5-beside-uncoordinated", [*walk, "--beside", "uncoordinated"], 640),
    ):
        film = ["--width", 320, "--height", 240, "--fps", 20, "--slow-motion", 4]
        code, text, _ = run("render", *words, *film, "--json", "--out", tmp_path / "films")
        assert code == 0
        video, fps = read_film(tmp_path / "films" / f"{name}.mp4")
        assert fps == 20
        assert json.loads(text)["frames"] == len(video) == round(16 / 80 * 4 * 20)
        assert video.shape[1:] == (240, width, 3)
    assert len([*(tmp_path / "films").glob("*.mp4")]) == len([*(tmp_path / "films").glob("*-manifest.json")]) == 3
    code, _, error = run("render", tmp_path / "walk" / "recording.nc", *film, "--out", tmp_path / "films")
    assert code == 0
    assert "ldvs-V-0.5.mp4 was there; the new film takes its place" in error


SEARCH = ["search", "--form", "hws", "--velocities", 0.3, 0.6, "--window", "start", "--starts", 40, "--budget", 40,
          "--refine-starts", 100, "--refine-budget", 20, "--verdict-starts", 500]  # fmt: skip


@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
def test_search_writes_a_controller_that_can_be_used_and_reports_it_again(run, tmp_path, algorithm):
    words = [*SEARCH, "--algorithm", algorithm, "--out", tmp_path]
    code, text, _ = run(*words, "--json")
    assert code == 0
    answer = json.loads(text)
    assert answer["replayed"] == 0
    found = hexmj.load_controller(str(tmp_path / "found.toml"))
    assert found == hexmj.Cruse1998(hexmj.Symmetric(**answer["found"]), name="found")
    history = xr.load_dataset(tmp_path / "history.nc")
    assert history.sizes == {"evaluation": answer["evaluations"], "parameter": 9}
    assert history.best.values[-1] == answer["cost"]
    assert json.loads(history.attrs["settings"])["effort"]["algorithm"] == algorithm
    for name, one in (("found", found), ("hws", hexmj.HWS), ("ldvs", hexmj.LDVS)):
        flss, interval = hexmj.flss_over_range(one, 0.3, 0.6, n_starts=500, window="start", seed=1998)
        assert answer["verdict"][name]["start"] == {"flss": flss, "flss_low": interval[0], "flss_high": interval[1]}
        assert "walk" in answer["verdict"][name]
    assert (tmp_path / "convergence.png").read_bytes().startswith(PNG)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["settings"]["effort"]["algorithm"] == algorithm
    files = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    code, text, _ = run(*words)
    assert code == 0
    different = len(np.unique(history.candidate.values[history.stage == 0], axis=0))
    different += len(np.unique(history.candidate.values[history.stage == 1], axis=0))
    assert f"{answer['evaluations']} evaluations, {different} candidates known from an earlier run" in text
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == files


def test_the_order_of_updates_reaches_the_network(run, tmp_path):
    words = ["search", "--form", "hws", "--begin", "hws", "--velocity", 0.4, "--window", "start", "--starts", 300,
             "--budget", 10, "--refine-budget", 0, "--verdict-starts", 200, "--json"]  # fmt: skip
    starts = hexmj.draw_starts(300, 0)
    for order in ("printed", "sequential"):
        code, text, _ = run(*words, "--order", order, "--out", tmp_path / order)
        assert code == 0
        assert json.loads(text)["settings"]["problem"]["form"]["order"] == order
        lost = hexmj.first_loss(starts, hexmj.Cruse1998(hexmj.HWS.weights, order), 0.4, 40.0)
        history = xr.load_dataset(tmp_path / order / "history.nc")
        assert history.cost.values[0] == np.isfinite(lost).mean()
    code, _, error = run(*words, "--order", "sideways", "--out", tmp_path)
    assert code == 2
    assert "valid names: printed, undelayed, sequential" in error


def test_a_killed_search_ends_like_an_unbroken_one(run, tmp_path):
    changed = {"100": "20000", "20": "40"}  # refined for longer
    words = [*(changed.get(str(word), str(word)) for word in SEARCH), "--json", "--out"]
    running = subprocess.Popen(
        [sys.executable, "-m", "hexmj", *words, str(tmp_path / "killed")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    kept = tmp_path / "killed" / "evaluations"
    while sum(len(path.read_text().splitlines()) - 1 for path in kept.glob("*.jsonl")) < 20:
        assert running.poll() is None
        time.sleep(0.01)
    running.kill()
    assert running.wait() == -9
    assert [path.name for path in (tmp_path / "killed").iterdir()] == ["evaluations"]
    answers = [json.loads(run(*words, tmp_path / name)[1]) for name in ("killed", "unbroken")]
    assert 0 < answers[0]["replayed"] < answers[0]["evaluations"]
    for key in ("found", "cost", "verdict", "evaluations", "settings"):
        assert answers[0][key] == answers[1][key]
    datasets = [xr.load_dataset(tmp_path / name / "history.nc") for name in ("killed", "unbroken")]
    assert datasets[0].identical(datasets[1])


def test_a_search_that_is_stopped_by_hand_keeps_its_evaluations(run, tmp_path, monkeypatch):
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hexmj.search.stages.refine", stop)
    code, out, error = run(*SEARCH, "--out", tmp_path)
    assert (code, out) == (130, "")
    assert error.endswith("hexmj: stopped; what is finished is kept. Repeat the command to go on\n")
    (kept,) = (tmp_path / "evaluations").glob("population-*.jsonl")
    assert len(kept.read_text().splitlines()) == 1 + 37


def test_physical_search(run, tmp_path):
    words = ["search", "--physical", "--velocity", 0.6, "--window", "start", "--vp", 200, "--starts", 3, "--budget", 10]
    words += ["--refine-budget", 0, "--verdict-starts", 4, "--json", "--out", tmp_path]
    code, text, _ = run(*words)
    assert code == 0
    answer = json.loads(text)
    fell = hexmj.physical_flss(
        hexmj.load_controller(str(tmp_path / "found.toml")), [0.6], n_starts=4, window="start", seed=1998,
        conditions=hexmj.Conditions.of(vp=200.0),
    )  # fmt: skip
    assert answer["verdict"]["found"]["start"]["flss"] == fell.flss.item()
    assert answer["settings"]["problem"]["conditions"]["vp"] == 200.0


OWN = """
from dataclasses import dataclass

import numpy as np

from hexmj.controllers import Step, stepwise


@dataclass(frozen=True)
class Waits:
    \"""The legs of a side swing one after the other, and both sides alike or not.\"""

    share: float = 0.5
    shift: float = 0.1
    name: str = "waits"
    legs: int = 6

    def __post_init__(self):
        if self.share > 5:
            raise ValueError("share")

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        time, x = 0.0, starts.copy()
        offsets = np.tile([0.0, self.share, 2 * self.share], 2) + np.repeat([0.0, self.shift], 3)

        def step(v):
            nonlocal time, x
            time += stride.dt
            period = (stride.aep0 - stride.pep0) * (1 + 1 / v[:, None])
            stands = (time / period + offsets) % 1 < 1 / (1 + v[:, None])
            x = np.clip(np.where(stands, x - v[:, None] * stride.dt, x + stride.dt), stride.pep_min, stride.aep0)
            return Step(x, stands)

        return stepwise(step, starts, velocity, stride, acceleration)
"""


def test_a_controller_of_ones_own_is_searched(run, tmp_path):
    """Its float fields, from their usual values; the found one can be named like any other."""
    (tmp_path / "mine.py").write_text(OWN)
    form = f"{tmp_path / 'mine.py'}:Waits"
    words = ["search", "--form", form, "--velocity", 0.4, "--window", "start", "--starts", 40, "--budget", 28]
    words += ["--refine-starts", 60, "--refine-budget", 8, "--verdict-starts", 50, "--json", "--out", tmp_path]
    code, text, error = run(*words)
    assert code == 0, error
    answer = json.loads(text)
    assert set(answer["found"]) == {"share", "shift"}
    usual, found = hexmj.load_controller(form), hexmj.load_controller(str(tmp_path / "found.toml"))
    assert {name: getattr(found, name) for name in ("share", "shift")} == answer["found"]
    assert found.name == usual.name == "waits"
    for name, one in (("usual", usual), ("found", found)):
        flss = hexmj.flss(one, [0.4], n_starts=50, window="start", seed=1998).flss.item()
        assert answer["verdict"][name]["start"]["flss"] == flss
    history = xr.load_dataset(tmp_path / "history.nc")
    assert history.candidate.values[0].tolist() == [0.5, 0.1]
    refused = history.candidate.values[:, 0] > 5
    assert (history.cost.values[refused] == 1.0).all()
    code, text, _ = run(*[word for word in words if word != "--json"])
    assert code == 0
    assert "share" in text and "usual" in text


def test_a_search_goes_on_from_what_one_has_found_but_not_over_it(run, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    first, again, form = tmp_path / "first", tmp_path / "again", f"{tmp_path / 'mine.py'}:Waits"
    words = ["search", "--velocity", 0.4, "--window", "start", "--starts", 20, "--budget", 10, "--refine-budget", 0]
    words += ["--verdict-starts", 20]
    assert run(*words, "--form", form, "--out", first)[0] == 0
    found = first / "found.toml"
    found.write_text(found.read_text() + 'name = "gewählt"\n')
    for option in (["--form", found], ["--form", form, "--begin", found]):
        code, _, error = run(*words, *option, "--out", first)
        assert code == 2
        assert "the search begins with found.toml there; expected another folder" in error
    assert run(*words, "--form", found, "--out", again)[0] == 0
    one = hexmj.load_controller(str(again / "found.toml"))
    assert type(one).__name__ == "Waits"
    assert one.name == "gewählt"


NONSENSE = [
    (["reproduce", "--only", "nothing"], "claim 'nothing'; valid keys: "),
    (["reproduce", "--quick", "--seed", "-1"], "seed = -1"),
    (["search", "--velocity", "1"], "expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0.5", "0.1"], "velocity range 0.5 to 0.1; expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0.1", "1.5"], "expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0", "0.5"], "has no period"),
    (["search", "--velocity", "0.1", "--velocities", "0.1", "0.5"], "expected one velocity or one range"),
    (["search", "--begin", "ldvs", "--form", "hws"], "ldvs has weights that the form hws lacks; expected a set of it"),
    (["search", "--begin", "own-0.1", "--form", "ldvs"], "own-0.1 has weights that the form ldvs lacks"),
    (["flss", "--physical", "--ground-height", "5"], "--ground-height with --ground flat; expected it with a ground"),
    (
        ["flss", "--physical", "--ground", "gap", "--ground-height", "5"],
        "--ground-height with --ground gap; expected",
    ),
    (["walk", "--physical", "--ground", "step", "--ground-seed", "4"], "--ground-seed with --ground step; expected it"),
    (
        ["flss", "--velocities", "0.3", "--velocities", "0.5"],
        "--velocities was given twice; expected",
    ),
    (["flss", "--pep-min", "-15", "--pep_min", "-12"], "--pep-min was given twice; expected every option once"),
    (["flss", "--out", ""], "'' stands alone; expected options, each with its values"),
    (["terrain", "--processes", "1" + 23 * "0"], "expected at least 1 and at most 1000"),
    (["reproduce", "--only"], "--only without keys; expected at least one"),
    (["walk", "--window", "1e7"], "expected at least one step, 0.1, and at most 1e+06 time units"),
    (["walk", "--physical", "--ground", "hurdle", "--ground-length", "1e-300"], "cannot be built: "),
    (["walk", "--physical", "--ground", "rough", "--ground-seed", "9" * 30], "expected a whole number of at least 0"),
    (["render", "--window", "1", "--fps", "1e-300"], "fps = 1e-300; expected 1 to 240"),
    (["flss", "--starts", "5", "--"], "'--' stands alone; expected options, each with its values"),
    (["flss", "--aep0", "1e308", "--pep0=-1e308", "--pep-min=-1e308"], "expected aep0, pep0 and pep_min between"),
    (["search", "--population", "0"], "expected a whole number of at least 2"),
    (["search", "--algorithm", "cmaes", "--population", "1"], "expected a whole number of at least 4"),
    (["search", "--budget", "0"], "at least one generation, 10 evaluations"),
    (["search", "--refine-starts", "0"], "starts = 0; expected"),
    (["search", "--verdict-starts", "0"], "starts = 0; expected"),
    (["search", "--verdict-seed", "0"], "expected another, for fresh starts"),
    (["search", "--domain", "nan"], "domain = nan; expected"),
    (["search", "--form", "lvds"], "forms of the 1998 network: hws, ldvs, mirrored, general"),
    (["search", "--form", "own"], "no field of the type float"),
    (["search", "--refine-starts", "9", "--refine-budget", "0"], "expected evaluations that walk them"),
    (["search", "--window", "long"], "valid names: walk, start"),
    (["search", "--over", "mean", "--pep0", "-16"], "pep_min = -15.0, pep0 = -16.0"),
    (["variants", "--models", "own-V", "--velocities", "0.15"], "own-0.15"),
    (["variants", "--friction", "0.5"], "--friction without --physical"),
    (["variants", "--physical", "--contact-gap", "0.01"], "--contact-gap = 0.01 with falls only"),
    (["flss", "--model", "lvds"], "hws, ldvs, uncoordinated"),
    (["flss", "--velocities", "1.2"], "0 <= V < 1"),
    (["flss", "--velocities", "fast"], "Could not find valid parse for arguments: ['fast']"),
    (["flss", "--velocity", "0.1"], "Unrecognized options"),
    (["flss", "--window", "long"], "valid names: walk, start"),
    (["flss", "--starts", "0"], "at least 1"),
    (["flss", "--dt", "0"], "dt = 0.0; expected"),
    (["flss", "--geometry", "round"], "fig1"),
    (["flss", "--acceleration", "-1"], "above 0"),
    (["walk", "--start", "-1"], "at least 0"),
    (["walk", "--physical", "--step-height", "40"], "step_height = 40.0; expected above 0 and at most 14 mm"),
    (["walk", "--physical", "--vp", "nan"], "vp = nan; expected"),
    (["compare", "--models", "nowhere.toml"], "nor a TOML file"),
    (["compare", "--models", "ldvs", "ldvs"], "none of them twice"),
    (["flss", "--window", "1e300"], "at most"),
    (["flss", "--starts", "100000000000000"], "at most 100000000"),
    (["flss", "--physical", "--contact-gap", "-1"], "contact_gap = -1.0; expected 0 to 1000 ms"),
    *(
        ([*words, "--contact-gap", "5"], "--contact-gap = 5 with falls only; expected it where a polygon is measured")
        for words in (["flss", "--physical"], ["terrain"], ["disturb"], ["search", "--physical"])
    ),
    (["flss", "--pep-min", "5"], "hexmj: pep_min = 5.0, pep0 = -10.0, aep0 = 10.0 mm; expected"),
    (["flss", "--model", "x" * 400], "neither one of hws, ldvs"),
    (["flss", "--out", "results/flss/manifest.json"], "is a file; expected a folder"),
    (["render", *(f"{n}.nc" for n in range(7))], "7 recordings were given; expected 1 to 6"),
    (["render", "a.nc", "--beside", "planned"], "--beside was given with recordings"),
    (["render", "--slow-motion", "1e12"], "expected 0.001 to 1000"),
    (["render", "--camera", "behind"], "following"),
    (["render", "--format", "avi"], "gif"),
    (["flss", "--format", "pdf"], "--format pdf without --out; expected it where a figure is written"),
    (["render", "--width", "321"], "even number"),
    (["render", "nowhere.nc"], "nowhere.nc"),
    (["render", "--beside", "nobody"], "hws, ldvs, uncoordinated"),
    (["render", "a.nc", "--seed", "1"], "--seed was given with recordings"),
    (["flss", "--friction", "0.5"], "--friction without --physical; expected it only where"),
    (["flss", "--feedback"], "--feedback without --physical"),
    (["search", "--load", "1"], "--load without --physical"),
    (["walk", "--ground", "step"], "--ground without --physical"),
    (
        ["walk", "--initial-velocity", "0.2"],
        "--initial-velocity = 0.2 without --acceleration; expected it with that only",
    ),
    (["flss", "--physical", "--load", "-1"], "load = -1.0; expected 0 to 10"),
    (["flss", "--order", "x"], "valid names: printed, undelayed, sequential"),
    (["walk", "--physical", "--order", "printed", "--model", "nowhere.py:Tripod"], "nowhere.py is no file"),
    (["map", "--processes", "0"], "--processes = 0; expected at least 1"),
    (["check-controller", "nothing"], "nor module:object or file.py:object"),
    (["dance"], "compare, flss, walk, render, page, view, search"),
]


@pytest.mark.parametrize(
    ("words", "sentence"), NONSENSE, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_nonsense_gets_a_sentence_and_code_2_and_leaves_results_alone(run, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    results = [tmp_path / "results" / words[0] / name for name in ("manifest.json", "recording.nc", "gait.mp4")]
    for path in results:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious")
    code, out, error = run(*words)
    assert code == 2
    assert sentence in " ".join(error.replace("│", " ").split())
    assert out == ""
    assert all(path.read_text() == "precious" for path in results)


def test_a_folder_that_is_a_file(run, tmp_path):
    (tmp_path / "taken").write_text("precious")
    code, _, error = run("walk", "--out", tmp_path / "taken")
    assert code == 2
    assert "expected a folder" in error
    assert (tmp_path / "taken").read_text() == "precious"
    (tmp_path / "results" / "manifest.json").mkdir(parents=True)
    code, _, error = run("walk", "--out", tmp_path / "results")
    assert code == 2
    assert "manifest.json is a folder there" in error
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["manifest.json"]


def test_bad_input_makes_no_folder(run, tmp_path):
    assert run("walk", "--velocity", 2, "--out", tmp_path / "new")[0] == 2
    assert not (tmp_path / "new").exists()


def test_the_puppet_of_a_plan_obeys_the_path_of_its_feet(run, tmp_path):
    words = ["walk", "--velocity", 0.5, "--window", 16, "--step-height", 6, "--vp", 40, "--out", tmp_path]
    assert run(*words)[0] == 0
    recording = xr.load_dataset(tmp_path / "recording.nc")
    lift = np.ptp(recording.planned_tip.sel(coordinate="z").values)
    assert lift == pytest.approx(6.0, abs=0.5)
    assert recording.seconds.values[-1] == pytest.approx(16 / 40)


def test_a_simulation_that_fails_ends_with_code_1(run, tmp_path):
    code, _, error = run("walk", "--physical", "--settling-time", 1, "--out", tmp_path)
    assert code == 1
    assert "did not settle" in error
    assert not Path(tmp_path / "recording.nc").exists()


@pytest.mark.parametrize("out", [True, False])
def test_the_state_of_a_simulation_that_diverged_is_kept_with_the_results(run, tmp_path, monkeypatch, out):
    def diverge(*_: object, **how: object) -> None:
        raise SimulationError("start 3 diverged", {"qpos": np.arange(3.0)}, "diverged-start-3.npz")

    monkeypatch.setattr("hexmj.measures.compare.physical_flss", diverge)
    monkeypatch.chdir(tmp_path)
    code, _, error = run("flss", "--physical", *(["--out", tmp_path / "results"] if out else []))
    assert code == 1
    path = tmp_path / "results" / "diverged-start-3.npz"
    if out:
        assert (
            f"start 3 diverged; its last good state is in {path}; python -m hexmj.physics.divergence {path} replays it"
            in error
        )
        assert np.load(path)["qpos"].tolist() == [0.0, 1.0, 2.0]
        assert list(tmp_path.iterdir()) == [path.parent]
    else:
        assert "start 3 diverged; give --out to keep its last good state there" in error
        assert not list(tmp_path.iterdir())


def test_check_controller_says_what_is_wrong(run, tmp_path):
    code, out, _ = run("check-controller", "ldvs")
    assert code == 0
    *laws, last = out.splitlines()
    assert all(line.startswith("well   ") for line in laws)
    assert last.startswith("note   sliding: ")
    wrong = OWN.replace("return Step(x, stands)", "return Step(x * np.nan, stands)")
    (tmp_path / "mine.py").write_text(wrong)
    code, out, _ = run("check-controller", f"{tmp_path / 'mine.py'}:Waits", "--json")
    assert code == 1
    answer = json.loads(out)
    assert not answer["well"]
    assert [one["found"] for one in answer["checks"] if not one["well"]]


def test_reproduce_judges_chosen_claims(run, tmp_path):
    words = ["reproduce", "--quick", "--only", "ldvs-accelerated", "--json", "--out", tmp_path]
    code, text, _ = run(*words)
    assert code == 0
    (claim,) = json.loads(text)["claims"]
    assert claim["key"] == "ldvs-accelerated"
    assert set(claim["ours"]) == {"walk", "start"}
    assert claim["command"].endswith("--only ldvs-accelerated --quick")
    assert (tmp_path / "claims.md").is_file()


SUMS = "from dataclasses import replace\nfrom hexmj import LDVS\nfrom hexmj.controllers.cruse1998 import Reading\n"
SUMS += "X = replace(LDVS, reading=Reading(cap='sum'), order='sequential')\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--model", "lasting-0.1"], "; lasting-0.1: reading lasting"),
        (["--model", "sums.py:X"], "; sums.py:X: order sequential, reading cap sum"),
        (["--model", "sums.py:X", "--order", "undelayed"], "; order undelayed; sums.py:X: reading cap sum"),
        (["--model", "own-0.4"], "seed 0, on whose starts a search found own-0.4 (others: --seed 1998)"),
    ],
)
def test_the_last_line_says_what_a_set_brings_along(run, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    Path("sums.py").write_text(SUMS)
    short = ["--velocities", 0.4, "--starts", 2, "--window", 3]
    assert told in run("flss", *words, *short)[1].replace("\n", " ").replace("  ", " ")


@pytest.mark.parametrize("words", [["--model", "ldvs"], ["--model", "own-0.1"], ["--model", "own", "--seed", 1998]])
def test_the_last_line_is_silent_on_what_is_as_printed_and_fresh(run, words):
    out = run("flss", *words, "--velocities", 0.4, "--starts", 2, "--window", 3)[1]
    assert "found" not in out
    assert "reading" not in out


@pytest.mark.slow
def test_sets_of_each_velocity_are_named_where_their_starts_are_known(run, tmp_path):
    words = ["variants", "--models", "lasting-V", "--velocities", 0.3, 0.5, "--starts", 2, "--window", 3]
    out = run(*words, "--out", tmp_path)[1].replace("\n", " ").replace("  ", " ")
    assert "a search found lasting-0.3, lasting-0.5 (others: --seed 1998)" in out
    assert "; lasting-0.3: reading lasting; lasting-0.5: reading lasting" in out
