"""Work and torque of a walk."""

from dataclasses import replace

import numpy as np

import hexmj
from hexmj.conditions import Conditions
from hexmj.physics.drive import drive
from hexmj.physics.effort import EffortSoFar
from hexmj.physics.settling import settle
from hexmj.timing import Stride


def test_work_and_torque_do_not_depend_on_chunks_and_are_those_of_the_strides() -> None:
    settled = settle(hexmj.draw_starts(2, 0), Conditions(), Stride())
    efforts = []
    for parts in (1, 3):
        plan = hexmj.LDVS.begin(settled.starts, np.full(2, 0.3), settled.stride)
        effort, chunks = EffortSoFar(settled), [*drive(settled, plan, 30.0)]
        for chunk in chunks:
            for part in np.array_split(np.arange(chunk.qpos.shape[1]), parts):
                shown = {name: getattr(chunk, name)[:, part] for name in ("qpos", "force")}
                valid = np.clip(chunk.valid - part[0], 0, len(part))
                effort.add(replace(chunk, **shown, valid=valid))
        efforts.append((effort.work, effort.torque))
    assert np.allclose(efforts[0][0], efforts[1][0], rtol=1e-12)
    assert np.array_equal(efforts[0][1], efforts[1][1])
    q = np.concatenate([chunk.qpos for chunk in chunks], axis=1)[..., settled.compiled.columns.qpos]
    force = np.concatenate([chunk.force for chunk in chunks], axis=1)
    h, damping = settled.compiled.model.opt.timestep, -settled.compiled.model.actuator_biasprm[:18, 2]
    turning = np.diff(q, axis=1) / h
    torque = force[:, 1:-1] - damping * np.diff(turning, axis=1)
    work = np.maximum(torque * turning[:, 1:], 0).sum(axis=(1, 2)) * h
    assert np.allclose(efforts[0][0], work, rtol=1e-12)
