"""Laws of the closed loop: with its own plan fed back it is the open loop, and it keeps the open loop's laws."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import hexmj
from hexmj.controllers.feedback import SensedPlan
from hexmj.controllers.protocol import Sensed
from hexmj.legs import MIRROR
from hexmj.measures.physical import physical_outcomes, physical_walk, physical_walk_of_plan
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.rotations import heading, rotated, turned

LDVS, UNCOORDINATED = hexmj.LDVS, hexmj.UNCOORDINATED
READING = hexmj.SensoryFeedback(LDVS)
STRIDE = hexmj.Stride()


@pytest.fixture(scope="module")
def settled():
    return settle(hexmj.draw_starts(12, 0))


def same(one, two, rows=slice(None)):
    names = Outcomes.__dataclass_fields__
    return all(np.array_equal(getattr(one, n)[rows], getattr(two, n), equal_nan=True) for n in names)


def test_fed_back_its_own_plan_it_is_the_open_loop(settled, monkeypatch):
    """Bit for bit, plan and body: reading nothing else, targets at +-dt and steps one by one change nothing."""
    monkeypatch.setattr(SensedPlan, "sense", lambda *_: None)
    assert same(physical_outcomes(settled, READING, 0.5, 40.0), physical_outcomes(settled, LDVS, 0.5, 40.0))


def test_what_a_plan_is_told_is_what_the_chunks_show(settled, monkeypatch):
    """Before each step: angles and motion of now, forces and contacts of the physics step before."""
    told: list[Sensed] = []
    monkeypatch.setattr(SensedPlan, "sense", lambda _, sensed: told.append(sensed))
    plan: Any = READING.begin(settled.starts, np.full(12, 0.7), STRIDE)
    chunks = list(drive(settled, plan, 40.0))
    columns, m = settled.compiled.columns, settled.substeps
    fell = np.isin(np.arange(12), np.concatenate([one.ids[one.fell] for one in chunks]))
    assert 0 < fell.sum() < 12
    steps, ids = slice(m, 400 * m, m), np.flatnonzero(~fell)
    qpos, sensors, standing, force = (
        np.concatenate([getattr(one, name)[np.isin(one.ids, ids)] for one in chunks], axis=1)
        for name in ("qpos", "sensors", "standing", "force")
    )

    def heard(name: str) -> np.ndarray:
        """(start, step, ...), what is said before the first step left out."""
        return np.stack([getattr(one, name)[np.isin(one.ids, ids)] for one in told[1:]], axis=1)

    now, before = qpos[:, steps], slice(m - 1, 400 * m - 1, m)
    joints, contact = heard("joints"), heard("contact")
    assert_array_equal(joints.reshape(*joints.shape[:2], -1), now[..., columns.qpos])
    assert_array_equal(contact, standing[:, before])
    assert_array_equal(heard("load"), sensors[:, before, columns.touch])
    assert_array_equal(heard("torques").reshape((*joints.shape[:2], -1)), force[:, before])
    assert_allclose(heard("tips"), settled.compiled.forward(joints))
    leans = [-rotated(now[..., 3:7], axis)[..., 2] for axis in np.eye(3)[:2]]
    assert_allclose(np.sin(heard("tilt")), np.stack(leans, axis=-1), atol=1e-12)
    moved = np.diff(qpos[..., :3], axis=1)[:, before] / settled.compiled.model.opt.timestep
    ahead = turned(moved[:, :, None, :2], -heading(now[..., 3:7]))[:, :, 0]
    assert np.median(np.abs(heard("velocity")[..., :2] - ahead)) < 1e-6  # all but steps in parts
    assert np.median(np.abs(heard("velocity")[..., 2] - moved[..., 2])) < 1e-6
    earlier = np.concatenate([np.ones_like(contact[:, :1]), contact[:, :-1]], axis=1)
    assert_array_equal(heard("gained"), contact & ~earlier)
    assert_array_equal(heard("lost"), earlier & ~contact)
    assert heard("gained").any()
    assert told[0].contact.all()
    assert_array_equal(told[0].load, settled.load)
    assert_array_equal(told[0].torques.reshape(12, -1), settled.torques)


def test_feedback_is_felt(settled):
    assert not same(physical_outcomes(settled, READING, 0.5, 40.0), physical_outcomes(settled, LDVS, 0.5, 40.0))


def test_same_bits_for_any_threads_and_any_batch(settled):
    one, two = (physical_outcomes(settled, READING, 0.5, 40.0, threads=n) for n in (1, 2))
    part = physical_outcomes(settle(settled.starts[5:9]), READING, 0.5, 40.0)
    assert same(one, two)
    assert same(one, part, slice(5, 9))


def test_mirrored_starts_give_mirrored_walks():
    starts = hexmj.draw_starts(4, 2)
    walked, mirrored = (physical_walk(x, READING, 0.5, 30.0) for x in (starts, starts[:, MIRROR]))
    assert_allclose(mirrored.outcomes.fall, walked.outcomes.fall)
    assert_allclose(mirrored.centre_of_mass, walked.centre_of_mass * (1, -1, 1), atol=0.05)
    assert_allclose(mirrored.measured.x[..., MIRROR], walked.measured.x, atol=0.05)


def test_a_push_is_that_of_the_open_loop():
    """Without friction the insect moves aside by impulse over mass, though the network's steps come one by one."""
    conditions = hexmj.Conditions(friction=0.0)
    settled, standing = settle(hexmj.draw_starts(2, 0), conditions), hexmj.SensoryFeedback(UNCOORDINATED)
    still, speed = (settled.starts, np.zeros(2), STRIDE), []
    for impulse in (0.0, 30.0):
        push = Push(np.array([impulse, -impulse]), np.array([2.0, 2.0]))
        planned = standing.begin(*still).advance(80)
        path = physical_walk_of_plan(settled, standing.begin(*still), planned, pushes=[push]).centre_of_mass[:, :, 1]
        speed.append((path[-1] - path[-21]) / 20 / conditions.seconds(STRIDE))  # mm/s
    assert_allclose((speed[1] - speed[0]) * conditions.body.mass, [30.0, -30.0], rtol=0.02)


