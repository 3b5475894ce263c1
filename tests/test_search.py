"""The search: laws of the paper's evolutionary algorithm, known minima, resuming, and what a damaged file does."""

import math

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import hexmj
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.search import history as search_history
from hexmj.search.convergence import convergence_figure
from hexmj.search.covariance import CovarianceAdaptation
from hexmj.search.domain import Domain
from hexmj.search.evolution import SIGMA, Evolution, mutated, selection_probabilities
from hexmj.search.forms import FORMS, Form
from hexmj.search.history import History
from hexmj.search.problems import Problem, Sample
from hexmj.search.stages import Plan, refine, run, search

TARGET = np.array([3.0, -2.0, 0.0, 6.0, 0.5, 1.0])
"""Where the test cost is least: real numbers but for parameters 2 (0) and 5 (1), which are binary."""
BINARY = np.array([False, False, True, False, False, True])
DOMAIN = Domain(np.where(BINARY, 0.0, -10.0), np.where(BINARY, 1.0, 10.0), BINARY)

PROBLEM = Problem("hws", 0.5, 0.5, window="start")
PLAN = Plan(budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)

costs_of_a_population = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=20).map(np.array)


def mixed_sphere(vectors: np.ndarray) -> np.ndarray:
    """Squared distance from the target; a wrong binary parameter costs 20."""
    assert np.isin(vectors[:, BINARY], (0.0, 1.0)).all()
    return ((vectors - TARGET) ** 2 * np.where(BINARY, 20.0, 1.0)).sum(axis=1)


def narrow_valley(vectors: np.ndarray) -> np.ndarray:
    """Rosenbrock's function of the real parameters, least at 1, and the binary part of `mixed_sphere`."""
    x = vectors[:, ~BINARY] / 3
    valley = (100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2).sum(axis=1)
    return valley + 20 * np.abs(vectors - TARGET)[:, BINARY].sum(axis=1)


@given(costs_of_a_population)
def test_selection_is_proportional_to_the_advantage_over_individual_1(costs):
    p = selection_probabilities(costs)
    advantage = costs[0] - costs
    assert p.sum() == pytest.approx(1.0, abs=1e-12)
    if (advantage > 0).any():
        assert (p[advantage <= 0] == 0).all()
        np.testing.assert_allclose(
            p * advantage.max(), np.maximum(advantage, 0) * p[np.argmax(advantage)], rtol=1e-9, atol=1e-300
        )
    else:
        assert p.tolist() == [1.0] + [0.0] * (len(costs) - 1)


def test_selection_probabilities_by_hand():
    np.testing.assert_allclose(selection_probabilities(np.array([0.5, 0.4, 0.7, 0.2, 0.5])), [0, 0.25, 0, 0.75, 0])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
def test_individual_1_is_the_best_so_far(seed, population):
    """Elitism: whatever the costs, the least one never rises, and its individual is kept unchanged."""
    rng = np.random.default_rng(seed)
    evolution = Evolution(DOMAIN, population, seed)
    tried, costs = np.empty((0, 6)), np.empty(0)
    for _ in range(6):
        asked = evolution.individuals[-len(evolution.ask()) :]
        tried, costs = np.concatenate([tried, asked]), np.concatenate([costs, rng.random(len(asked)).round(1)])
        evolution.tell(costs[-len(asked) :])
        assert (evolution.individuals[0] == tried[np.argmin(costs)]).all()
        assert evolution.individuals.shape == (population, 6)


def test_population_0_holds_the_zero_individual_and_draws_over_the_domain():
    evolution = Evolution(DOMAIN, 2000, seed=1)
    asked = evolution.ask()
    assert (asked[0] == 0).all()
    assert ((asked >= DOMAIN.low) & (asked <= DOMAIN.high)).all()
    np.testing.assert_allclose(asked[1:].mean(axis=0), np.where(BINARY, 0.5, 0.0), atol=0.45)
    np.testing.assert_allclose(asked[1:].std(axis=0), np.where(BINARY, 0.5, 20 / math.sqrt(12)), rtol=0.05)


def test_with_k_0_the_next_population_is_individual_1_mutated():
    evolution = Evolution(DOMAIN, 500, seed=2)
    evolution.individuals[0] = first = np.arange(6.0)
    evolution.tell(np.ones(500))
    assert (evolution.individuals[0] == first).all()
    spread = (evolution.individuals[1:] - first) / (SIGMA * np.arange(2, 501))[:, None]
    assert abs(spread.mean()) < 4 / math.sqrt(spread.size)
    assert spread.std() == pytest.approx(1.0, abs=4 / math.sqrt(2 * spread.size))


