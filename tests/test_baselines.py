"""The common part of all baselines: the interface, the legs, and their names."""

from functools import partial
from typing import Any, cast

import numpy as np
import pytest

import hexmj
from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.evolved import Evolved
from hexmj.controllers.baselines.lifted import Lifted
from hexmj.controllers.baselines.metronomes import Metronome
from hexmj.controllers.baselines.walknet import Walknet
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.protocol import SteerablePlan
from hexmj.errors import InputError
from hexmj.gaits import gait
from hexmj.measures.kinematic import walk
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_mean, wilson_phase
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PLANNED
from tiers import few_of


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(BASELINES, "wilson", "cpg-tripod", "tegotae"))
def test_every_baseline_keeps_the_interface_and_is_found_by_name(name: str) -> None:
    assert hexmj.load_controller(name) is BASELINES[name]
    check_controller(BASELINES[name])


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_restarts_as_it_began(name: str) -> None:
    baseline, starts, stride = BASELINES[name], hexmj.draw_starts(6, 3), Stride()
    velocity, eq11 = np.full(6, 0.5), Acceleration(rate=0.005)
    begin = partial(Lifted.begin, baseline) if isinstance(baseline, Lifted) else baseline.begin
    plan, other = (begin(starts, velocity, stride, eq11) for _ in range(2))
    assert isinstance(plan, SteerablePlan)
    plan.advance(300)
    plan.see(plan.tips, plan.standing)
    plan.restart(np.ones(6, dtype=bool), starts)
    again, first = plan.advance(300), other.advance(300)
    for one in PLANNED:
        assert np.array_equal(getattr(again, one), getattr(first, one), equal_nan=True)
    assert np.array_equal(again.velocity, first.velocity)


@pytest.mark.slow
@pytest.mark.parametrize(("wave", "name"), [("wilson", "wilson"), ("graham", "graham")])
@pytest.mark.parametrize("velocity", few_of([0.1, 0.35, 0.8], 0.35))
def test_metronomes_walk_their_gait_from_any_start(wave, name, velocity) -> None:
    metronome, stride = BASELINES[name], Stride()
    assert isinstance(metronome, Metronome)
    found = gait(walk(hexmj.draw_starts(5, 1), metronome, velocity, 20 * stride.periods(velocity)))
    along = wilson_phase(velocity) if wave == "wilson" else 0.5
    assert found.periodic.all()
    assert np.allclose(circular_mean(found.phase[:, IPSILATERAL] - along + 0.5, axis=1), 0.5, atol=0.005)
    assert np.allclose(found.phase[:, CONTRALATERAL], 0.5, atol=0.005)
    assert np.allclose(found.duty_factor, 1 / (1 + velocity), atol=0.02)  # swings even out by a factor V a period


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("theta", lambda: Evolved(theta=float("nan"))),
        ("wave", lambda: Metronome(cast(Any, "gallop"))),
        ("rules", lambda: Walknet(rules=(1, 4))),
    ],
)
def test_invalid_constants_are_refused(name: str, make: Any) -> None:
    with pytest.raises(InputError, match=name):
        make()
