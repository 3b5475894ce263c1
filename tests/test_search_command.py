"""The command search: what it writes and tells, and that it goes on however it was stopped."""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.cli.commands import options_of
from hexmj.controllers.cruse1998 import MODEL_VARIANTS, Cruse1998
from hexmj.controllers.cruse1998 import network_toml
from hexmj.controllers.registry import searched_on
from tiers import few_of
from waiting_legs import OWN

PNG = b"\x89PNG"

SEARCH = ["search", "--form", "hws", "--velocities", 0.3, 0.6, "--observation time", "start", "--starts", 40, "--budget", 40,
          "--refine-starts", 100, "--refine-budget", 20, "--verdict-starts", 500]  # fmt: skip


def found_on(path: Path) -> dict[str, list[int]]:
    """What a file tells of the searches that found it."""
    return searched_on(str(path), hexmj.load_controller(str(path)))


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
def test_search_writes_a_controller_that_can_be_used_and_reports_it_again(run, tmp_path, algorithm):
    words = [*SEARCH, "--algorithm", algorithm, "--out", tmp_path]
    code, text, _ = run(*words, "--json")
    assert code == 0
    answer = json.loads(text)
    assert answer["replayed"] == 0
    found = hexmj.load_controller(str(tmp_path / "found.toml"))
    assert found == hexmj.Cruse1998(hexmj.Symmetric(**answer["found"]), name="found")
    assert [*found_on(tmp_path / "found.toml").values()] == [[0]]
    history = xr.load_dataset(tmp_path / "history.nc")
    assert history.sizes == {"evaluation": answer["evaluations"], "parameter": 9}
    assert history.best.values[-1] == answer["cost"]
    assert json.loads(history.attrs["settings"])["effort"]["algorithm"] == algorithm
    for name, one in (("found", found), ("hws", hexmj.HWS), ("ldvs", hexmj.LDVS)):
        flss, interval = hexmj.flss_over_range(one, 0.3, 0.6, n_starts=500, observation_time="start", seed=1998)
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
    lost = (history.cost.values == 1).sum()
    assert (f"; {lost} cost 1: all of their starts were lost, or they do not walk" in " ".join(text.split())) == (
        lost > 0
    )
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == files


def test_the_order_of_updates_reaches_the_network(run, tmp_path):
    words = ["search", "--form", "hws", "--begin", "hws", "--velocity", 0.4, "--observation time", "start", "--starts", 300,
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


@pytest.mark.thorough
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


@pytest.mark.slow
def test_physical_search(run, tmp_path):
    words = ["search", "--physical", "--velocity", 0.6, "--observation time", "start", "--vp", 200, "--starts", 3, "--budget", 10]
    words += ["--refine-budget", 0, "--verdict-starts", 4, "--json", "--out", tmp_path]
    code, text, _ = run(*words)
    assert code == 0
    answer = json.loads(text)
    fell = hexmj.physical_flss(
        hexmj.load_controller(str(tmp_path / "found.toml")), [0.6], n_starts=4, observation_time="start", seed=1998,
        conditions=hexmj.Conditions(vp=200.0),
    )  # fmt: skip
    assert answer["verdict"]["found"]["start"]["flss"] == fell.flss.item()
    assert answer["settings"]["problem"]["conditions"]["vp"] == 200.0


@pytest.mark.slow
def test_a_controller_of_ones_own_is_searched(run, tmp_path):
    """Its float fields, from their usual values; the found one can be named like any other."""
    (tmp_path / "mine.py").write_text(OWN)
    form = f"{tmp_path / 'mine.py'}:Waits"
    words = ["search", "--form", form, "--velocity", 0.4, "--observation time", "start", "--starts", 40, "--budget", 28]
    words += ["--refine-starts", 60, "--refine-budget", 8, "--verdict-starts", 50, "--json", "--out", tmp_path]
    code, text, error = run(*words)
    assert code == 0, error
    answer = json.loads(text)
    assert set(answer["found"]) == {"share", "shift"}
    usual, found = hexmj.load_controller(form), hexmj.load_controller(str(tmp_path / "found.toml"))
    assert {name: getattr(found, name) for name in ("share", "shift")} == answer["found"]
    assert (found.name, usual.name) == ("found", "waits")
    for name, one in (("usual", usual), ("found", found)):
        flss = hexmj.flss(one, [0.4], n_starts=50, observation_time="start", seed=1998).flss.item()
        assert answer["verdict"][name]["start"]["flss"] == flss
    history = xr.load_dataset(tmp_path / "history.nc")
    assert history.candidate.values[0].tolist() == [0.5, 0.1]
    refused = history.candidate.values[:, 0] > 2
    assert refused.any() and (history.cost.values[refused] == 1.0).all()
    code, text, _ = run(*[word for word in words if word != "--json"])
    assert code == 0
    assert "share" in text and "usual" in text


HEIR = """
from dataclasses import dataclass, replace
import hexmj

@dataclass(frozen=True)
class Stretched(hexmj.Cruse1998):
    weights: object = hexmj.LDVS.weights
    name: str = "stretched"
    gain: float = 1.0
    reading: str = "a word of its own"

    def begin(self, *how):
        w = self.weights
        return hexmj.Cruse1998(replace(w, p1_i=self.gain * w.p1_i)).begin(*how)
"""


LEAVES = """
from dataclasses import dataclass
from pathlib import Path
import hexmj
from hexmj.controllers import Step, stepwise

@dataclass(frozen=True)
class Leaves:
    gain: float = 1.0
    name: str = "leaves"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        if len(starts) > 5:
            raise hexmj.InputError("too many walk")
        return stepwise(lambda v: Step(starts, True), starts, velocity, stride, acceleration)

@dataclass(frozen=True)
class Edits:
    gain: float = 1.0
    table: str = str(Path(__file__).with_name("table.txt"))
    name: str = "edits"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        if len(starts) > 5:
            Path(self.table).write_text("others")
        return stepwise(lambda v: Step(starts, True), starts, velocity, stride, acceleration)
"""


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Leaves", "the verdict on found: too many walk; what was found is in "),
        ("Edits", "while the command was at work; start"),
    ],
)
def test_what_is_found_is_written_though_the_verdict_on_it_fails(run, tmp_path, name, why):
    (tmp_path / "leaves.py").write_text(LEAVES)
    (tmp_path / "table.txt").write_text("some")
    words = ["--form", f"{tmp_path / 'leaves.py'}:{name}", "--observation time", 2, "--starts", 5, "--budget", 3]
    words += ["--population", 2, "--refine-budget", 0, "--verdict-starts", 6, "--out", tmp_path]
    code, printed, error = run("search", *words)
    assert code == 2 and not printed and why in error
    assert vars(hexmj.load_controller(str(tmp_path / "found.toml")))["name"] == "found"


