"""Feet never sink in: steps in which one strikes the ground are taken finely, and no others."""

import mujoco
import numpy as np
import pytest
from dm_control.rl import control
from numpy.testing import assert_allclose, assert_array_equal

from hexmj import environment
from hexmj.environment import InsectPhysics
from hexmj.legs import LEGS
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun
from hexmj.parameters import LDVS
from hexmj.physics import insect, strikes
from hexmj.physics.body import Body
from hexmj.physics.drive import Push, Stretch, drive
from hexmj.physics.ground import depth_in_ground
from hexmj.physics.measurement import Outcomes
from hexmj.physics.physical_walks import outcomes_of_plan
from hexmj.physics.settling import Settled, settle

OBSTACLES = {
    ground: Body(ground=ground, ground_at=45.0, ground_length=8.0, ground_height=4.0)
    for ground in ("flat", "step", "gap", "hurdle", "rough")
}
CONDITIONS = {
    **OBSTACLES,
    "slow": Body(vp=20.0),
    "fast": Body(vp=400.0),
    "hard landing": Body(lift_time=1.0, landing_time=1.0),
    "low": Body(standing_height=7.0),
    "closed loop": Body(feedback=True),
}
FAR = 10.0
"""Depth from which on the nearest side of an obstacle may be one that only MuJoCo knows, as its lower one [mm]."""
PUSH = 60.0
"""In multiples of m V_p, as `disturb` has it: the insect slides and tips at up to 4.8 m/s."""


def walked(settled: Settled, velocity: float = 0.6) -> list[Stretch]:
    """80 time units; an obstacle is reached after 7 mm."""
    return list(drive(settled, NetworkRun(settled.starts, LDVS, velocity), 80.0))


def outcomes(settled: Settled, push: float = 0.0, threads: int | None = None) -> Outcomes:
    """Of the same walks, pushed aside at 20 time units by a multiple of m V_p."""
    size = len(settled.starts)
    pushed = Push(np.full(size, push * insect.MASS * settled.body.vp), np.full(size, 20.0))
    plan = NetworkRun(settled.starts, LDVS, 0.6)
    return outcomes_of_plan(settled, plan, 80.0, np.full(size, np.inf), push=pushed, threads=threads)


@pytest.mark.parametrize("ground", OBSTACLES)
def test_depth_is_that_of_mujocos_contacts(ground):
    """The insect in random postures among the obstacles, turned and tilted; a foot without contact is above ground."""
    body = OBSTACLES[ground]
    model, rng = insect.load(body=body), np.random.default_rng(0)
    data, radius = mujoco.MjData(model), insect.dimensions(model).foot
    geoms = [model.geom(f"{leg}_foot").id for leg in LEGS]
    in_contact = 0
    for _ in range(400):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[:3] += rng.uniform((30.0, -30.0, -2.0), (80.0, 30.0, 5.0))
        data.qpos[3:] += 0.1 * rng.normal(size=22)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found = np.zeros(6)
        for contact in data.contact:
            for leg in (geoms.index(geom) for geom in contact.geom if geom in geoms):
                found[leg] = max(found[leg], -contact.dist)
        in_contact += (found > 0).sum()
        depth = np.maximum(depth_in_ground(body, data.geom_xpos[geoms], radius), 0.0)
        far = (depth > FAR) & (found > FAR)
        assert_allclose(depth[~far], found[~far], atol=1e-6)
    assert in_contact > 200


@pytest.mark.parametrize("name", CONDITIONS)
def test_feet_never_sink_in(name, monkeypatch):
    """By 2 % of the standing height, wherever and however fast the insect walks, until it has fallen."""
    settled, limit = settle(draw_starts(16, 4), CONDITIONS[name]), 0.02 * CONDITIONS[name].standing_height
    assert (outcomes(settled).depth <= limit).all()
    monkeypatch.setattr(strikes, "SINK", np.inf)
    assert outcomes(settled).depth.max() > limit, "this test would notice nothing"


def test_feet_never_sink_in_when_the_insect_is_pushed_off_them(monkeypatch):
    settled = settle(draw_starts(16, 4))
    limit = 0.02 * settled.body.standing_height
    assert (outcomes(settled, PUSH).depth <= limit).all()
    monkeypatch.setattr(strikes, "SINK", np.inf)
    assert outcomes(settled, PUSH).depth.max() > 5 * limit, "this test would notice nothing"


def test_fine_steps_depend_on_nothing_but_their_own_insect():
    """Pushed, so that nearly all take some: the same bits with one thread, and among fewer."""
    settled, few = settle(draw_starts(16, 4)), settle(draw_starts(16, 4)[5:9])
    one, two, part = outcomes(settled, PUSH, threads=1), outcomes(settled, PUSH, threads=2), outcomes(few, PUSH)
    for name in Outcomes.__dataclass_fields__:
        assert_array_equal(getattr(one, name), getattr(two, name))
        assert_array_equal(getattr(one, name)[5:9], getattr(part, name))


def test_a_dropped_insect_rebounds_as_from_fine_steps_and_hard_contacts_throughout(monkeypatch):
    """Dividing only the steps that strike neither adds energy nor takes it: within 2 %, from 50 mm.

    Measured: 16.2 mm, 16.3 mm with fine steps throughout, 17.3 mm with the usual steps alone.
    """
    usual, fine = (settle(draw_starts(12, 4), Body(longest_substep=ms)) for ms in (0.625, 0.15625))
    fine.mujoco_model.pair_solref[:, 0] = 2 * fine.mujoco_model.opt.timestep
    struck, reference = rebound(usual), rebound(fine)
    assert struck == pytest.approx(reference, rel=0.02)
    monkeypatch.setattr(strikes, "SINK", np.inf)
    assert rebound(usual) != pytest.approx(reference, rel=0.02), "this test would notice nothing"


