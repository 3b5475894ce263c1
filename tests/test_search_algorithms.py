"""Laws of the paper's evolutionary algorithm, of CMA-ES and of the simplex, and minima that are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexmj import NetworkForm, Problem
from hexmj.search.algorithms import (
    CovarianceAdaptation,
    Domain,
    Evolution,
    mutated,
    refine,
    selection_probabilities,
)
from hexmj.search.algorithms import search_population as run

TARGET = np.array([3.0, -2.0, 0.0, 6.0, 0.5, 1.0])
"""Where the test cost is least: real numbers but for parameters 2 (0) and 5 (1), which are binary."""

BINARY = np.array([False, False, True, False, False, True])
DOMAIN = Domain(np.where(BINARY, 0.0, -10.0), np.where(BINARY, 1.0, 10.0), BINARY)
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
    for form in (NetworkForm("hws"), NetworkForm("ldvs")):
        assert np.array(Problem(form, 0.5, 0.5).domain(3.0).unit == 1.0).all()
    tried = []

    def cost(vectors: np.ndarray) -> np.ndarray:
        tried.extend(vectors)
        return np.ones(len(vectors))

    refine(np.zeros(6), ~BINARY, cost, 5, unit)
    np.testing.assert_allclose(np.max(tried, axis=0), 0.1 * unit * ~BINARY, atol=1e-12)


def test_the_simplex_does_not_depend_on_the_units_of_the_parameters():
    """Though it ends where its corners are close to one another, and what it walks in costs steps of a frequency."""

    def tried(unit: np.ndarray) -> np.ndarray:
        seen = []

        def cost(vectors: np.ndarray) -> np.ndarray:
            seen.extend(vectors / unit)
            return np.round(((vectors / unit - 0.4) ** 2).sum(axis=1), 2)

        refine(unit * 1.0, ~BINARY, cost, 400, unit)
        return np.array(seen)

    ones = tried(np.ones(6))
    assert 30 < len(ones) < 400
    assert np.array_equal(tried(np.exp2([0.0, -20, -40, 7, 3, 60])), ones)


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
    """As widely as at first."""
    algorithm, spread = CovarianceAdaptation(DOMAIN, 10, seed=1), []
    for _ in range(400):
        asked = algorithm.ask()
        algorithm.tell(mixed_sphere(asked))
        spread.append(asked[:, ~BINARY].std(axis=0).max())
    assert min(spread) < 1e-3 * spread[0]
    assert max(spread[np.argmin(spread) :]) > 0.5 * spread[0]