def test_only_survivors_are_copied_in_their_proportions():
    copies = np.zeros(3)
    parents = 1e6 * np.arange(10.0)[:, None] + np.zeros((10, 6))
    for seed in range(400):
        evolution = Evolution(DOMAIN, 10, seed)
        evolution.individuals = parents
        evolution.tell(np.array([0.5, 0.4, 0.2, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 0.5]))
        parent = np.rint(evolution.individuals[:, 0] / 1e6).astype(int)
        assert parent[0] == 2
        copies += np.bincount(parent[1:], minlength=3)
    assert copies[0] == 0
    assert copies[1] / copies.sum() == pytest.approx(0.25, abs=4 * math.sqrt(0.25 * 0.75 / 3600))


def test_mutation_has_standard_deviation_0_3_i():
    rng, size = np.random.default_rng(0), 20_000
    individuals = np.tile(np.arange(10.0)[:, None], (1, size))
    new = mutated(individuals, rng)
    assert (new[0] == 0).all()
    assert (individuals == np.arange(10.0)[:, None]).all()
    change = (new - individuals)[1:]
    sigma = 0.3 * np.arange(2, 11)
    np.testing.assert_allclose(change.std(axis=1), sigma, rtol=4 / math.sqrt(2 * size))
    assert (np.abs(change.mean(axis=1)) < 4 * sigma / math.sqrt(size)).all()


@pytest.mark.parametrize("algorithm", [Evolution, CovarianceAdaptation])
@pytest.mark.parametrize("cost", [mixed_sphere, narrow_valley])
def test_both_algorithms_and_the_simplex_find_a_known_minimum(algorithm, cost):
    best, least = run(algorithm(DOMAIN, 10, seed=1), cost, 2000)
    assert best[BINARY].tolist() == [0.0, 1.0]
    assert least == cost(best[None])[0] < (1e-6 if algorithm is CovarianceAdaptation else 5.0)
    before = best.copy()
    refined, least = refine(best, ~BINARY, cost, 3000)
    assert (best == before).all()
    assert refined[BINARY].tolist() == [0.0, 1.0]
    assert least == cost(refined[None])[0] < 1e-6
    np.testing.assert_allclose(refined[~BINARY], TARGET[~BINARY] if cost is mixed_sphere else 3.0, atol=1e-2)


@pytest.mark.parametrize("algorithm", [Evolution, CovarianceAdaptation])
def test_a_budget_is_never_exceeded_and_all_of_it_that_makes_whole_generations_is_used(algorithm):
    counts = []
    run(algorithm(DOMAIN, 10, seed=1), lambda x: counts.append(len(x)) or mixed_sphere(x), 105)
    assert sum(counts) == 100


def test_cma_es_begins_anew_once_it_has_converged():
    _, least = run(CovarianceAdaptation(DOMAIN, 10, seed=1), lambda x: np.ones(len(x)), 4000)
    assert least == 1.0


@pytest.mark.parametrize("window", ["walk", "start", 30.0])
def test_the_cost_is_the_flss_of_the_same_starts(window):
    cases: list[tuple[Form, hexmj.Symmetric, np.ndarray]] = [
        ("hws", hexmj.HWS, hexmj.HWS.to_vector(9)),
        ("ldvs", hexmj.LDVS, hexmj.LDVS.to_vector(10)),
        ("mirrored", hexmj.LDVS, FORMS["mirrored"].vector(hexmj.LDVS)),
        ("general", hexmj.LDVS, FORMS["general"].vector(hexmj.LDVS)),
    ]
    for form, model, vector in cases:
        one = Sample.draw(Problem(form, 0.4, 0.4, window), 300, 5)
        expected = hexmj.flss(model, [0.4], starts=300, window=window, seed=5).flss.item()
        assert one.costs(vector[None]) == [expected]
        some = Sample.draw(Problem(form, 0.2, 0.6, window), 300, 5)
        expected, _ = hexmj.flss_over_range(model, 0.2, 0.6, starts=300, window=window, seed=5)
        assert some.costs(vector[None]) == [expected]
        verdict = some.verdict({"model": model})
        assert verdict.flss.sel(model="model", window=str(window)) == expected


