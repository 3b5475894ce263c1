"""Feet never sink in: steps in which one strikes the ground are taken finely, and no others."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexmj.legs import LEGS
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun
from hexmj.parameters import LDVS
from hexmj.physics import insect, strikes
from hexmj.physics.body import Body
from hexmj.physics.drive import Push, Stretch, drive
from hexmj.physics.ground import depth_in_ground
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


def walked(settled: Settled, velocity: float = 0.6, push: Push | None = None) -> list[Stretch]:
    """80 time units; an obstacle is reached after 7 mm."""
    return list(drive(settled, NetworkRun(settled.starts, LDVS, velocity), 80.0, push=push))


def depths(walk: list[Stretch], starts: int) -> np.ndarray:
    """(start,) deepest of all until the fall [mm]."""
    deepest = np.full(starts, -np.inf)
    for one in walk:
        until = np.where(one.fell, one.valid - 1, one.valid)
        seen = np.where(np.arange(one.depth.shape[1]) < until[:, None], one.depth, -np.inf)
        deepest[one.ids] = np.maximum(deepest[one.ids], seen.max(axis=1))
    return deepest


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
def test_feet_never_sink_in(name):
    """By 2 % of the standing height, wherever and however fast the insect walks, until it has fallen."""
    body = CONDITIONS[name]
    settled = settle(draw_starts(16, 4), body)
    assert (depths(walked(settled), 16) <= 0.02 * body.standing_height).all()


def test_feet_never_sink_in_when_the_insect_is_pushed_off_them(monkeypatch):
    settled, push = settle(draw_starts(16, 4)), Push(np.full(16, PUSH * insect.MASS * 80.0), np.full(16, 20.0))
    limit = 0.02 * settled.body.standing_height
    assert (depths(walked(settled, push=push), 16) <= limit).all()
    monkeypatch.setattr(strikes, "SINK", np.inf)
    assert depths(walked(settled, push=push), 16).max() > 5 * limit, "this test would notice nothing"


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


def test_a_step_is_fine_if_a_foot_is_too_deep_or_will_be_right_after_it():
    height, m = 10.0, 2  # the limit is 0.2 mm
    depth = np.full((5, 5, 6), -1.0)  # (case, 1 + step, leg)
    depth[1, 3, 4] = 0.21
    depth[2, 3:, 0] = 0.19, 0.195
    depth[3, 3:, 0] = -0.3, -0.04
    depth[4, :, 0] = (
        -0.3,
        -0.04,
        -0.04,
        -0.04,
        -0.04,
    )  # in the middle of a step of the network, where the next shows it anyway
    assert_array_equal(strikes.strikes(depth, m, height), [4 * [0], [0, 0, 1, 0], 4 * [0], [0, 0, 0, 1], 4 * [0]])


def test_forces_of_a_fine_step_are_means():
    sensors = np.arange(24.0).reshape(8, 3)  # (part, column)
    assert_array_equal(strikes.in_whole_steps(sensors, 4, slice(1, 2)), [[0.0, 5.5, 2.0], [12.0, 17.5, 14.0]])
