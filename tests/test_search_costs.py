"""The cost of a candidate is its FLSS on the same starts, kinematic or physical, with ties or without."""

from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj import FieldsForm, NetworkForm, Problem
from hexmj.search.forms import FORMS
from hexmj.search.problems import Sample
from hexmj.search.results import convergence_figure
from hexmj.search.stages import Effort, search
from pace import Pace

HWS, LDVS = NetworkForm("hws"), NetworkForm("ldvs")


@pytest.mark.parametrize("observation_time", ["walk", "start", 30.0])
@pytest.mark.parametrize("order", ["printed", "sequential"])
def test_the_cost_is_the_flss_of_the_same_starts(observation_time, order):
    for name in FORMS:
        preset = hexmj.HWS if name == "hws" else hexmj.LDVS
        form, controller = NetworkForm(name, order), hexmj.Cruse1998(preset.weights, order)
        vector = form.vector(controller)
        one = Sample(Problem(form, 0.4, 0.4, observation_time), 300, 5)
        expected = hexmj.flss(controller, [0.4], n_starts=300, observation_time=observation_time, seed=5).flss.item()
        assert one.costs(vector[None]) == [expected]
        some = Sample(Problem(form, 0.2, 0.6, observation_time), 300, 5)
        expected, _ = hexmj.flss_over_range(
            controller, 0.2, 0.6, n_starts=300, observation_time=observation_time, seed=5
        )
        assert some.costs(vector[None]) == [expected]
        assert some.verdict({"one": controller}).flss.sel(controller="one") == expected


def test_costs_do_not_depend_on_threads_or_on_the_other_candidates():
    domain = Problem(LDVS, 0.3, 0.6).domain(10.0)
    vectors = domain.read(domain.draw(5, np.random.default_rng(0)))
    sample = Sample(Problem(LDVS, 0.3, 0.6, "start"), 200, 0)
    costs = sample.costs(vectors, threads=2)
    assert sample.costs(vectors, threads=1).tolist() == costs.tolist()
    assert [sample.costs(vector[None])[0] for vector in vectors] == costs.tolist()


@pytest.mark.slow
@pytest.mark.parametrize("feedback", [False, True])
def test_the_physical_cost_is_the_physical_flss(feedback):
    conditions = hexmj.Conditions(vp=200.0)
    sample = Sample(
        Problem(LDVS, 0.6, 0.6, "start", measure="physical", conditions=conditions, feedback=feedback), 12, 0
    )
    walked = hexmj.SensoryFeedback(hexmj.LDVS) if feedback else hexmj.LDVS
    how: Any = {"n_starts": 12, "conditions": conditions}
    expected = hexmj.physical_flss(walked, [0.6], observation_time="start", **how).flss.item()
    assert sample.costs(LDVS.vector(hexmj.LDVS)[None]) == [expected]
    assert 0 < expected < 1
    if not feedback:
        assert sample.verdict({"ldvs": walked}).flss.sel(controller="ldvs") == expected


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


@pytest.mark.slow
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
    assert found.starts == 6
    figure = convergence_figure(found.history.assign_attrs(title="title"))
    texts = " ".join(text.get_text() for text in figure.texts)
    assert f"cost: {said}" in " ".join(texts.split()).replace("\N{NO-BREAK SPACE}", " ")
