"""Laws of the closed loop: with its own plan fed back it is the open loop, and it keeps the open loop's laws."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun
from hexmj.parameters import LDVS, UNCOORDINATED
from hexmj.physics import insect
from hexmj.physics.body import Body
from hexmj.physics.closed_loop import SensedPlan
from hexmj.physics.drive import Push, drive
from hexmj.physics.measurement import Outcomes
from hexmj.physics.physical_walks import physical_outcomes, physical_walk
from hexmj.physics.settling import settle

FEEDBACK = Body(feedback=True)


@pytest.fixture(scope="module")
def settled():
    return settle(draw_starts(12, 0), FEEDBACK)


def same(one, two, rows=slice(None)):
    names = Outcomes.__dataclass_fields__
    return all(np.array_equal(getattr(one, n)[rows], getattr(two, n), equal_nan=True) for n in names)


def test_fed_back_its_own_plan_it_is_the_open_loop(settled, monkeypatch):
    """Bit for bit, plan and body: reading nothing else, targets at +-dt and steps one by one change nothing."""
    monkeypatch.setattr(SensedPlan, "sense", lambda *_: None)
    open_loop = replace(settled, body=Body())
    assert same(physical_outcomes(settled, LDVS, 0.5, 40.0), physical_outcomes(open_loop, LDVS, 0.5, 40.0))


def test_feedback_is_felt(settled):
    assert not same(
        physical_outcomes(settled, LDVS, 0.5, 40.0), physical_outcomes(replace(settled, body=Body()), LDVS, 0.5, 40.0)
    )


def test_same_bits_for_any_threads_and_any_batch(settled):
    one, two = (physical_outcomes(settled, LDVS, 0.5, 40.0, threads=n) for n in (1, 2))
    part = physical_outcomes(settle(settled.starts[5:9], FEEDBACK), LDVS, 0.5, 40.0)
    assert same(one, two)
    assert same(one, part, slice(5, 9))


def test_mirrored_starts_give_mirrored_walks():
    starts = draw_starts(4, 2)
    walked, mirrored = (physical_walk(x, LDVS, 0.5, 30.0, body=FEEDBACK) for x in (starts, starts[:, MIRROR]))
    assert_allclose(mirrored.outcomes.fall, walked.outcomes.fall)
    assert_allclose(mirrored.centre_of_mass, walked.centre_of_mass * (1, -1, 1), atol=0.05)
    assert_allclose(mirrored.measured.x[..., MIRROR], walked.measured.x, atol=0.05)


def test_a_push_is_that_of_the_open_loop():
    """Without friction the insect moves aside by impulse over mass, though the network's steps come one by one."""
    settled, speed = settle(draw_starts(2, 0), Body(feedback=True, friction=0.0)), []
    for impulse in (0.0, 30.0):
        push = Push(np.array([impulse, -impulse]), np.array([2.0, 2.0]))
        y = insect.sensors(settled.mujoco_model).centre_of_mass.start + 1
        plan = NetworkRun(settled.starts, UNCOORDINATED, 0.0)
        path = np.concatenate([one.sensors[:, :, y] for one in drive(settled, plan, 8.0, push=push)], axis=1)
        speed.append((path[:, -1] - path[:, -40]) / 39 / settled.mujoco_model.opt.timestep)  # mm/s
    assert_allclose((speed[1] - speed[0]) * insect.MASS, [30.0, -30.0], rtol=0.02)


def test_a_swinging_foot_that_meets_the_ground_stands_there(settled):
    starts, all_legs = settled.starts, np.ones((1, 6), dtype=bool)
    plan = SensedPlan(NetworkRun(starts, LDVS, 0.5), starts)
    while plan.advance(1).stance[0, 0].all():
        pass
    now = plan.advance(1)
    leg = int(np.argmin(now.stance[0, 0]))
    off = all_legs.copy()
    off[0, leg] = False
    tips = now.x[0, [0]]
    plan.sense(np.array([0]), tips, off)
    assert not plan.advance(1).stance[0, 0, leg]
    plan.sense(np.array([0]), np.where(off, tips, 3.0), all_legs)
    after = plan.advance(1)
    assert after.stance[0, 0, leg]
    assert after.x[0, 0, leg] == 3.0 - 0.5 * plan.network.dt


def test_a_standing_leg_is_lifted_where_its_tip_is_read(settled):
    """Its target takes up the tip as read when the leg changes its state, and only then."""
    starts, one = settled.starts, np.array([0])
    plan = SensedPlan(NetworkRun(starts, UNCOORDINATED, 0.5), starts)
    for behind, stands in ((0.3, True), (-25.0, False)):
        tips = np.full((1, 6), 5.0)
        tips[0, 2] = starts[0, 2] - behind if stands else behind
        plan.sense(one, tips, np.ones((1, 6), dtype=bool))
        after = plan.advance(1)
        assert after.stance[0, 0, 2] == stands
        assert_allclose(after.x[0, 0, 2], (starts[0, 2] if stands else behind) - 0.05)


def test_a_plan_that_cannot_see_is_refused(settled):
    class Blind:
        network, done = settled.network, 0

        def advance(self, steps):
            raise AssertionError

    with pytest.raises(InputError, match="feedback = True; expected a plan that can see"):
        next(drive(settled, Blind(), 10.0))


def test_the_environment_refuses_it():
    from hexmj import environment

    with pytest.raises(InputError, match="feedback = True; expected False"):
        environment.load(body=FEEDBACK)