def told(tips: np.ndarray, gained: np.ndarray) -> Sensed:
    """What the first start knows: tips on their own axes and contacts gained, both (1, leg)."""
    ahead = tips + np.array(STRIDE.geometry.origin)
    rest = np.zeros((1, 6))
    return Sensed(
        ids=np.array([0]), tips=np.stack([ahead, rest, rest], axis=-1), contact=gained, gained=gained, lost=~gained,
        load=rest, joints=np.zeros((1, 6, 3)), torques=np.zeros((1, 6, 3)), tilt=np.zeros((1, 2)),
        velocity=np.zeros((1, 3)), turning=np.zeros((1, 3)),
    )  # fmt: skip


def test_a_swinging_foot_that_meets_the_ground_stands_there(settled):
    plan: Any = READING.begin(settled.starts, np.full(12, 0.5), STRIDE)
    while plan.advance(1).stance[0, 0].all():
        pass
    now = plan.advance(1)
    leg, none = int(np.argmin(now.stance[0, 0])), np.zeros((1, 6), dtype=bool)
    meets = none.copy()
    meets[0, leg] = True
    tips = now.x[0, [0]]
    plan.sense(told(tips, none))
    assert not plan.advance(1).stance[0, 0, leg]
    plan.sense(told(np.where(meets, 3.0, tips), meets))
    after = plan.advance(1)
    assert after.stance[0, 0, leg]
    assert after.x[0, 0, leg] == 3.0 - 0.5 * STRIDE.dt


def test_a_standing_leg_is_lifted_where_its_tip_is_read(settled):
    """Its target takes up the tip as read when the leg changes its state, and only then."""
    starts, none = settled.starts, np.zeros((1, 6), dtype=bool)
    plan: Any = hexmj.SensoryFeedback(UNCOORDINATED).begin(starts, np.full(12, 0.5), STRIDE)
    for behind, stands in ((0.3, True), (-25.0, False)):
        tips = np.full((1, 6), 5.0)
        tips[0, 2] = starts[0, 2] - behind if stands else behind
        plan.sense(told(tips, none))
        after = plan.advance(1)
        assert after.stance[0, 0, 2] == stands
        assert_allclose(after.x[0, 0, 2], (starts[0, 2] if stands else behind) - 0.05)


def test_the_environment_tells_it_before_every_step(monkeypatch, dm):
    told = []
    usual = SensedPlan.sense
    monkeypatch.setattr(SensedPlan, "sense", lambda plan, sensed: (told.append(sensed), usual(plan, sensed)))
    walking = dm.load(0.5, controller=READING, actions="tips", duration=2.0)
    walking.reset()
    steps = 0
    while not walking.step(np.zeros(walking.action_spec().shape)).last():
        steps += 1
    assert steps > 10
    assert len(told) > steps
    assert all(one.contact.shape == (1, 6) for one in told)
