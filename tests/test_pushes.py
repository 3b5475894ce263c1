"""Pushes from the side give the momentum asked for, to starts that walk then."""

from contextlib import nullcontext
from dataclasses import fields

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
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.starts import draw_starts
from hexmj.studies.disturbance import DisturbedWalks
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
            [one.sensors[:, :, centre][:, :, 1] for one in drive(settled, plan, 0.1 * vp, push=push)], axis=1
        )
        speed.append((y[:, -1] - y[:, -40]) / 39 / settled.compiled.model.opt.timestep)  # mm/s
    assert_allclose((speed[1] - speed[0])[:2] * STICK_INSECT.mass, [30.0, -30.0], rtol=0.02)
    assert speed[1][2] == speed[0][2]


@pytest.mark.parametrize("time", [-1.0, 3.1, 5.0, 1e9])
def test_a_push_that_is_not_all_within_the_walk_is_refused(time):
    """Whose steps end at 5, though it is told to take 5.05; a push lasts 2."""
    settled = settle(draw_starts(2, 0))
    for impulse, refused in ((0.0, False), (100.0, True)):
        push = Push(np.array([0.0, impulse]), np.array([0.0, time]))
        chunks = drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 5.05, push=push)
        said = pytest.raises(InputError)
        with said if refused else nullcontext():
            list(chunks)
    assert list(
        drive(settled, begin(LDVS, settled.starts, 0.5, settled.stride), 5.05, push=Push(np.ones(2), np.full(2, 3.0)))
    )


@pytest.mark.parametrize("name", ["impulse", "time"])
def test_a_push_is_finite(name):
    for wrong in (np.nan, np.inf):
        with pytest.raises(InputError):
            Push(**{"impulse": np.zeros(2), "time": np.zeros(2), name: np.array([0.0, wrong])})


@pytest.mark.parametrize("wrong", [np.ones(1), np.array(1.0), [1.0, 2.0], "hard"], ids=repr)
def test_a_push_is_of_all_starts(settled, wrong):
    n_starts = len(settled.starts)
    with pytest.raises(InputError):
        push = Push(wrong, np.zeros(n_starts))
        list(drive(settled, begin(LDVS, settled.starts, 0.3, settled.stride), 4.0, push=push))


def test_a_push_lasts_as_long_whatever_the_physics_step():
    """So standing insects slide as far, by 30 mm; a quarter of the step changes that by 3 %, so by less than 5."""
    slid = []
    for longest in (0.625, 0.15625):
        settled = settle(draw_starts(3, 0), Conditions(longest_substep=longest))
        push = Push(np.full(3, 800.0), np.full(3, 2.0))
        plan = begin(UNCOORDINATED, settled.starts, 0.0, settled.stride)
        *_, last = drive(settled, plan, 8.0, push=push)
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
    for pushed in (push, None):
        plan = begin(LDVS, settled.starts, 0.3, settled.stride)
        shown = [one.qpos for one in drive(settled, plan, 4.0 * lasts * settled.stride.dt, push=pushed)]
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
        return outcomes_of_plan(settled, plan, 80.0, np.full(len(ids), np.inf), push=push)

    together = outcomes([0, 1, 2])
    for n in range(3):
        alone = outcomes([n])
        for one in fields(Outcomes):
            assert getattr(alone, one.name).tobytes() == getattr(together, one.name)[[n]].tobytes(), one.name


@pytest.mark.parametrize(("vp", "dt", "told"), [(8.0, 1.0, "125 ms"), (20.0, 1.0, "50 ms"), (21.0, 1.0, None)])
def test_steps_in_which_no_push_fits_are_refused(vp, dt, told):
    """One of 25 ms, to the nearest step; who pushes nobody is told nothing."""
    conditions, stride = Conditions(vp=vp), Stride(dt=dt)
    with pytest.raises(InputError) if told else nullcontext():
        DisturbedWalks(LDVS, conditions=conditions, stride=stride, velocities=[0.5], n_starts=2)
    DisturbedWalks(LDVS, conditions=conditions, stride=stride, velocities=[0.5], n_starts=2, disturbances=["halt"])
    settled = settle(draw_starts(1, 0, stride), conditions, stride)
    for impulse in (0.0, 1.0):
        push = Push(np.full(1, impulse), np.ones(1))
        with pytest.raises(InputError) if told and impulse else nullcontext():
            list(drive(settled, begin(LDVS, settled.starts, 0.5, stride), 4.0, push=push))
