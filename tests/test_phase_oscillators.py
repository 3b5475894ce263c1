"""flygym's central pattern generator: the phases of its tables, and how strongly it pulls at them."""

import numpy as np
import pytest

import hexmj
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.phase_oscillators import BIASES, Oscillators, PhaseOscillators
from hexmj.gaits import gait
from hexmj.measures.kinematic import walk
from hexmj.phases import PAIRS
from hexmj.timing import Stride
from tiers import few_of

GAITS = ("tripod", "tetrapod", "wave")


@pytest.mark.parametrize("name", GAITS)
def test_a_table_of_phases_says_the_same_of_every_pair_of_legs(name: str) -> None:
    bias = BIASES[name]
    around = bias[:, :, None] + bias[None, :, :] - bias[:, None, :]  # i to j and on to k, less i to k
    assert np.allclose(around, np.round(around))


@pytest.mark.slow
@pytest.mark.parametrize("name", GAITS)
@pytest.mark.parametrize("velocity", few_of([0.3, 0.7], 0.7))
def test_legs_come_to_swing_as_the_table_says_and_for_the_usual_time(name: str, velocity: float) -> None:
    stride = Stride()
    found = gait(walk(hexmj.draw_starts(6, 2), BASELINES[f"cpg-{name}"], velocity, 25 * stride.periods(velocity)))
    lag = np.array([-BIASES[name][j, k] for j, k in PAIRS.values()])  # a leg that is ahead swings earlier
    assert found.periodic.all()
    assert np.allclose((found.phase - lag + 0.5) % 1.0, 0.5, atol=0.01)
    assert np.allclose(found.period, stride.periods(velocity), rtol=0.002)
    assert np.allclose(found.duty_factor, 1 / (1 + velocity), atol=0.01)


@pytest.mark.parametrize("velocity", [0.3, 0.7])
def test_oscillators_that_are_not_coupled_step_a_whole_range_each_by_itself(velocity: float) -> None:
    stride, alone = Stride(), PhaseOscillators(coupling=0.0)
    found = walk(hexmj.draw_starts(6, 2), alone, velocity, 5 * stride.periods(velocity))
    assert np.abs(found.x.min(axis=0) - stride.pep0).max() < 0.5  # mm
    assert np.abs(found.x.max(axis=0) - stride.aep0).max() < 0.1


def test_two_tripods_in_phase_are_driven_apart_at_the_rate_of_equation_1() -> None:
    stride, small = Stride(), 1e-4
    legs = Legs(np.zeros((1, 6)), np.ones((1, 6), bool), np.full((1, 6), 1 / 6), np.array([[0.5]]), stride)
    apart = np.array([[0.0, small, 0.0, small, 0.0, small]])  # periods; each leg is pulled by the three of the other
    after, _ = PhaseOscillators().lifts(Oscillators(apart, np.ones((1, 1))), legs)
    dt = stride.dt / stride.periods(0.5) / 12.0  # seconds of the source, w = 10 / s
    assert (after.phase[0, 1] - after.phase[0, 0]) / small == pytest.approx(1 + 2 * 3 * 10.0 * dt, rel=1e-5)
