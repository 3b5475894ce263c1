"""Environments: one insect beside a bare loop of MuJoCo's steps, many beside physical walks.

A figure is steps per second, summed over insects; a step is one of the plan, with its physics steps.
"""

import mujoco
import numpy as np
import pytest

from hexmj import LDVS, Stride, draw_starts
from hexmj.environments.gym import StickInsect, StickInsects
from hexmj.environments.task import Task
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.settle import settle

VELOCITY, STEPS = 0.1, 1000  # no insect falls, so that both loops take the same steps
MANY, FEW_STEPS = 1000, 100


@pytest.mark.parametrize(("actions", "dt"), [("joints", 0.1), ("tips", 0.1), ("tips", 0.5)])
@pytest.mark.parametrize("who", ["hexmj", "bare mj_step, the same controls"])
def test_one(measure, who, actions, dt):
    """One insect that walks, or stands where its joints do not move; the bare loop only steps."""
    task = Task(VELOCITY, actions, stride=Stride(dt=dt), duration=1e5)
    walking, controls = StickInsect(**vars(task)), []
    data = mujoco.MjData(walking.model)
    walking.reset(seed=0)
    mujoco.mj_copyData(data, walking.model, walking.data)
    for _ in range(STEPS):
        walking.step(np.zeros(18))
        controls.append(walking.data.ctrl.copy())

    def ours() -> None:
        for _ in range(STEPS):
            walking.step(np.zeros(18))

    def bare() -> None:
        control, substeps = data.ctrl, task.substeps
        for now in controls:
            control[:] = now
            for _ in range(substeps):
                mujoco.mj_step(walking.model, data)

    work = ours if who == "hexmj" else bare
    what = f"environment, 1 insect, {actions}, {task.substeps} substeps"
    measure(work, what, who, amount=STEPS, unit="steps/s", ratio=0.5, rounds=7)


@pytest.mark.parametrize("who", ["hexmj", "physical walks"])
def test_many(measure, who):
    settled = settle(draw_starts(MANY, 0))
    walking = StickInsects(MANY, actions="tips", velocity=VELOCITY, duration=1e4, threads=2)
    walking.reset(seed=0)

    def ours() -> None:
        for _ in range(FEW_STEPS):
            walking.step(np.zeros((MANY, 18)))

    def walks() -> None:
        physical_outcomes(settled, LDVS, VELOCITY, FEW_STEPS * settled.stride.dt, threads=2)

    work, what = ours if who == "hexmj" else walks, f"environment, {MANY} insects"
    measure(work, what, who, amount=MANY * FEW_STEPS, unit="steps/s", ratio=0.8, rounds=5)
