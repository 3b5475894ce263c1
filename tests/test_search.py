"""A search lowers the cost, resumes with the same bits, and writes a controller with a verdict on fresh starts."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj import Effort, FieldsForm, NetworkForm, Problem
from hexmj.controllers.cruse1998 import MODEL_VARIANTS, Cruse1998, network_toml
from hexmj.controllers.registry import searched_on
from hexmj.errors import InputError
from hexmj.search.forms import named_form
from hexmj.search.problems import Sample
from hexmj.search.results import run_search
from hexmj.search.stages import Stage, search
from pace import Pace

HWS = NetworkForm("hws")
PROBLEM = Problem(HWS, 0.5, 0.5, observation_time="start")
EFFORT = Effort(budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)
FEW = Effort(budget=30, starts=20, refine_budget=0)
SMALL: Any = {"budget": 10, "starts": 10, "refine_budget": 0, "verdict_starts": 20}


def cached_costs(folder: Path) -> list[str]:
    return [line for path in folder.iterdir() for line in path.read_text().split("\n") if line]


def test_a_search_lowers_the_cost():
    found = search(PROBLEM, EFFORT)
    history = found.history
    assert set(history.stage.values.tolist()) == {0, 1}
    assert int((history.stage == 0).sum()) == 100
    assert Sample(PROBLEM, 200, EFFORT.seed).costs(found.vector[None]) == [found.cost]
    uncoordinated = history.cost.values[0]
    first = history.isel(evaluation=np.argmax(history.stage.values == 1)).cost.item()
    assert found.cost <= first < uncoordinated
    assert found.cost == history.best.values[-1] == history.cost.values[100:].min()
    assert (np.diff(history.best.values[:100]) <= 0).all()
    assert hexmj.plot(history).axes[0].get_lines()


@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
def test_a_stopped_search_resumes_with_the_same_bits(tmp_path: Path, algorithm: Any):
    effort = replace(EFFORT, algorithm=algorithm)
    whole, done = search(PROBLEM, effort), 0.0

    def stop(fraction: float) -> None:
        nonlocal done
        done += fraction
        if done > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(PROBLEM, effort, folder=tmp_path, progress=stop)
    assert 0 < len(cached_costs(tmp_path)) < whole.history.sizes["evaluation"]
    resumed = search(PROBLEM, effort, folder=tmp_path, threads=1)
    assert resumed.vector.tobytes() == whole.vector.tobytes() and resumed.cost == whole.cost
    assert resumed.history.identical(whole.history)


def test_no_candidate_is_evaluated_twice_unless_the_search_is_fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    whole = search(PROBLEM, FEW, folder=tmp_path)
    search(PROBLEM, replace(FEW, budget=40), folder=tmp_path)
    costs = cached_costs(tmp_path)
    assert len(costs) == len({*costs}) > len(np.unique(whole.history.candidate.values, axis=0))
    search(PROBLEM, FEW, folder=tmp_path, fresh=True)
    assert len(cached_costs(tmp_path)) < len(costs)
    monkeypatch.setattr(Sample, "_times", lambda *_: pytest.fail("walked again"))
    assert search(PROBLEM, FEW, folder=tmp_path).history.identical(whole.history)


def test_another_search_leaves_the_cached_evaluations_alone(tmp_path: Path):
    search(PROBLEM, FEW, folder=tmp_path)
    (file,) = tmp_path.iterdir()
    before = file.read_bytes()
    for problem, effort in (
        (replace(PROBLEM, low=0.4), FEW),
        (replace(PROBLEM, form=NetworkForm("hws", "sequential")), FEW),
        (PROBLEM, replace(FEW, starts=21)),
        (PROBLEM, replace(FEW, seed=1)),
    ):
        search(problem, effort, folder=tmp_path)
    assert file.read_bytes() == before and len([*tmp_path.iterdir()]) == 5


WALKED: list[int] = []
"""Numbers of candidates in the calls of `Squares.costs`."""


@dataclass(frozen=True)
class Squares:
    """A sample whose costs are a third of the squares' sum."""

    problem: Problem = PROBLEM

    def costs(self, vectors: np.ndarray, threads: int | None = None) -> np.ndarray:
        WALKED.append(len(vectors))
        return (vectors**2).sum(axis=1) / 3


