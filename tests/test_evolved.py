"""The evolved network: its equation, whom its weights reach, and what was found stands up to fresh starts."""

import shlex
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.cli.main import command
from hexmj.controllers.baselines.evolved import EVOLVED, FOUND, TAU, Evolved
from hexmj.controllers.baselines.lifted import Legs
from hexmj.files import read_toml
from hexmj.gaits import gait
from hexmj.search.problems import Sample
from hexmj.timing import Stride

L2 = 1


def legs(x: float, v: float = 0.0) -> Legs:
    """Six that stand at x."""
    stands = np.ones((1, 6), dtype=bool)
    return Legs(np.full((1, 6), x), stands, stands / 6, np.full((1, 1), v), Stride())


def test_a_neuron_by_itself_obeys_the_equation():
    """Driven by position and velocity it comes to rest exponentially, and lifts its leg once, at the threshold."""
    network, still, drive = Evolved(theta=-0.6, tau=1.5, position=0.5, velocity=2.0), legs(-4.0, 0.3), 0.5 * 0.7 + 0.6
    state, lifted = network.at_start(still), []
    for _ in range(200):
        state, now = network.lifts(state, still)
        lifted.append(now[0])
    time = Stride().dt * np.arange(1, 201)
    potential = drive * (1 - np.exp(-time / (TAU * 2**1.5)))
    np.testing.assert_allclose(state, potential[-1], rtol=1e-12)
    assert (np.argwhere(np.all(lifted, axis=1)) == np.argmax(potential > 0.6)).all()
    assert np.sum(lifted) == 6


@pytest.mark.parametrize(("weight", "receiver"), [("own", 1), ("behind", 0), ("ahead", 2), ("across", 4)])
def test_a_weight_reaches_the_neighbour_that_it_names(weight: str, receiver: int):
    """What L2 sends is felt by one leg alone, with the sign of the weight."""
    y = np.zeros((1, 6))
    y[0, L2] = 2.0
    plain, joined = (one.lifts(y, legs(0.0))[0] for one in (Evolved(), replace(Evolved(), **{weight: -1.5})))
    assert np.argwhere(np.abs(joined - plain) > 0.01).tolist() == [[0, receiver]]
    assert joined[0, receiver] < plain[0, receiver]


def test_the_search_begins_with_legs_that_step_by_themselves():
    starts = hexmj.draw_starts(20, 1)
    walk = hexmj.walk(starts, Evolved(), 0.3, 300.0)
    lifted = walk.stance[:-1] & ~walk.stance[1:]
    assert lifted.sum(axis=0).min() >= 2
    assert (np.abs(walk.x[1:][lifted] + 11.0) < 1.0).all()
    moved = starts.copy()
    moved[:, L2] *= -0.5
    assert np.array_equal(np.delete(hexmj.walk(moved, Evolved(), 0.3, 300.0).x, L2, 2), np.delete(walk.x, L2, 2))


@pytest.mark.slow
def test_what_was_found_falls_as_rarely_from_fresh_starts_as_is_written():
    found = read_toml(FOUND)
    search: Any = command("search")
    problem, _ = search.settings(search.parse("search", shlex.split(found["command"])[2:]))
    assert problem.controller(problem.form.vector(EVOLVED)) == EVOLVED
    few = found["fresh_few"]
    flss = Sample(problem, few["starts"], few["seed"]).verdict({"evolved": EVOLVED}).flss.item()
    assert flss * few["starts"] == pytest.approx(few["falls"], abs=1.5)  # other processors round otherwise


def test_it_walks_a_tripod_with_short_steps():
    """At V = 0.5 its period is less than two thirds of a single leg's."""
    found = gait(hexmj.walk(hexmj.draw_starts(10, 1), EVOLVED, 0.5, 20 * Stride().periods(0.5)))
    assert found.periodic.all()
    assert np.allclose(found.phase, 0.5, atol=0.05)
    assert np.allclose(found.duty_factor, 1 / (1 + 0.5), atol=0.01)
    assert (found.period < 0.65 * Stride().periods(0.5)).all()
