"""Work and torque of a walk."""

from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

import hexmj
from hexmj.conditions import Conditions
from hexmj.physics.engine import STATE_BITS, MujocoBatch
from hexmj.physics.outcomes import EffortSoFar
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.timing import Stride

ONLY = np.array([0])


def test_work_and_torque_do_not_depend_on_chunks_and_are_those_of_the_steps() -> None:
    settled = settle(hexmj.draw_starts(2, 0), Conditions(), Stride())
    efforts = []
    for parts in (1, 3):
        plan = hexmj.LDVS.begin(settled.starts, np.full(2, 0.3), settled.stride)
        effort, chunks = EffortSoFar(settled), [*drive(settled, plan, 30.0)]
        for chunk in chunks:
            for part in np.array_split(np.arange(chunk.qpos.shape[1]), parts):
                shown = {name: getattr(chunk, name)[:, part] for name in ("qpos", "torque")}
                valid = np.clip(chunk.valid - part[0], 0, len(part))
                effort.add(replace(chunk, **shown, valid=valid))
        efforts.append((effort.work, effort.torque))
    assert np.allclose(efforts[0][0], efforts[1][0], rtol=1e-12)
    assert np.array_equal(efforts[0][1], efforts[1][1])
    q = np.concatenate([chunk.qpos for chunk in chunks], axis=1)[..., settled.compiled.columns.qpos]
    torque = np.concatenate([chunk.torque for chunk in chunks], axis=1)[:, :-1]
    h = settled.compiled.model.opt.timestep
    work = np.maximum(torque * np.diff(q, axis=1) / h, 0).sum(axis=(1, 2)) * h
    assert np.allclose(efforts[0][0], work, rtol=1e-12)
    assert np.array_equal(efforts[0][1], (np.abs(torque) / settled.compiled.torque_limits).max(axis=(1, 2)))


def test_the_torque_is_the_one_that_moves_the_masses() -> None:
    """M dv / h, less all other forces, by the equation of motion; of servos that pull at their limit, too."""
    settled = settle(hexmj.draw_starts(1, 0), Conditions(), Stride())
    compiled, model = settled.compiled, settled.compiled.model
    swung = np.random.default_rng(0).uniform(-0.6, 0.6, (4, 18)).repeat(10, axis=0)
    control = np.tile(settled.ctrl[0], (40, 1))
    control[:, compiled.columns.ctrl] += swung
    batch, data = MujocoBatch(compiled, 1, 1), mujoco.MjData(model)
    batch.put(ONLY, settled.state)
    seen = batch.roll(ONLY, control[np.newaxis], 1)
    mujoco.mj_setState(model, data, settled.state[0], STATE_BITS)
    moving, masses = [], np.empty((model.nv, model.nv))
    for row in control:
        data.ctrl[:] = row
        begun, before = copy(data), data.qvel.copy()
        mujoco.mj_forward(model, begun)
        mujoco.mj_fullM(model, begun, masses)
        mujoco.mj_step(model, data)
        others = begun.qfrc_smooth + begun.qfrc_constraint - begun.qfrc_actuator
        moving.append((masses @ (data.qvel - before) / model.opt.timestep - others)[compiled.columns.qvel])
    limited = np.abs(seen.force[0, :, compiled.columns.ctrl]) >= compiled.torque_limits
    assert 20 < limited.sum() < limited.size - 20
    np.testing.assert_allclose(seen.torque[0], moving, atol=1e-9 * compiled.torque_limits.max())
    slowed = np.abs(seen.torque[0] - seen.force[0, :, compiled.columns.ctrl])[~limited]
    assert slowed.max() > 0.1 * compiled.torque_limits.max()