def rebound(settled: Settled) -> float:
    """Mean height to which the root comes back after a drop from 50 mm [mm]."""
    settled.qpos[:, 2] += 50.0
    heights = np.full((len(settled.starts), 0), np.nan)
    for one in drive(settled, NetworkRun(settled.starts, LDVS, 0.0), 24.0):
        shown = np.full((len(heights), one.qpos.shape[1]), np.nan)
        shown[one.ids] = np.where(np.arange(shown.shape[1]) < one.valid[:, None], one.qpos[:, :, 2], np.nan)
        heights = np.concatenate([heights, shown], axis=1)
    settled.qpos[:, 2] -= 50.0
    landing = round(0.2 / settled.mujoco_model.opt.timestep)
    lowest = np.nanargmin(heights[:, :landing], axis=1)
    return float(np.mean([np.nanmax(one[i:]) for one, i in zip(heights, lowest, strict=True)]))


def test_nobody_else_takes_fine_steps(monkeypatch):
    """Insects walk by the usual steps, to the last bit, until the first in which a foot would strike the ground."""
    settled = settle(draw_starts(24, 4))
    fine = walked(settled, 0.4)
    monkeypatch.setattr(strikes, "SINK", np.inf)
    usual = walked(settled, 0.4)
    monkeypatch.undo()
    columns, m = insect.sensors(settled.mujoco_model), settled.body.substeps(settled.network)
    parted = 0
    for start in np.intersect1d(fine[-1].ids, usual[-1].ids):
        one, other = (np.concatenate([x.qpos[x.ids == start][0] for x in walk]) for walk in (fine, usual))
        feet = np.concatenate([x.sensors[x.ids == start][0][:, columns.foot] for x in usual]).reshape(-1, 6, 3)
        depth = depth_in_ground(settled.body, feet, insect.dimensions(settled.mujoco_model).foot)
        struck = strikes.strikes(depth, m, settled.body.standing_height)
        first = np.argmax(struck) // m * m + 1 if struck.any() else len(one)
        assert_array_equal(one[:first], other[:first])
        assert not struck.any() or (one[first] != other[first]).any()
        parted += struck.any()
    assert 0 < parted < 24


@pytest.mark.parametrize(
    ("moves", "struck"),
    [
        ((-1.0, -1.0, -1.0, -1.0, -1.0), (0, 0, 0, 0)),
        ((-1.0, -1.0, -1.0, 0.21, -1.0), (0, 0, 1, 0)),
        ((-1.0, -1.0, -1.0, -0.3, -0.04), (0, 0, 0, 1)),  # above ground, on at its speed
        ((-0.3, -0.04, -0.04, -0.04, -0.04), (0, 0, 0, 0)),  # not asked in the middle of a step of the network
        ((-1.0, -1.0, -1.0, 0.05, 0.16), (0, 0, 0, 1)),  # in the ground, on at half its speed
        ((-1.0, -1.0, -1.0, 0.13, 0.17), (0, 0, 0, 0)),
    ],
)
def test_a_step_is_fine_if_a_foot_is_too_deep_or_will_be_right_after_it(moves, struck):
    depth = np.full((2, 5, 6), -1.0)  # (start, 1 + step, leg); the limit is 0.2 mm
    depth[1, :, 4] = moves
    assert_array_equal(strikes.strikes(depth, 2, 10.0), [4 * (False,), struck])


def test_forces_of_a_fine_step_are_means():
    sensors = np.arange(24.0).reshape(8, 3)  # (part, column)
    assert_array_equal(strikes.in_whole_steps(sensors, 4, slice(1, 2)), [[0.0, 5.5, 2.0], [12.0, 17.5, 14.0]])


def thrown() -> InsectPhysics:
    """An insect thrown at the ground at 1 m/s, so that its next steps have to be fine."""
    walking = environment.load(actions="joints")
    walking.reset()
    walking.physics.data.qvel[2] = -1000.0
    walking.physics.forward()
    return walking.physics


def test_a_copy_of_the_environments_physics_goes_on_the_same_way(monkeypatch):
    """As planners need it, in fine steps too."""
    physics = thrown()
    copies = physics.copy(), physics.copy()
    physics.step(2)
    copies[0].step(2)
    assert_array_equal(copies[0].position(), physics.position())
    monkeypatch.setattr(strikes, "SINK", np.inf)
    copies[1].step(2)
    assert (copies[1].position() != physics.position()).any(), "these steps were not fine"


def test_fine_steps_of_the_environment_last_no_longer():
    physics = thrown()
    physics.step(2)
    assert physics.time() == pytest.approx(2 * physics.timestep(), rel=1e-12)


def test_an_error_in_a_fine_step_leaves_the_model_as_it_was(monkeypatch):
    physics, advance = thrown(), InsectPhysics._advance
    usual = physics.timestep(), physics.model.pair_solref.copy()

    def diverge(self, rows):
        if len(rows) > 2:
            raise control.PhysicsError("diverged")
        return advance(self, rows)

    monkeypatch.setattr(InsectPhysics, "_advance", diverge)
    with pytest.raises(control.PhysicsError):
        physics.step(2)
    assert physics.timestep() == usual[0]
    assert_array_equal(physics.model.pair_solref, usual[1])
