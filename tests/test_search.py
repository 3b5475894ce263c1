"""The search: laws of the paper's evolutionary algorithm, known minima, resuming, and what a damaged file does."""

import math
import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hexmj
from hexmj import FieldsForm, NetworkForm, Problem
from hexmj.cli.main import options_of
from hexmj.controllers import Step, stepwise
from hexmj.controllers.cruse1998 import READINGS, Cruse1998
from hexmj.controllers.named import load_controller
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.search.convergence import convergence_figure
from hexmj.search.covariance import CovarianceAdaptation
from hexmj.search.domain import Domain
from hexmj.search.evolution import SIGMA, Evolution, mutated, selection_probabilities
from hexmj.search.network_forms import FORMS
from hexmj.search.problems import Sample
from hexmj.search.stages import Effort, refine, run, search

TARGET = np.array([3.0, -2.0, 0.0, 6.0, 0.5, 1.0])
"""Where the test cost is least: real numbers but for parameters 2 (0) and 5 (1), which are binary."""
BINARY = np.array([False, False, True, False, False, True])
DOMAIN = Domain(np.where(BINARY, 0.0, -10.0), np.where(BINARY, 1.0, 10.0), BINARY)

HWS, LDVS = NetworkForm("hws"), NetworkForm("ldvs")
PROBLEM = Problem(HWS, 0.5, 0.5, window="start")
EFFORT = Effort(budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)

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


def test_steps_are_in_units_of_the_parameters():
    """Of the network's forms, whose units are the paper's, every unit is 1."""
    individuals, unit = np.random.default_rng(0).normal(size=(5, 6)), np.array([1.0, 0.008, 300.0, 1.0, 2.0, 1e-4])
    ones, units = (mutated(individuals, np.random.default_rng(1), one) - individuals for one in (1.0, unit))
    np.testing.assert_allclose(units, unit * ones, rtol=1e-9, atol=1e-12)
    for form in (HWS, LDVS):
        assert np.array(Problem(form, 0.5, 0.5).domain(3.0).unit == 1.0).all()
    tried = []

    def cost(vectors: np.ndarray) -> np.ndarray:
        tried.extend(vectors)
        return np.ones(len(vectors))

    refine(np.zeros(6), ~BINARY, cost, 5, unit)
    np.testing.assert_allclose(np.max(tried, axis=0), 0.1 * unit * ~BINARY, atol=1e-12)


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
@pytest.mark.parametrize("order", ["printed", "sequential"])
def test_the_cost_is_the_flss_of_the_same_starts(window, order):
    for name in FORMS:
        preset = hexmj.HWS if name == "hws" else hexmj.LDVS
        form, controller = NetworkForm(name, order), hexmj.Cruse1998(preset.weights, order)
        vector = form.vector(controller)
        one = Sample(Problem(form, 0.4, 0.4, window), 300, 5)
        expected = hexmj.flss(controller, [0.4], n_starts=300, window=window, seed=5).flss.item()
        assert one.costs(vector[None]) == [expected]
        some = Sample(Problem(form, 0.2, 0.6, window), 300, 5)
        expected, _ = hexmj.flss_over_range(controller, 0.2, 0.6, n_starts=300, window=window, seed=5)
        assert some.costs(vector[None]) == [expected]
        verdict = some.verdict({"one": controller})
        assert verdict.flss.sel(controller="one", window=str(window)) == expected


@pytest.mark.parametrize("name", FORMS)
def test_forms_are_what_their_names_say(name):
    """Vectors and controllers turn into each other, and both sides are alike in every form but the general one."""
    form = NetworkForm(name)
    domain = Problem(form, 0.4, 0.4).domain(10.0)
    vector = domain.read(domain.draw(1, np.random.default_rng(3)))[0]
    controller = form.controller(vector)
    assert len(form.names) == len(vector) == {"hws": 9, "ldvs": 10, "mirrored": 29, "general": 58}[name]
    assert np.array_equal(form.vector(controller), vector)
    starts = hexmj.draw_starts(20, 5)
    walked, mirrored = (hexmj.walk(one, controller, 0.4, 60.0).x for one in (starts, starts[:, MIRROR]))
    assert np.array_equal(walked[:, :, MIRROR], mirrored) == (name != "general")