@pytest.mark.parametrize("form", FORMS)
def test_forms_are_what_their_names_say(form):
    """Vectors and models turn into each other, and both sides are alike in every form but the general one."""
    problem = Problem(form, 0.4, 0.4)
    domain = problem.domain(10.0)
    vector = domain.read(domain.draw(1, np.random.default_rng(3)))[0]
    model = FORMS[form].model(vector)
    assert len(problem.names()) == len(vector) == {"hws": 9, "ldvs": 10, "mirrored": 29, "general": 58}[form]
    assert np.array_equal(FORMS[form].vector(model), vector)
    starts = hexmj.draw_starts(20, 5)
    walked, mirrored = (hexmj.walk(one, model, 0.4, 60.0).x for one in (starts, starts[:, MIRROR]))
    assert np.array_equal(walked[:, :, MIRROR], mirrored) == (form != "general")


def test_costs_do_not_depend_on_threads_or_on_the_other_candidates():
    vectors = Problem("ldvs", 0.3, 0.6).domain(10.0).draw(5, np.random.default_rng(0))
    vectors = Problem("ldvs", 0.3, 0.6).domain(10.0).read(vectors)
    one, two = (Sample.draw(Problem("ldvs", 0.3, 0.6, "start"), 200, 0, threads) for threads in (1, 2))
    costs = two.costs(vectors)
    assert one.costs(vectors).tolist() == costs.tolist()
    assert [two.costs(vector[None])[0] for vector in vectors] == costs.tolist()


def test_the_physical_cost_is_the_physical_flss():
    body = hexmj.Body(vp=200.0)
    problem = Problem("ldvs", 0.6, 0.6, "start", body=body)
    sample = Sample.draw(problem, 12, 0)
    expected = hexmj.physical_flss(hexmj.LDVS, [0.6], starts=12, window="start", body=body).flss.item()
    assert sample.costs(hexmj.LDVS.to_vector()[None]) == [expected]
    assert 0 < expected < 1
    verdict = sample.verdict({"ldvs": hexmj.LDVS}).flss.sel(model="ldvs")
    assert verdict.sel(window="start") == expected
    walk = hexmj.physical_flss(hexmj.LDVS, [0.6], starts=12, window="walk", body=body).flss.item()
    assert verdict.sel(window="walk") == walk


def test_a_search_lowers_the_cost_and_says_what_it_did():
    found = search(PROBLEM, PLAN)
    history = found.history
    assert set(history.stage.values.tolist()) == {0, 1}
    assert int((history.stage == 0).sum()) == 100
    sample = Sample.draw(PROBLEM, PLAN.refine_starts, PLAN.seed)
    assert sample.costs(found.vector[None]) == [found.cost]
    uncoordinated = history.cost.values[0]
    first = history.isel(evaluation=np.argmax(history.stage.values == 1)).cost.item()
    assert found.cost <= first < uncoordinated
    assert found.cost == history.best.values[-1] == history.cost.values[100:].min()
    assert (np.diff(history.best.values[:100]) <= 0).all()
    assert convergence_figure(history, "title").axes[0].get_lines()


@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
@pytest.mark.parametrize("stop", [0.05, 0.3, 0.7])
def test_a_stopped_search_goes_on_to_the_same_bits(tmp_path, algorithm, stop):
    plan = Plan(algorithm, budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)
    whole = search(PROBLEM, plan, path=tmp_path / "whole.nc")
    gone = 0.0

    def power_cut(done: float) -> None:
        nonlocal gone
        gone += done
        if gone > stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(PROBLEM, plan, path=tmp_path / "broken.nc", progress=power_cut)
    partial = xr.load_dataset(tmp_path / "broken.nc")
    assert 0 < partial.sizes["evaluation"] < whole.history.sizes["evaluation"]
    resumed = search(PROBLEM, plan, path=tmp_path / "broken.nc", threads=1)
    assert resumed.replayed == partial.sizes["evaluation"]
    assert resumed.vector.tobytes() == whole.vector.tobytes()
    assert resumed.cost == whole.cost
    assert resumed.history.identical(whole.history)
    assert xr.load_dataset(tmp_path / "broken.nc").identical(xr.load_dataset(tmp_path / "whole.nc"))


def test_a_finished_search_is_reported_without_an_evaluation(tmp_path, monkeypatch):
    path = tmp_path / "history.nc"
    whole, before = search(PROBLEM, PLAN, path=path), path.read_bytes()
    monkeypatch.setattr(Sample, "costs", None)
    again = search(PROBLEM, PLAN, path=path)
    assert again.history.identical(whole.history)
    assert again.replayed == whole.history.sizes["evaluation"]
    assert path.read_bytes() == before


