"""Pushes from the side give the momentum asked for, to starts that walk then."""

from contextlib import nullcontext
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.controllers.planning import begin
from hexmj.errors import InputError
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.pushes import Push, can_push
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from tiers import few_of


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(24, 0))


@pytest.mark.parametrize("vp", [80.0, 400.0])
def test_a_push_gives_the_momentum_asked_for(vp):
    """Without friction the ground holds nothing back: the whole insect moves aside by impulse over mass."""
    settled = settle(draw_starts(3, 0), Conditions(friction=0.0, vp=vp))
    speed = []
    for impulse in (0.0, 30.0):
        push = Push(np.array([impulse, -impulse, 0.0]), np.full(3, 2.0))
        plan = begin(UNCOORDINATED, settled.starts, 0.0, settled.stride)
        centre = settled.compiled.columns.centre_of_mass
        y = np.concatenate(
            [one.sensors[:, :, centre][:, :, 1] for one in drive(settled, plan, 0.1 * vp, pushes=[push])], axis=1
        )
        speed.append((y[:, -1] - y[:, -40]) / 39 / settled.compiled.model.opt.timestep)  # mm/s
    assert_allclose((speed[1] - speed[0])[:2] * STICK_INSECT.mass, [30.0, -30.0], rtol=0.02)
    assert speed[1][2] == speed[0][2]


def test_a_push_lasts_as_long_whatever_the_physics_step():
    """So standing insects slide as far, by 30 mm; a quarter of the step changes that by 3 %, so by less than 5."""
    slid = []
    for longest in (0.625, 0.15625):
        settled = settle(draw_starts(3, 0), Conditions(longest_substep=longest))
        push = Push(np.full(3, 800.0), np.full(3, 2.0))
        plan = begin(UNCOORDINATED, settled.starts, 0.0, settled.stride)
        *_, last = drive(settled, plan, 8.0, pushes=[push])
        slid.append(last.qpos[:, -1, 1])
    assert_allclose(slid[1], slid[0], rtol=0.05)


@pytest.mark.parametrize("vp", [60.0, 100.0])
def test_a_push_begins_when_told(vp):
    """In whole steps of the plan."""
    settled = settle(draw_starts(3, 0), Conditions(vp=vp))
    lasts = round(0.025 * vp / settled.stride.dt)
    begun = np.array([2 * lasts, 2 * lasts, 2 * lasts + 4])
    push = Push(np.full(3, 10.0 * vp), begun * settled.stride.dt)
    ends = []
    for pushed in ([push], []):
        plan = begin(LDVS, settled.starts, 0.3, settled.stride)
        shown = [one.qpos for one in drive(settled, plan, 4.0 * lasts * settled.stride.dt, pushes=pushed)]
        ends.append(np.concatenate(shown, axis=1))
    for start, begins in enumerate(begun * settled.substeps):
        assert np.array_equal(ends[0][start, : begins + 1], ends[1][start, : begins + 1])
        assert (ends[0][start, begins + 1] != ends[1][start, begins + 1]).any()


@pytest.mark.slow
@pytest.mark.parametrize("vp", few_of([80.0, 130.0], 130.0))
def test_a_push_depends_on_no_start_beside(vp):
    """To the last bit, however their pushes cut the chunks."""
    conditions, starts, times = Conditions(vp=vp), draw_starts(3, 4), np.array([12.0, 14.0, 16.3])
    impulse = 20.0 * conditions.body.mass * vp

    def outcomes(ids: list[int]) -> Outcomes:
        settled = settle(starts[ids], conditions)
        plan = begin(LDVS, settled.starts, 0.4, settled.stride)
        push = Push(np.full(len(ids), impulse), times[ids])
        return outcomes_of_plan(settled, plan, 80.0, np.full(len(ids), np.inf), pushes=[push])

    together = outcomes([0, 1, 2])
    for n in range(3):
        alone = outcomes([n])
        for one in fields(Outcomes):
            assert getattr(alone, one.name).tobytes() == getattr(together, one.name)[[n]].tobytes(), one.name


BAD: dict[str, tuple[Any, Any]] = {
    "one start": (np.ones(1), np.zeros(1)),
    "before the walk": (np.ones(2), np.array([0.0, -1.0])),
    "ends after the walk": (np.ones(2), np.array([0.0, 3.1])),
}


@pytest.mark.parametrize("case", BAD)
def test_pushes_that_make_no_sense_are_refused(case):
    """A walk of 5.05 time units ends with the step at 5; a push lasts 2."""
    settled = settle(draw_starts(2, 0))
    with pytest.raises(InputError):
        list(drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 5.05, pushes=[Push(*BAD[case])]))
    last = Push(np.ones(2), np.full(2, 3.0))
    assert list(drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 5.05, pushes=[last]))


@pytest.mark.parametrize(("vp", "fits"), [(8.0, False), (20.0, False), (21.0, True)])
def test_steps_of_the_plan_must_be_short_enough_for_a_push(vp, fits):
    """A push lasts 25 ms, to the nearest step of the plan."""
    conditions, stride = Conditions(vp=vp), Stride(dt=1.0)
    assert can_push(conditions, stride) == fits
    settled = settle(draw_starts(1, 0, stride), conditions, stride)
    for impulse in (0.0, 1.0):
        push = Push(np.full(1, impulse), np.ones(1))
        with nullcontext() if fits or not impulse else pytest.raises(InputError):
            list(drive(settled, begin(LDVS, settled.starts, 0.5, stride), 4.0, pushes=[push]))
