"""Tegotae: a loaded leg is kept on the ground, legs whose neighbours are loaded leave it, and a tripod comes of it."""

import numpy as np
import pytest

import hexmj
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.tegotae import Tegotae
from hexmj.gaits import gait
from hexmj.measures.kinematic import walk
from hexmj.timing import Stride


def rates(phase: float, load: list[float]) -> np.ndarray:
    """(leg,) d phi / dt over a standing leg's own rate, all legs at one phase [periods]."""
    stride, at = Stride(), np.full((1, 6), phase)
    legs = Legs(np.zeros((1, 6)), np.ones((1, 6), dtype=bool), np.array([load]), np.array([[0.5]]), stride)
    after, _ = Tegotae().lifts(at, legs)
    return ((after - at) / (0.5 * 0.5 * stride.dt / (stride.aep0 - stride.pep0)))[0]


@pytest.mark.parametrize("phase", [0.55, 0.75, 0.95])
def test_equation_1(phase: float) -> None:
    load = [0.3, 0.1, 0.0, 0.2, 0.25, 0.15]
    near = np.array([(0.1 + 0.2) / 2, (0.3 + 0.0 + 0.25) / 3, (0.1 + 0.15) / 2])  # in front, behind and across
    expected = 1 + 0.5 * 6 * (near - load[:3]) * np.cos(2 * np.pi * phase)
    assert np.allclose(rates(phase, load)[:3], expected)


def test_a_load_draws_a_phase_to_mid_stance_and_that_of_its_neighbours_to_mid_swing() -> None:
    only_middle = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0]
    early, late = rates(0.6, only_middle), rates(0.9, only_middle)
    assert early[1] > 1 > late[1]  # of the leg itself, on both sides of phi = 3 pi / 2
    assert early[0] < 1 < late[0] and early[4] < 1 < late[4] and early[2] < 1 < late[2]
    assert np.allclose(early[[3, 5]], 1)


def test_six_legs_that_carry_equal_parts_go_at_their_own_rate() -> None:
    assert np.allclose(rates(0.9, [1 / 6] * 6), 1)


@pytest.mark.slow
def test_a_tripod_comes_of_the_load_alone() -> None:
    stride, starts = Stride(), hexmj.draw_starts(6, 2)
    found = gait(walk(starts, BASELINES["tegotae"], 0.5, 25 * stride.periods(0.5)))
    assert found.periodic.all()
    assert np.allclose(found.phase, 0.5, atol=0.02)
    deaf = gait(walk(starts, Tegotae(0.0, 0.0), 0.5, 25 * stride.periods(0.5)))
    assert not (np.abs(deaf.phase - 0.5) < 0.1).all(axis=1).any()
