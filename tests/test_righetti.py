"""Righetti and Ijspeert's oscillators: the limit cycle, the tripod, and transitions that wait for the load."""

from contextlib import nullcontext

import numpy as np
import pytest

import hexmj
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.lifted import Legs
from hexmj.controllers.baselines.righetti import Hopf, Righetti
from hexmj.errors import InputError
from hexmj.gaits import gait
from hexmj.measures.kinematic import walk
from hexmj.timing import Stride
from tiers import few_of


def state(x: float, y: float) -> Hopf:
    return Hopf(np.full((1, 6), x), np.full((1, 6), y))


@pytest.mark.slow
@pytest.mark.parametrize("velocity", few_of([0.4, 0.7], 0.7))
def test_two_tripods_move_in_anti_phase(velocity: float) -> None:
    found = gait(walk(hexmj.draw_starts(6, 2), BASELINES["righetti"], velocity, 30 * Stride().periods(velocity)))
    assert found.periodic.all()
    assert np.allclose(found.phase, 0.5, atol=0.01)
    assert np.allclose(found.duty_factor, 1 / (1 + velocity), atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", few_of([0.3, 0.7], 0.7))
def test_a_single_oscillator_goes_round_in_the_time_of_a_stance_and_a_swing(velocity: float) -> None:
    stride, alone = Stride(dt=0.05), Righetti(coupling=0.0, push=0.0, near=0.0, sharpness=200.0)
    found = gait(walk(hexmj.draw_starts(2, 2), alone, velocity, 13 * stride.periods(velocity), stride=stride))
    assert found.periodic.all()
    assert np.allclose(found.periods, stride.periods(velocity), rtol=0.02)


@pytest.mark.parametrize(
    ("x", "y", "load", "stops", "hastens"),
    [
        (-1.0, 0.1, 0.5, True, False),  # loaded at the end of its stance: it waits
        (-1.0, 0.1, 0.1, False, False),
        (-0.5, 0.8, 0.0, False, True),  # no ground in the second half of a stance: it swings
        (-0.5, 0.8, 0.5, False, False),
        (1.0, -0.1, 0.0, True, False),  # no ground at the end of a swing: it waits
        (0.5, -0.8, 0.1, False, True),  # ground in the second half of a swing: it stands
        (-0.5, -0.8, 0.1, False, False),  # in the first halves nothing is fed back
        (0.5, 0.8, 0.0, False, False),
    ],
)
def test_load_stops_or_hastens_a_transition(x, y, load, stops, hastens) -> None:
    stop, hasten = Righetti().feedback(state(x, y), np.full((1, 6), load))
    assert (stop == stops).all() and (hasten == hastens).all()


@pytest.mark.parametrize(("load", "lifts"), [(1 / 3, False), (1 / 6, True)])
def test_a_leg_at_the_end_of_its_stance_waits_while_it_carries_a_third_of_the_weight(load: float, lifts: bool) -> None:
    stride, shape = Stride(), (1, 6)
    legs = Legs(np.full(shape, stride.pep0), np.ones(shape, bool), np.full(shape, load), np.array([[0.5]]), stride)
    rule, lifted = Righetti(), np.zeros(shape, bool)
    now = rule.at_start(legs)
    for _ in range(100):
        now, some = rule.lifts(now, legs)
        lifted |= some
    assert (lifted == lifts).all()


def test_a_step_at_which_the_oscillators_diverge_is_refused() -> None:
    """Explicit steps hold at 0.2 time units up to V = 0.95; past that legs would be lifted at PEP_min alone."""
    starts = hexmj.draw_starts(20, 1)
    for dt, velocity, refusal in (
        (0.2, 0.95, None),
        (0.5, 0.3, None),
        (0.5, 0.5, "dt = 0.5 and V_r = 0.5; expected a sho"),
    ):
        with pytest.raises(InputError, match=refusal) if refusal else nullcontext():
            hexmj.first_loss(starts, BASELINES["righetti"], velocity, 200.0, stride=hexmj.Stride(dt=dt))