def test_cached_costs_have_the_same_bits_and_lose_at_most_a_torn_line(tmp_path: Path):
    def cached() -> Any:
        sample: Any = Squares()
        return Stage("population", sample, tmp_path, fresh=False).costs

    rows = np.random.default_rng(1).standard_normal((20, 9))
    first, direct = cached(), (rows**2).sum(axis=1) / 3
    values = np.concatenate([first(rows[:7]), first(rows[[3, 8, 8, 9]])[1:], first(rows[10:])])
    assert values.tobytes() == direct[[*range(7), 8, 8, 9, *range(10, 20)]].tobytes()
    assert cached()(rows).tobytes() == direct.tobytes() and WALKED == [7, 2, 10, 1]
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-5])
    assert cached()(rows).tobytes() == direct.tobytes() and WALKED[4:] == [1]


@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
def test_what_is_found_is_written_and_judged_on_fresh_starts(tmp_path: Path, algorithm: Any):
    problem = Problem(HWS, 0.3, 0.6, observation_time="start")
    result = run_search(problem, Effort(algorithm, **SMALL | {"verdict_starts": 500}), tmp_path)
    found = hexmj.load_controller(str(tmp_path / "found.toml"))
    answer = json.loads(json.dumps(result.summary(), default=str))
    assert found == Cruse1998(hexmj.Symmetric(**answer["found"]), name="found")
    assert searched_on(str(tmp_path / "found.toml")) == {str(tmp_path / "found.toml"): [0]}
    for name, one in {"found": found, "hws": hexmj.HWS, "ldvs": hexmj.LDVS}.items():
        flss, interval = hexmj.flss_over_range(one, 0.3, 0.6, n_starts=500, observation_time="start", seed=1998)
        assert answer["verdict"][name] == {"flss": flss, "flss_low": interval[0], "flss_high": interval[1]}
    history = xr.load_dataset(tmp_path / "history.nc")
    assert history.best.values[-1] == answer["cost"]
    assert json.loads(history.attrs["settings"])["effort"]["algorithm"] == algorithm
    assert all(path.stat().st_size for path in result.files)


def test_the_command_reports_a_finished_search_again(run: Any, tmp_path: Path):
    sizes = "--starts 10 --budget 10 --refine-budget 0 --verdict-starts 20"
    line = f"search --form hws --velocity 0.3 0.6 --observation-time 10 --ties later {sizes}"
    words = [*line.split(), "--out", tmp_path]
    code, text, _ = run(*words, "--json")
    answer = json.loads(text)
    assert code == 0
    code, text, _ = run(*words)
    assert code == 0 and f"{answer['evaluations']} evaluations; " in text
    assert json.loads((tmp_path / "manifest.json").read_text())["settings"] == answer["settings"]


@pytest.mark.slow
def test_a_physical_search_counts_falls(tmp_path: Path):
    conditions = hexmj.Conditions(vp=200.0)
    problem = Problem(NetworkForm("mirrored"), 0.9, 0.9, 5.0, measure="physical", conditions=conditions, feedback=True)
    effort = Effort(begin="ldvs", population=2, budget=2, starts=2, refine_budget=0, verdict_starts=4)
    answer = run_search(problem, effort, tmp_path).summary()
    found = hexmj.SensoryFeedback(hexmj.load_controller(str(tmp_path / "found.toml")))
    fell = hexmj.physical_flss(found, [0.9], n_starts=4, observation_time=5.0, seed=1998, conditions=conditions)
    assert answer["verdict"]["found"]["flss"] == fell.flss.item()