@pytest.mark.slow
@pytest.mark.parametrize("begin", few_of(["ldvs", "lasting-0.3"], "lasting-0.3"))
def test_a_search_begins_with_a_set_whose_candidates_read_the_legs(run, tmp_path, begin):
    words = ["--begin", begin, "--form", "mirrored", "--physical", "--feedback", "--velocity", 0.9]
    words += ["--observation time", 5, "--starts", 2]
    words += ["--budget", 2, "--population", 2, "--refine-budget", 0, "--verdict-starts", 2, "--out", tmp_path]
    assert run("search", *words)[0] == 0


@pytest.mark.thorough
def test_an_heir_of_the_network_is_searched_as_itself(run, tmp_path):
    """It is no set of weights: neither what is found nor what a search of weights can begin with."""
    (tmp_path / "heir.py").write_text(HEIR)
    form = f"{tmp_path / 'heir.py'}:Stretched"
    words = ["--velocity", 0.4, "--observation time", "start", "--starts", 10, "--budget", 4, "--population", 2]
    words += ["--refine-budget", 0, "--verdict-starts", 5, "--json", "--out", tmp_path / "out"]
    code, text, error = run("search", "--form", form, *words)
    assert code == 0, error
    found = hexmj.load_controller(str(tmp_path / "out/found.toml"))
    assert type(found).__name__ == "Stretched"
    assert {"gain": vars(found)["gain"]} == json.loads(text)["found"]
    code, _, error = run("search", "--begin", form, *words[:-1], tmp_path / "weights")
    assert code == 2
    assert "stretched is not made of weights alone" in error
    for words in (["flss"], ["variants", "--out", tmp_path / "variants", "--models"]):
        model = ["--model", form] if words == ["flss"] else [form]
        code, text, error = run(*words, *model, "--velocities", 0.4, "--starts", 5, "--observation time", "start")
        assert code == 0, error
    assert "reading a word of its own" in text


ODD = """
from collections.abc import Mapping
from dataclasses import dataclass, field
import hexmj

@dataclass(frozen=True)
class Odd:
    λ: float = 1.0
    gains: Mapping[str, float] = field(default_factory=dict)
    cap: float | None = None
    name: str = "odd"

    def begin(self, *how):
        return hexmj.LDVS.begin(*how)
"""


@pytest.mark.parametrize("name", ["begun.toml", "begun.conf"])
def test_what_is_found_is_read_again_whatever_its_fields_are_called_and_hold(run, tmp_path, name):
    (tmp_path / "odd.py").write_text(ODD, encoding="utf-8")
    begun = tmp_path / name
    begun.write_text(f'controller = "{tmp_path}/odd.py:Odd"\n[fields]\ncap = inf\n[fields.gains]\nfront = 2.0\n')
    words = ["search", "--form", begun, "--velocity", 0.5, "--observation time", 1, "--starts", 2, "--budget", 2]
    words += ["--population", 2, "--refine-budget", 0, "--verdict-starts", 2, "--out", tmp_path]
    assert run(*words)[0] == 0
    found = hexmj.load_controller(str(tmp_path / "found.toml"))
    first: Any = hexmj.load_controller(str(begun))
    assert found == replace(first, name="found")


