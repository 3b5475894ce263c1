"""A search: it lowers the cost, goes on to the same bits where it was stopped, and believes no damaged file."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

import hexmj
from hexmj import FieldsForm, NetworkForm, Problem
from hexmj.errors import InputError
from hexmj.search.problems import Sample
from hexmj.search.stages import Effort, search
from pace import Pace
from tiers import few_of

HWS, LDVS = NetworkForm("hws"), NetworkForm("ldvs")
PROBLEM = Problem(HWS, 0.5, 0.5, observation_time="start")
EFFORT = Effort(budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)


def test_a_search_lowers_the_cost_and_says_what_it_did():
    found = search(PROBLEM, EFFORT)
    history = found.history
    assert set(history.stage.values.tolist()) == {0, 1}
    assert int((history.stage == 0).sum()) == 100
    sample = Sample(PROBLEM, EFFORT.refine_starts, EFFORT.seed)
    assert sample.costs(found.vector[None]) == [found.cost]
    uncoordinated = history.cost.values[0]
    first = history.isel(evaluation=np.argmax(history.stage.values == 1)).cost.item()
    assert found.cost <= first < uncoordinated
    assert found.cost == history.best.values[-1] == history.cost.values[100:].min()
    assert (np.diff(history.best.values[:100]) <= 0).all()
    assert hexmj.plot(history).axes[0].get_lines()


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
@pytest.mark.parametrize("stop", few_of([0.05, 0.3, 0.7], 0.3))
def test_a_stopped_search_goes_on_to_the_same_bits(tmp_path, algorithm, stop):
    effort = Effort(algorithm, budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)
    whole = search(PROBLEM, effort)
    gone = 0.0

    def power_cut(done: float) -> None:
        nonlocal gone
        gone += done
        if gone > stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(PROBLEM, effort, folder=tmp_path, progress=power_cut)
    resumed = search(PROBLEM, effort, folder=tmp_path, threads=1)
    assert 0 < resumed.replayed < whole.history.sizes["evaluation"]
    assert resumed.vector.tobytes() == whole.vector.tobytes()
    assert resumed.cost == whole.cost
    assert resumed.history.identical(whole.history)


def test_a_finished_search_is_reported_without_an_evaluation(tmp_path, monkeypatch):
    whole = search(PROBLEM, EFFORT, folder=tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}

    def never(*_: object) -> None:
        raise AssertionError("walked again")

    monkeypatch.setattr(Sample, "_times", never)
    again = search(PROBLEM, EFFORT, folder=tmp_path)
    assert again.history.identical(whole.history)
    assert again.replayed > 0
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.thorough
def test_a_longer_search_goes_on_from_a_shorter_one_and_another_leaves_it_alone(tmp_path):
    few = Effort(budget=30, starts=20, refine_budget=0)
    search(PROBLEM, few, folder=tmp_path)
    (kept,) = tmp_path.iterdir()
    before = kept.read_bytes()
    for problem, effort in (
        (Problem(HWS, 0.4, 0.5, observation_time="start"), few),
        (Problem(NetworkForm("hws", "sequential"), 0.5, 0.5, observation_time="start"), few),
        (PROBLEM, replace(few, starts=21)),
        (PROBLEM, replace(few, seed=1)),
    ):
        assert search(problem, effort, folder=tmp_path).replayed == 0
    assert kept.read_bytes() == before
    assert search(PROBLEM, replace(few, budget=60), folder=tmp_path).replayed == before.count(b"\n") - 1
    assert kept.read_bytes().startswith(before)


def test_only_candidates_of_this_search_count_as_known(tmp_path):
    first, second = (Effort(one, budget=30, starts=20, refine_budget=0) for one in ("evolution", "cmaes"))
    rows = [
        {row.tobytes() for row in search(PROBLEM, one, folder=tmp_path).history.candidate.values}
        for one in (first, second)
    ]
    (kept,) = tmp_path.iterdir()
    kept.write_text("".join(kept.read_text().splitlines(keepends=True)[: 1 + len(rows[0])]))
    assert search(PROBLEM, second, folder=tmp_path).replayed == len(rows[0] & rows[1]) < len(rows[1]) / 2


def test_evaluations_of_which_nobody_knows_what_they_are_are_refused_and_left_alone(tmp_path):
    effort = Effort(budget=30, starts=20, refine_budget=0)
    whole = search(PROBLEM, effort, folder=tmp_path)
    (kept,) = tmp_path.iterdir()
    lines = kept.read_text().splitlines(keepends=True)
    kept.write_text("".join([*lines[:5], lines[5][:-4], *lines[6:]]))  # a damaged line is evaluated again
    again = search(PROBLEM, effort, folder=tmp_path)
    assert again.history.identical(whole.history)
    assert again.replayed < len(lines) - 1
    kept.write_text("precious")
    with pytest.raises(InputError, match="is damaged, or of another search"):
        search(PROBLEM, effort, folder=tmp_path)
    assert kept.read_text() == "precious"


def test_without_cmaes_it_is_said_what_brings_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "cmaes", None)
    assert Effort().algorithm == "evolution"
    with pytest.raises(InputError, match=r'pip install "\.\[search\]"'):
        Effort("cmaes")


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Problem(HWS, 0.5, 0.1), "expected 0 <= low <= high < 1"),
        (lambda: Problem(HWS, 0.5, 1.0), "expected 0 <= low <= high < 1"),
        (lambda: Problem(HWS, -0.1, 0.5), "expected 0 <= low <= high < 1"),
        (lambda: Problem(HWS, math.nan, 0.5), "expected 0 <= low <= high < 1"),
        (lambda: Problem(HWS, 0.0, 0.5), "has no period"),
        (lambda: NetworkForm("lvds"), "valid names: hws, ldvs"),  # pyright: ignore[reportArgumentType]
        (lambda: NetworkForm("hws", "x"), "valid names: printed, undelayed"),  # pyright: ignore[reportArgumentType]
        (lambda: Problem(HWS, 0.5, 0.5, feedback=True), "feedback without conditions"),
        (lambda: Effort(budget=0), "at least one generation, 10 evaluations"),
        (lambda: Effort("annealing"), "valid names: evolution, cmaes"),  # pyright: ignore[reportArgumentType]
        (lambda: Effort(refine_budget=-1), "expected 0 or more"),
        (lambda: search(PROBLEM, Effort(population=0)), "population = 0; expected a whole number of at least 2"),
        (lambda: Effort("cmaes", population=3), "population = 3; expected a whole number of at least 4"),
        (lambda: search(PROBLEM, Effort(domain=0.0)), "domain = 0.0; expected above 0 and at most 1e.06"),
        (lambda: search(PROBLEM, Effort(starts=0)), "starts = 0; expected"),
        (lambda: search(PROBLEM, Effort(refine_starts=0)), "starts = 0; expected"),
        (lambda: search(PROBLEM, Effort(seed=-1)), "seed = -1; expected"),
    ],
)
def test_nonsense_gets_a_sentence(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


def test_what_has_no_such_parameters_is_refused():
    with pytest.raises(InputError, match="uncoordinated has no field of the type float"):
        FieldsForm(hexmj.UNCOORDINATED)
    with pytest.raises(InputError, match="ldvs to begin with; expected a Pace"):
        search(Problem(FieldsForm(Pace()), 0.4, 0.4), Effort(begin=hexmj.LDVS))
    with pytest.raises(InputError, match="pace is not made of weights alone"):
        search(PROBLEM, Effort(begin=Pace()))


def test_a_set_walks_by_its_own_rules_where_a_search_begins_with_it():
    """One that walks as printed begins searches by other rules, too."""
    weights = hexmj.NetworkForm("mirrored").vector(hexmj.PRESETS["own-0.3"])
    assert np.array_equal(hexmj.NetworkForm("mirrored", order="sequential").vector(hexmj.PRESETS["own-0.3"]), weights)
    with pytest.raises(
        InputError, match=r"^lasting-0.3 to begin with has reading = lasting; expected printed, as of wh"
    ):
        search(Problem(hexmj.NetworkForm("mirrored"), 0.4, 0.4), Effort(begin=hexmj.PRESETS["lasting-0.3"]))
    with pytest.raises(InputError, match=r"^ldvs to begin with has order = sequential; expected undelayed, as of what"):
        hexmj.NetworkForm("ldvs", order="undelayed").vector(replace(hexmj.LDVS, order="sequential"))