def test_another_controller_is_searched_by_name_and_searched_on(tmp_path: Path):
    """The search continues from what an earlier one found, with its other fields."""
    (tmp_path / "begun.toml").write_text('controller = "pace:Pace"\n[fields]\ngood = 2.5\nname = "paced"\n')
    problem = Problem(named_form(str(tmp_path / "begun.toml")), 0.4, 0.4, 5.0)
    effort = Effort(**SMALL, seed=1)
    result = run_search(problem, effort, tmp_path)
    found = hexmj.load_controller(str(tmp_path / "found.toml"))
    assert found == Pace(*result.found.vector.tolist(), name="paced")
    assert result.found.history.candidate.values[0].tolist() == [2.5, -0.5]
    assert result.verdict.controller.values.tolist() == ["found", "usual"]
    again = Problem(named_form(str(tmp_path / "found.toml")), 0.4, 0.4, 5.0)
    with pytest.raises(InputError, match="begins with"):
        run_search(again, replace(effort, seed=2), tmp_path)
    with pytest.raises(InputError, match="verdict_seed"):
        run_search(again, replace(effort, seed=2, verdict_seed=1), tmp_path / "again")
    run_search(again, replace(effort, seed=2), tmp_path / "again")
    name = str(tmp_path / "again" / "found.toml")
    assert searched_on(name) == {name: [1, 2]}


@pytest.mark.parametrize(
    ("begin", "seed"), [("own-0.4-without-3", 0), ("robust-0.3", 5), ("mine.toml-without-3", 7), (None, 1)]
)
def test_verdict_starts_of_an_earlier_search_are_refused(tmp_path, monkeypatch, begin, seed):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(f"searched = {{ seeds = [7] }}\n{network_toml(hexmj.LDVS)}")
    problem = Problem(NetworkForm("mirrored"), 0.4, 0.4, 5.0)
    with pytest.raises(InputError, match="verdict_seed"):
        run_search(problem, Effort(**SMALL, begin=begin, seed=1, verdict_seed=seed), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_search_keeps_order_and_model_variant_of_its_beginning(tmp_path: Path):
    begin = hexmj.PRESETS["lasting-0.3"]
    for given, expected in ((None, "lasting"), (MODEL_VARIANTS["printed"], "printed")):
        form = named_form("mirrored", begin, model_variant=given)
        run_search(Problem(form, 0.3, 0.3, 5.0), Effort(**SMALL, begin="lasting-0.3"), tmp_path / expected)
        found = hexmj.load_controller(str(tmp_path / expected / "found.toml"))
        assert isinstance(found, Cruse1998) and found.model_variant == MODEL_VARIANTS[expected]
    form = named_form("hws", replace(hexmj.HWS, order="sequential"))
    cost = search(Problem(form, 0.4, 0.4, "start"), Effort(**SMALL | {"starts": 300}, begin="hws")).history.cost
    lost = hexmj.first_loss(hexmj.draw_starts(300, 0), replace(hexmj.HWS, order="sequential"), 0.4, 40.0)
    assert cost.values[0] == np.isfinite(lost).mean()


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: Problem(HWS, 0.5, 0.1), "velocity"),
        (lambda: Problem(HWS, 0.5, 0.5, feedback=True), "feedback"),
        (lambda: Problem(FieldsForm(Pace()), 0.5, 0.5, over="mean"), "over"),
        (lambda: NetworkForm("lvds"), "form"),  # pyright: ignore[reportArgumentType]
        (lambda: NetworkForm("hws", "x"), "order"),  # pyright: ignore[reportArgumentType]
        (lambda: Effort("cmaes", population=3), "population"),
        (lambda: Effort(refine_starts=0), "refine_starts"),
        (lambda: search(PROBLEM, Effort(begin=Pace())), "begin"),
        (lambda: search(PROBLEM, Effort(begin="ldvs")), "begin"),
        (lambda: named_form("nothing"), "form"),
        (lambda: named_form("wilson", order="sequential"), "order"),
    ],
)
def test_bad_input_is_refused(make: Any, name: str):
    with pytest.raises(InputError, match=name):
        make()