@pytest.mark.slow
def test_a_search_goes_on_from_what_one_has_found_but_not_over_it(run, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    first, again, form = tmp_path / "first", tmp_path / "again", f"{tmp_path / 'mine.py'}:Waits"
    words = ["search", "--velocity", 0.4, "--observation time", "start", "--starts", 20, "--budget", 10, "--refine-budget", 0]
    words += ["--verdict-starts", 20]
    assert run(*words, "--form", form, "--out", first)[0] == 0
    found = first / "found.toml"
    found.write_text(found.read_text() + 'name = "gewählt"\n')
    for option in (["--form", found], *(["--form", form, "--begin", f"{found}{part}"] for part in ("", "-without-1"))):
        code, _, error = run(*words, *option, "--out", first)
        assert code == 2
        assert "the search begins with found.toml there; expected another folder" in error
    code, _, error = run(*words, "--form", f"{found}-without-1", "--out", again)
    assert code == 2 and f"--form = {found}-without-1; expected {found}, or the controller" in " ".join(error.split())
    code, _, error = run(*words, "--form", found, "--seed", 1, "--verdict-seed", 0, "--out", again)
    assert code == 2 and "--verdict-seed = 0 is that of the search that found what this one begins with" in error
    assert run(*words, "--form", found, "--seed", 1, "--out", again)[0] == 0
    assert [*found_on(again / "found.toml").values()] == [[0, 1]]
    one = hexmj.load_controller(str(again / "found.toml"))
    assert type(one).__name__ == "Waits"
    assert one.name == "gewählt"


@pytest.mark.parametrize(
    ("begin", "seed"), [("own-0.4-without-3", 0), ("robust-0.3", 0), ("robust-0.3", 5), ("mine.toml-without-3", 7)]
)
def test_a_verdict_on_starts_of_earlier_searches_is_refused(run, tmp_path, monkeypatch, begin, seed):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(f"searched = {{ seeds = [7] }}\n{network_toml(hexmj.LDVS)}")
    words = ["--begin", begin, "--seed", 1, "--verdict-seed", seed, "--form", "mirrored"]
    code, _, error = run("search", *words, "--out", tmp_path / "out")
    assert code == 2 and f"--verdict-seed = {seed} is that of the search" in error
    assert not (tmp_path / "out").exists()


def test_a_search_with_ties_says_what_its_cost_is(run, tmp_path):
    words = ["--form", "hws", "--ties", "later", "--observation time", "10", "--starts", 10, "--budget", 10, "--refine-budget", 0]
    code, shown, _ = run("search", *words, "--verdict-starts", 20, "--out", tmp_path)
    told = " ".join(shown.split())
    assert code == 0 and "later losses first among equals" in told
    assert "((starts lost + mean part of the time lost) / (starts + 1), at which " in told
    assert " of 10 starts were lost)" in told


def test_a_search_begins_with_a_set_of_another_reading_where_one_is_given(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "import dataclasses, hexmj\nfrom hexmj.controllers.cruse1998 import Reading\n"
    text += "X = dataclasses.replace(hexmj.LDVS, reading=Reading(cap='sum'), name='x')\n"
    (tmp_path / "own.py").write_text(text)
    words = ["search", "--form", "ldvs", "--begin", "own.py:X", "--velocity", 0.5, "--starts", 4, "--budget", 10]
    words += ["--refine-budget", 0, "--verdict-starts", 4, "--observation time", 5]
    code, _, error = run(*words)
    said = "--begin = own.py:X: its reading has no name; expected --reading beside it, one of printed, lasting"
    assert code == 2 and said in error
    code, out, _ = run(*words, "--reading", "lasting", "--json")
    assert code == 0 and json.loads(out)["settings"]["problem"]["form"]["model_variant"]["ipsilateral"] == "lasting"


def test_a_search_keeps_the_rules_of_the_set_that_it_begins_with(tmp_path):
    """Unless others are given; what it finds walks by them."""
    sizes = ["--starts", "4", "--budget", "10", "--refine-budget", "0", "--verdict-starts", "4", "--observation time", "start"]
    words = ["search", "--form", "mirrored", "--begin", "lasting-0.3", *sizes]
    for added, expected in ([], "lasting"), (["--reading", "printed"], "printed"):
        options_of([*words, *added, "--out", str(tmp_path / expected)]).run()
        found = hexmj.load_controller(str(tmp_path / expected / "found.toml"))
        assert isinstance(found, Cruse1998)
        assert found.model_variant == MODEL_VARIANTS[expected]
