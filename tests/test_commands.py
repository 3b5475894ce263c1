"""The command line: help, options, answers, files, exit codes."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.cli.command import StudyCommand, imported
from hexmj.cli.main import COMMANDS, command
from hexmj.cli.options import NAMES
from hexmj.cli.output import four_digits, interval, table
from hexmj.controllers.cruse1998 import network_toml

STUDIES = [name for name in COMMANDS if isinstance(command(name), StudyCommand)]
SHORT = ["--velocity", 0.4, "--starts", 2, "--observation-time", 3]
FLSS = ["flss", "--velocity", 0.3, 0.6, "--starts", 100, "--observation-time", "start", "--json"]


def start_process(words: list[object], folder: Path, **options: object) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    how = {"cwd": folder, "env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-m", "hexmj", *map(str, words)], **how | options)  # pyright: ignore


# ---- help and options ----


def test_help_lists_all_commands_in_groups_and_imports_nothing_slow():
    script = "import sys; from hexmj.cli.main import main\ntry: main()\nfinally: print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script, "--help"], capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in COMMANDS)
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert not {"numpy", "mujoco", "numba", "xarray", "matplotlib", "scipy", "tyro"} & set(done.stderr.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_types_common_options_first_and_two_examples_that_parse(run, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = run(name, "--help")
    assert code == 0 and "None" not in out
    assert max(len(line) for line in out.splitlines() if not line.startswith("usage")) <= 80
    groups = [title for title in ("common options", f"{name} options", "execution options") if title in out]
    assert [out.index(title) for title in groups] == sorted(out.index(title) for title in groups)
    for example in command(name).examples:
        assert f"hexmj {name} {example}".rstrip() in out
        assert command(name).parse(name, shlex.split(example)).command == [name, *shlex.split(example)]


@pytest.mark.parametrize("name", STUDIES)
def test_every_field_of_a_study_and_its_conditions_is_an_option_or_hidden(name):
    chosen = command(name)
    assert isinstance(chosen, StudyCommand)
    study = imported(chosen.study)
    given, conditions = vars(chosen.parse(name, [])), hexmj.Conditions().values()
    expected = {NAMES.get(field.name, field.name) for field in fields(study)} - {*chosen.hidden}
    expected |= ({*conditions} if "conditions" in expected else set()) | {"dt", "geometry"}
    hidden = {*getattr(study, "hidden", ()), "conditions", "stride", "axes"}
    assert expected - hidden <= {*given}
    assert not {*getattr(study, "hidden", ())} & {*given}


@pytest.mark.parametrize("name", STUDIES)
def test_without_options_a_study_has_its_own_defaults(name):
    chosen = command(name)
    study = chosen.build(chosen.parse(name, ["slow"] * (name == "task")))  # pyright: ignore[reportAttributeAccessIssue]
    for field in fields(study):
        if field.name not in ("controller", "controllers", "axes", "tasks"):
            value = getattr(study, field.name)
            assert value == (tuple(field.default) if isinstance(value, tuple) else field.default)  # pyright: ignore


def test_options_reach_the_settings():
    words = "--controller hws --velocity 0.3 --starts 7 --seed 5 --vp 40 --geometry centred --dt 0.2 --load 1"
    words += " --order sequential --acceleration 0.01 --observation-time 40"
    chosen = command("compare")
    study = chosen.build(chosen.parse("compare", words.split()))  # pyright: ignore
    assert study.controllers["hws"].order == "sequential"
    assert (study.velocities, study.n_starts, study.seed, study.observation_time) == ((0.3,), 7, 5, 40.0)
    assert study.conditions == hexmj.Conditions(vp=40.0, load=1.0)
    assert study.stride == hexmj.Stride(dt=0.2, geometry=hexmj.CENTRED)
    assert study.acceleration == hexmj.Acceleration(0.01)
    words = "--vp 40 80 --centre-of-mass -2 0 --ground rough --ground-seed 3 4 --load 1"
    study = chosen.build(chosen.parse("compare", words.split()))  # pyright: ignore
    assert study.axes == {"vp": (40.0, 80.0), "centre_of_mass": (-2.0, 0.0), "ground_seed": (3, 4)}
    assert study.conditions.load == 1.0


def test_version_is_one_line(run):
    assert run("--version") == (0, f"hexmj {hexmj.__version__}\n", "")


@pytest.mark.slow
def test_completion_knows_commands_and_options(tmp_path):
    out = start_process(["--tyro-print-completion", "bash"], tmp_path).communicate(timeout=60)[0]
    assert "flss" in out and "--observation-time" in out


# ---- bad input ----

BAD = [
    "dance",
    "--nonsense",
    "flss --velocities 0.5",
    "flss --velocity fast",
    "flss --velocity 1.2",
    "flss --velocity",
    "flss --velocity 0.5 0.5",
    "flss --observation-time long",
    "flss --observation-time 1e300",
    "flss --starts 0",
    "flss --starts None",
    "flss --dt 0",
    "flss --geometry round",
    "flss --order x",
    "flss --order sequential --controller wilson",
    "flss --model-variant nothing",
    "flss --acceleration -1",
    "flss --pep-min 5",
    "flss --controller lvds",
    "flss --controller nowhere.py:Tripod",
    "flss --friction 0.5",
    "flss --feedback",
    "flss --measure physical --load -1",
    "flss --measure physical --ground gap --ground-height 5",
    "flss --threads 0",
    "flss --processes 0",
    "flss --out taken",
    "walk --start -1",
    "walk --velocity 2 --out new",
    "walk --physical --step-height 40",
    "walk --physical --vp nan",
    "compare --controller nowhere.toml",
    "compare --controller ldvs ldvs",
    "compare --vp",
    "compare --vp 40 40",
    "render a.nc b.nc c.nc d.nc e.nc f.nc g.nc",
    "render nowhere.nc",
    "render nowhere.nc --beside planned",
    "render --width 321",
    "render --beside no-such-controller",
    "page",
    "page taken",
    "view nowhere.nc",
    "view nowhere.nc --vp 40",
    "task",
    "task dance",
    "task nowhere.toml",
    "biology --periods 1",
    "league --controller",
    "league --tasks dance",
    "search --velocity 0.1 0.2 0.3",
    "search --form lvds",
    "search --load 1",
    "search --verdict-seed 0",
    "search --budget 0",
    "reproduce --only nothing",
    "check-controller",
    "check-controller nothing",
    "rerun nowhere",
]


@pytest.mark.parametrize("words", BAD)
def test_bad_input_ends_with_code_2_and_leaves_no_file(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    Path("taken").write_text("precious")
    code, out, error = run(*words.split())
    assert code == 2 and out == "" and error and "Traceback" not in error
    left = [path for path in Path().rglob("*") if path.is_file()]
    assert left == [Path("taken")] and Path("taken").read_text() == "precious"


# ---- answers ----


@pytest.mark.slow
def test_json_is_one_object_and_nothing_else_on_standard_output(tmp_path):
    out, _ = (running := start_process(FLSS, tmp_path)).communicate(timeout=60)
    assert running.returncode == 0
    answer, table = json.loads(out), hexmj.flss(hexmj.LDVS, [0.3, 0.6], n_starts=100, observation_time="start")
    for key in ("velocity", "flss", "low", "high"):
        assert answer[key] == table[key].values.tolist()
    assert answer["settings"]["observation_time"] == "start"


@pytest.mark.slow
def test_without_a_screen_films_are_rendered_by_egl(tmp_path):
    script = "import os; os.environ.pop('MUJOCO_GL', 0)\nfrom hexmj.cli.main import main\n"
    script += "main(); print(os.environ['MUJOCO_GL'])"
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run([sys.executable, "-c", script, "--version"], env=environment, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "egl"


@pytest.mark.parametrize("words", [[], ["--physical"]])
def test_a_walk_writes_a_recording_a_figure_and_a_manifest(run, tmp_path, words):
    code, text, _ = run("walk", "--velocity", 0.5, "--observation-time", 8, *words, "--out", tmp_path, "--json")
    assert code == 0
    recording = hexmj.load_recording(tmp_path / "recording.nc")
    walk = hexmj.walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 8.0)
    np.testing.assert_array_equal(recording.planned_stance.values, walk.stance[:, 0])
    assert ("grounded_margin" in recording) == bool(words)
    assert {Path(name).name for name in json.loads(text)["files"]} == {"recording.nc", "walk.png", "manifest.json"}
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["command"][0] == "walk" and manifest["settings"]["conditions"]["vp"] == 80.0
    assert {"hexmj", "mujoco", "numpy", "python"} <= {*manifest["versions"]}


@pytest.mark.slow
def test_compare_writes_the_same_bits_on_one_thread_and_two(run, tmp_path):
    words = [
        "compare",
        "--controller",
        "ldvs",
        "hws",
        "--velocity",
        0.6,
        "--starts",
        4,
        "--observation-time",
        20,
        "--json",
    ]
    answers, data = [], []
    for threads in (1, 2):
        code, text, _ = run(*words, "--threads", threads, "--out", tmp_path / str(threads))
        assert code == 0
        answers.append({key: value for key, value in json.loads(text).items() if key != "files"})
        data.append(hexmj.load(tmp_path / str(threads) / "comparison.nc"))
    assert answers[0] == answers[1] and data[0].identical(data[1])
    table = hexmj.compare({"ldvs": hexmj.LDVS, "hws": hexmj.HWS}, [0.6], n_starts=4, observation_time=20.0)
    assert answers[0]["physical"] == table.physical.values.tolist()


def test_physical_flss_counts_falls(run):
    code, text, _ = run(
        "flss", "--measure", "physical", "--velocity", 0.8, "--starts", 4, "--observation-time", 20, "--json"
    )
    assert code == 0
    table = hexmj.physical_flss(hexmj.LDVS, [0.8], n_starts=4, observation_time=20.0)
    assert json.loads(text)["flss"] == table.flss.values.tolist()


@pytest.mark.parametrize(
    ("words", "seeds"),
    [
        (["own-0.4"], {"own-0.4": [0]}),
        (["own-0.4-without-3"], {"own-0.4": [0]}),
        (["found.toml"], {"found.toml": [0]}),
        (["own-0.4", "--seed", 1998], {}),
        (["ldvs"], {}),
    ],
)
def test_answers_name_controllers_that_were_searched_on_the_same_starts(run, tmp_path, monkeypatch, words, seeds):
    monkeypatch.chdir(tmp_path)
    Path("found.toml").write_text(f"searched = {{seeds = [0]}}\n{network_toml(hexmj.HWS)}")
    code, text, _ = run("flss", "--controller", *words, *SHORT, "--json")
    assert code == 0 and json.loads(text)["searched"] == seeds


def test_a_quick_league_takes_its_sizes_unless_others_are_given():
    chosen = command("league")
    words = ["--quick", "--controller", "ldvs", "wilson", "--starts", "10"]
    built: Any = [chosen.build(chosen.parse("league", some)) for some in (words, ["--quick"])]  # pyright: ignore
    assert [study.n_starts for study in built] == [10, 8]
    assert [len(study.controllers) for study in built] == [2, 4] and len(built[0].tasks) == 14


# ---- ends ----


def test_a_simulation_that_fails_ends_with_code_1(run, tmp_path):
    code, _, error = run("walk", "--physical", "--settling-time", 1, "--out", tmp_path)
    assert code == 1 and error.startswith("hexmj: ")
    assert not (tmp_path / "recording.nc").exists()


@pytest.mark.slow
def test_ctrl_c_ends_with_code_130_and_the_command_resumes(tmp_path):
    words = ["flss", "--velocity", 0.1, "--starts", 40000, "--range-of", 200, "--out", "out", "--threads", 1]
    running = start_process(words, tmp_path)
    until = time.monotonic() + 60
    while not (cells := [*tmp_path.glob("out/walks/ldvs*.nc")]) and time.monotonic() < until:
        time.sleep(0.02)
    while running.poll() is None:  # Python ignores a Ctrl-C that comes while it finalises an object: press again
        running.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            running.wait(timeout=2)
    _, error = running.communicate(timeout=30)
    assert running.returncode == 130 and error.splitlines()[-1].startswith("hexmj: ")
    assert cells and not (tmp_path / "out" / "manifest.json").exists()
    then = {path: path.stat().st_mtime_ns for path in cells}
    again = start_process([*words, "--json"], tmp_path)
    answer = json.loads(again.communicate(timeout=60)[0])
    assert then == {path: path.stat().st_mtime_ns for path in cells}
    assert answer["flss"] == hexmj.flss(hexmj.LDVS, [0.1], n_starts=40000).flss.values.tolist()


def test_output_may_be_cut_off(tmp_path):
    with start_process(["flss", "--help"], tmp_path) as running:
        assert running.stdout and running.stderr
        running.stdout.close()
        assert "Traceback" not in running.stderr.read()


# ---- tables ----


def test_unknown_frequencies_are_dashes() -> None:
    known = {"flss": 0.5, "flss_low": 0.25, "flss_high": 0.75}
    assert interval(xr.Dataset(known), "flss") == "0.500 (.25-.75)"
    assert interval(xr.Dataset(dict.fromkeys(known, np.nan)), "flss") == "-"


@pytest.mark.parametrize(
    ("number", "shown"), [(0.25, "0.25"), (60.02666, "60.03"), (10127.3, "10127"), (9999.7, "10000")]
)
def test_numbers_have_four_digits_or_are_whole(number: float, shown: str) -> None:
    assert four_digits(number) == shown


def test_wide_tables_are_divided_and_no_cell_is_broken(monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    parts = [*table(["name", *"abcdef"], [["ldvs", *6 * ["0.123 (.01-.23)"]]])]
    assert [len(part.columns) for part in parts] == [3, 3, 3]