@dataclass(frozen=True)
class Pace:
    """Two numbers, of which one is best at 3 and the other makes no difference: legs stand or not, all of them."""

    good: float = 2.0
    idle: float = -0.5
    name: str = "pace"
    legs: int = 6

    def __post_init__(self) -> None:
        if self.good < 0:
            raise ValueError("good")

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        off, steps = abs(self.good - 3.0), 0

        def step(v: np.ndarray) -> Step:
            nonlocal steps
            steps += 1
            stands = np.abs(starts).sum(axis=1, keepdims=True) > 30 * off
            return Step(starts - 1e-3 * steps, stands & np.ones(6, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)


def test_the_fields_of_a_controller_are_searched():
    """Those that are floats, from their usual values, over 0 to a multiple of them; what it refuses costs all."""
    form = FieldsForm(Pace())
    problem = Problem(form, 0.4, 0.4, window=5.0)
    domain = problem.domain(4.0)
    assert form.names == ("good", "idle")
    assert not domain.binary.any()
    assert (domain.low.tolist(), domain.high.tolist()) == ([0.0, -2.0], [8.0, 0.0])
    assert domain.begin is not None and domain.begin.tolist() == [2.0, -0.5]
    assert np.broadcast_to(domain.unit, 2).tolist() == [2.0, 0.5]
    assert problem.domain(4.0, Pace(good=1.0)).begin.tolist() == [1.0, -0.5]  # pyright: ignore[reportOptionalMemberAccess]
    assert form.controller(np.array([1.5, 0.25])) == Pace(good=1.5, idle=0.25)
    sample = Sample(problem, 50, 0)
    assert sample.costs(np.array([[-1.0, 0.0]])) == [1.0]
    expected = [hexmj.flss(Pace(good=good), [0.4], n_starts=50, window=5.0).flss.item() for good in (2.0, 0.1)]
    assert sample.costs(np.array([[2.0, 0.0], [0.1, 7.0]])).tolist() == expected
    for algorithm in ("evolution", "cmaes"):
        found = search(problem, Effort(algorithm, domain=2.0, starts=40, budget=60, refine_starts=60, refine_budget=30))
        assert found.history.parameter.values.tolist() == ["good", "idle"]
        assert found.cost == 0.0 < expected[0]
        assert abs(found.vector[0] - 3.0) < 2.0


SCRATCH = np.zeros(1)
"""What careless controllers share."""


@dataclass(frozen=True)
class Careless(Pace):
    """Its plans go through an array of this module."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        def step(v: np.ndarray) -> Step:
            SCRATCH[0] = self.good
            time.sleep(1e-3)  # for other threads
            return Step(starts, starts < 10.0 * SCRATCH[0])

        return stepwise(step, starts, velocity, stride, acceleration)


def test_candidates_that_share_an_array_of_their_module_are_walked_one_after_the_other():
    sample = Sample(Problem(FieldsForm(Careless()), 0.4, 0.4, window=1.0), 50, 0)
    vectors = np.array([[good, 0.0] for good in (0.5, 1.0, 0.0, 2.0)])
    alone = [sample.costs(vector[None])[0] for vector in vectors]
    assert len(set(alone)) > 2
    assert sample.costs(vectors, threads=4).tolist() == alone


@dataclass(frozen=True)
class Picky(Pace):
    """Refuses nearly all that is not usual."""

    least: int = 2

    def __post_init__(self):
        if not self.least <= self.good < 2.01:
            raise ValueError(f"good = {self.good} is out of the range that I allow")


def test_ties_are_broken_by_later_losses_and_nothing_else_is():
    """Of equal counts the one with later losses costs less; a count more costs more, whenever it is lost."""
    form, n = FieldsForm(Pace()), 30
    plain, later = (Sample(Problem(form, 0.4, 0.4, 20.0, ties=ties), n, 0) for ties in ("equal", "later"))
    vectors = np.array([[good, 0.0] for good in np.linspace(0.0, 6.0, 13)])
    times = [hexmj.first_loss(plain.starts, Pace(*one), 0.4, 20.0) for one in vectors.tolist()]
    part = np.array([np.mean(1 - np.minimum(one, 20.0) / 20.0) for one in times])
    flss, costs = plain.costs(vectors), later.costs(vectors)
    np.testing.assert_allclose(costs, (n * flss + part) / (n + 1), rtol=1e-6)
    assert len(set(flss)) > 3
    assert ((costs >= 0) & (costs <= 1)).all()
    assert (costs[np.lexsort((part, flss))] == np.sort(costs)).all()
    for sample, known in ((plain, flss), (later, costs)):
        assert [sample.lost(cost) for cost in known] == np.rint(n * flss).tolist()


@pytest.mark.parametrize(
    ("ties", "over", "said"),
    [
        ("equal", "usual", "FLSS"),
        ("equal", "worst", "greatest FLSS of all variants"),
        ("later", "usual", "(starts lost + mean part of the time lost) / (starts + 1)"),
        ("later", "mean", "mean over variants of (starts lost + mean part of the time lost) / (starts + 1)"),
    ],
)
def test_a_cost_is_called_what_it_is(ties: Any, over: Any, said: str):
    problem = Problem(NetworkForm("hws"), 0.4, 0.4, 10.0, ties=ties, over=over)
    found = search(problem, Effort(starts=4, budget=10, refine_starts=6, refine_budget=2))
    assert found.history.cost.attrs["long_name"] == said
    assert found.starts == 6 and (found.lost is None) == (over == "mean")
    figure = convergence_figure(found.history.assign_attrs(title="title"))
    label, below = figure.axes[0].get_ylabel(), figure.legends[0].get_title().get_text()
    assert label.startswith("FLSS on") == (said == "FLSS")
    assert below.endswith(f"cost: {said}") == (said != "FLSS")


def test_a_search_with_ties_says_what_its_cost_is(run, tmp_path):
    words = ["--form", "hws", "--ties", "later", "--window", "10", "--starts", 10, "--budget", 10, "--refine-budget", 0]
    code, shown, _ = run("search", *words, "--verdict-starts", 20, "--out", tmp_path)
    told = " ".join(shown.split())
    assert code == 0 and "later losses first among equals" in told
    assert "((starts lost + mean part of the time lost) / (starts + 1), at which " in told
    assert " of 10 starts were lost)" in told


def test_what_a_controller_refuses_is_counted_and_none_of_it_wins():
    problem = Problem(FieldsForm(Picky()), 0.4, 0.4, window=5.0)
    found = search(problem, Effort(starts=20, budget=30, refine_budget=0))
    good = found.history.candidate.sel(parameter="good")
    refused = (good < 2) | (good >= 2.01)
    assert len(found.refused) == found.history.attrs["refused"] == refused.sum() > 0
    assert found.refused[0].startswith("ValueError: good = ")
    with pytest.raises(InputError, match="4 of 4 candidates were refused, the best one by: ValueError: good = "):
        search(problem, Effort("cmaes", population=4, budget=4, starts=5, refine_budget=0, seed=1))


@dataclass(frozen=True)
class Far(Pace):
    """Stands still, far beside its lines."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        y = (4.0 + abs(self.good)) * np.array(stride.geometry.y)
        return stepwise(lambda v: Step(starts, np.ones(6, dtype=bool), y=y), starts, velocity, stride, acceleration)


def test_what_no_leg_reaches_is_never_found():
    problem = Problem(FieldsForm(Far()), 0.3, 0.3, window=5.0, conditions=hexmj.Conditions())
    with pytest.raises(InputError, match="out of reach"):
        search(problem, Effort(starts=2, budget=10, refine_budget=0, domain=2.0))


@pytest.mark.parametrize(
    ("form", "sentence"),
    [
        (lambda: FieldsForm(Pace(good=math.nan)), "the form's box is"),
        (lambda: FieldsForm(Pace(good=math.inf)), "the form's box is"),
        (lambda: FieldsForm(Pace(good=1e308)), "the form's box is"),
        (lambda: Askew(box_is=([0.0, 0.0], [1.0])), "box of the form = .*; expected numbers"),
        (lambda: Askew(box_is=([1.0, 1.0], [0.0, 1.0])), "the form's box is"),
        (lambda: Askew(begin=np.zeros(3)), "a search begins at .*; expected 2 finite numbers"),
        (lambda: Askew(binary=np.zeros(3, dtype=bool)), "the form's binary = .*; expected True or False for 2"),
        (lambda: Askew(binary=[False, False]), "binary of the form = .*; expected a ndarray"),
    ],
)
def test_forms_that_make_no_sense_are_refused(form, sentence):
    with pytest.raises(InputError, match=sentence):
        search(Problem(form(), 0.4, 0.4, window=5.0), Effort(starts=2, budget=10))


@dataclass(frozen=True)
class Askew:
    """A form of a user's own in which something does not fit."""

    names: tuple[str, ...] = ("good", "idle")
    binary: Any = field(default_factory=lambda: np.zeros(2, dtype=bool))
    begin: Any = None
    box_is: Any = ([0.0, 0.0], [1.0, 1.0])

    def box(self, reach):
        return self.box_is

    def controller(self, vector):
        return Pace(*vector.tolist())

    def vector(self, controller):
        return np.array([controller.good, controller.idle])


def test_what_has_no_such_parameters_is_refused():
    with pytest.raises(InputError, match="uncoordinated has no field of the type float"):
        FieldsForm(hexmj.UNCOORDINATED)
    with pytest.raises(InputError, match="ldvs to begin with; expected a Pace"):
        search(Problem(FieldsForm(Pace()), 0.4, 0.4), Effort(begin=hexmj.LDVS))
    with pytest.raises(InputError, match="pace has no weights"):
        search(PROBLEM, Effort(begin=Pace()))


def test_costs_do_not_depend_on_threads_or_on_the_other_candidates():
    domain = Problem(LDVS, 0.3, 0.6).domain(10.0)
    vectors = domain.read(domain.draw(5, np.random.default_rng(0)))
    sample = Sample(Problem(LDVS, 0.3, 0.6, "start"), 200, 0)
    costs = sample.costs(vectors, threads=2)
    assert sample.costs(vectors, threads=1).tolist() == costs.tolist()
    assert [sample.costs(vector[None])[0] for vector in vectors] == costs.tolist()


@pytest.mark.parametrize("feedback", [False, True])
def test_the_physical_cost_is_the_physical_flss(feedback):
    conditions = hexmj.Conditions.of(vp=200.0)
    sample = Sample(Problem(LDVS, 0.6, 0.6, "start", conditions=conditions, feedback=feedback), 12, 0)
    walked = hexmj.ReadsLegs(hexmj.LDVS) if feedback else hexmj.LDVS
    how: Any = {"n_starts": 12, "conditions": conditions}
    expected = hexmj.physical_flss(walked, [0.6], window="start", **how).flss.item()
    assert sample.costs(LDVS.vector(hexmj.LDVS)[None]) == [expected]
    assert 0 < expected < 1
    if not feedback:
        verdict = sample.verdict({"ldvs": walked}).flss.sel(controller="ldvs")
        assert verdict.sel(window="start") == expected
        assert verdict.sel(window="walk") == hexmj.physical_flss(walked, [0.6], window="walk", **how).flss.item()


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


@pytest.mark.parametrize("algorithm", ["evolution", "cmaes"])
@pytest.mark.parametrize("stop", [0.05, 0.3, 0.7])
def test_a_stopped_search_goes_on_to_the_same_bits(tmp_path, algorithm, stop):
    effort = Effort(algorithm, budget=100, starts=60, refine_starts=200, refine_budget=60, seed=3)
    whole = search(PROBLEM, effort)
    gone, asked = 0.0, []

    def power_cut(done: float) -> None:
        nonlocal gone
        gone += done
        asked.append(done)
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


def test_a_longer_search_goes_on_from_a_shorter_one_and_another_leaves_it_alone(tmp_path):
    few = Effort(budget=30, starts=20, refine_budget=0)
    search(PROBLEM, few, folder=tmp_path)
    (kept,) = tmp_path.iterdir()
    before = kept.read_bytes()
    for problem, effort in (
        (Problem(HWS, 0.4, 0.5, window="start"), few),
        (Problem(NetworkForm("hws", "sequential"), 0.5, 0.5, window="start"), few),
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


def test_a_search_keeps_the_rules_of_the_set_that_it_begins_with(tmp_path):
    """Unless others are given; what it finds walks by them."""
    sizes = ["--starts", "4", "--budget", "10", "--refine-budget", "0", "--verdict-starts", "4", "--window", "start"]
    words = ["search", "--form", "mirrored", "--begin", "lasting-0.3", *sizes]
    for added, expected in ([], "lasting"), (["--reading", "printed"], "printed"):
        options_of([*words, *added, "--out", str(tmp_path / expected)]).run()
        found = load_controller(str(tmp_path / expected / "found.toml"))
        assert isinstance(found, Cruse1998)
        assert found.reading == READINGS[expected]
