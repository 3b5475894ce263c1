"""First moves: entries of the league that begin otherwise, and walks that begin in the steady state."""

from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.planning import (
    begin,
    first_dynamic_losses,
    first_losses,
    planned_dynamic_losses,
    planned_losses,
)
from hexmj.controllers.wrappers import WARM_UP, FromSteadyState
from hexmj.measures.compare import Comparison
from hexmj.stability import loss_time
from hexmj.timing import Stride
from hexmj.tipping import Pendulum
from hexmj.walks import PLANNED, part_of

STRIDE, STARTS = Stride(), hexmj.draw_starts(4, 66)
STEADY: dict[str, Any] = {"observation_time": 30.0, "seed": 66, "protocol": "steady"}
LATE = int(STRIDE.periods(0.5, WARM_UP) / STRIDE.dt)


def test_entries_with_another_first_move_keep_the_interface():
    tripod = hexmj.load_controller("ldvs-tripod")
    for controller in (hexmj.load_controller("graham-random"), tripod):
        check_controller(controller)
    assert np.allclose(hexmj.walk(STARTS, tripod, 0.5, 1.0).x[0] - STARTS, [0.1, -0.05, 0.1, -0.05, 0.1, -0.05])
    plan, other = (begin(tripod, hexmj.draw_starts(300, 66), 0.5, STRIDE) for _ in range(2))
    assert np.array_equal(first_losses(plan, 900), planned_losses(other, 900))


@pytest.mark.parametrize("name", ["ldvs", "tegotae"])
def test_a_steady_walk_is_the_later_part_of_a_long_walk(name):
    controller = hexmj.load_controller(name)
    late = part_of(hexmj.walk(STARTS, controller, 0.5, 30.0 + LATE * STRIDE.dt), slice(LATE, None))
    steady = hexmj.walk(STARTS, FromSteadyState(controller), 0.5, 30.0)
    assert all(np.array_equal(getattr(steady, key), getattr(late, key), equal_nan=True) for key in PLANNED)
    assert np.array_equal(steady.time, np.arange(1, 301) * STRIDE.dt)
    losses = hexmj.compare(controller, 0.5, n_starts=4, **STEADY).planned_loss.values.ravel()
    assert np.array_equal(losses, loss_time(steady))


@pytest.mark.parametrize("steps", [900, np.arange(600, 900)])
def test_losses_from_the_steady_state_are_those_of_the_plan(steps):
    starts, pendulum = hexmj.draw_starts(300, 66), Pendulum.of(10.0, 0.00125)
    plan, other = (begin(FromSteadyState(hexmj.LDVS), starts, 0.7, STRIDE) for _ in range(2))
    fast = first_dynamic_losses(plan, steps, pendulum)
    assert fast.static.any() and fast.dynamic.any()
    for found, planned in zip(fast, planned_dynamic_losses(other, steps, pendulum), strict=True):
        assert np.array_equal(found, planned)


def test_steady_results_depend_on_neither_threads_nor_batch():
    controllers = {"ldvs": hexmj.LDVS, "feedback": hexmj.SensoryFeedback(hexmj.LDVS)}
    one, two = (hexmj.compare(controllers, 0.9, n_starts=4, threads=n, **STEADY) for n in (1, 2))
    few = hexmj.compare(controllers, 0.9, n_starts=2, **STEADY)
    walked = hexmj.physical_walk(STARTS, FromSteadyState(hexmj.LDVS), 0.9, 30.0)
    assert one.identical(two) and np.array_equal(one.clearance[..., :2], few.clearance)
    assert np.array_equal(one.clearance.sel(controller="ldvs")[0], walked.outcomes.clearance)


@pytest.mark.parametrize("given", [{"velocities": [0.0]}, {"acceleration": hexmj.Acceleration()}, {"protocol": "late"}])
def test_a_protocol_is_refused_without_a_period_or_with_an_acceleration(given):
    with pytest.raises(hexmj.InputError, match="protocol"):
        Comparison({"ldvs": hexmj.LDVS}, **(STEADY | given))