def test_the_state_is_saved_while_the_search_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(search_history, "EVERY", 0.0)
    history, sizes = History(tmp_path / "h.nc", list("abcdef"), {}), []
    costs = history.recorded("population", mixed_sphere)

    def seen(candidates: np.ndarray) -> np.ndarray:
        result = costs(candidates)
        sizes.append(xr.load_dataset(tmp_path / "h.nc").sizes["evaluation"])
        return result

    run(Evolution(DOMAIN, 10, seed=0), seen, 28)
    assert sizes == [10, 19, 28]


def _damage(path, how: str) -> None:
    data = path.read_bytes()
    if how == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "text":
        path.write_text("precious")
    else:
        history = xr.load_dataset(path)
        history[how].values[5] += 1
        history.to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize("how", ["cut", "empty", "text", "cost", "candidate", "stage"])
def test_a_damaged_file_is_refused_and_left_alone(tmp_path, how):
    path = tmp_path / "history.nc"
    plan = Plan(budget=30, starts=20, refine_budget=0)
    search(PROBLEM, plan, path=path)
    _damage(path, how)
    damaged = path.read_bytes()
    with pytest.raises(InputError, match=r"history.nc is damaged"):
        search(PROBLEM, plan, path=path)
    assert path.read_bytes() == damaged


def test_a_file_of_another_search_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "history.nc"
    search(PROBLEM, Plan(budget=30, starts=20, refine_budget=0), path=path)
    before = path.read_bytes()
    for problem, plan, difference in (
        (Problem("hws", 0.4, 0.5, window="start"), Plan(budget=30, starts=20, refine_budget=0), "problem.low is 0.5"),
        (PROBLEM, Plan(budget=30, starts=21, refine_budget=0), "plan.starts is 20 there and 21 here"),
        (Problem("ldvs", 0.5, 0.5, window="start"), Plan(budget=30, starts=20, refine_budget=0), "problem.form is hws"),
    ):
        with pytest.raises(InputError, match=difference):
            search(problem, plan, path=path)
    assert path.read_bytes() == before


def test_a_history_whose_candidates_are_not_asked_for_is_refused(tmp_path):
    path = tmp_path / "history.nc"
    history = History(path, list("abcdef"), {})
    history.recorded("population", mixed_sphere)(TARGET[None])
    history.save()
    before = path.read_bytes()
    with pytest.raises(InputError, match="evaluation 0 is not what this search asks for"):
        History(path, list("abcdef"), {}).recorded("population", mixed_sphere)(TARGET[None] + [1, 0, 0, 0, 0, 0])
    with pytest.raises(InputError, match="evaluation 0 is not what this search asks for"):
        History(path, list("abcdef"), {}).recorded("simplex", mixed_sphere)(TARGET[None])
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Problem("hws", 0.5, 0.1), "expected 0 <= low <= high < 1"),
        (lambda: Problem("hws", 0.5, 1.0), "expected 0 <= low <= high < 1"),
        (lambda: Problem("hws", -0.1, 0.5), "expected 0 <= low <= high < 1"),
        (lambda: Problem("hws", math.nan, 0.5), "expected 0 <= low <= high < 1"),
        (lambda: Problem("hws", 0.0, 0.5), "has no period"),
        (lambda: Problem("lvds", 0.5, 0.5), "valid names: hws, ldvs"),  # pyright: ignore[reportArgumentType]
        (lambda: Plan(budget=0), "at least one generation, 10 evaluations"),
        (lambda: Plan("annealing"), "valid names: evolution, cmaes"),  # pyright: ignore[reportArgumentType]
        (lambda: Plan(refine_budget=-1), "expected 0 or more"),
        (lambda: search(PROBLEM, Plan(population=0)), "expected at least 2 individuals"),
        (lambda: search(PROBLEM, Plan("cmaes", population=0)), "expected at least 4 individuals"),
        (lambda: search(PROBLEM, Plan(domain=0.0)), "domain = 0.0; expected a finite number above 0"),
        (lambda: search(PROBLEM, Plan(starts=0)), "starts = 0; expected"),
        (lambda: search(PROBLEM, Plan(refine_starts=0)), "starts = 0; expected"),
        (lambda: search(PROBLEM, Plan(seed=-1)), "seed = -1; expected"),
    ],
)
def test_nonsense_gets_a_sentence(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()
