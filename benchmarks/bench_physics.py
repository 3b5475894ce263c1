"""Physical walks beside MuJoCo's own loop, and closed beside open loop, in physics steps per second."""

import numpy as np
import pytest
from mujoco.batch import Batch

from hexmj import LDVS, SensoryFeedback, draw_starts
from hexmj.controllers.planning import begin
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.engine import STATE
from hexmj.physics.foot_path import TipTargets
from hexmj.physics.settle import Settled, settle

VELOCITY, DURATION = 0.1, 20.0  # no insect falls, so that both loops take the same steps


@pytest.fixture(scope="module")
def settled() -> Settled:
    """A thousand insects at rest."""
    return settle(draw_starts(1000, 0))


def controls(settled: Settled) -> np.ndarray:
    """Return the joint targets of the whole walk, (substep, start, actuator) [rad]."""
    plan = begin(LDVS, settled.starts, VELOCITY, settled.stride).advance(round(DURATION / settled.stride.dt))
    tips = TipTargets(settled.starts, settled.conditions, settled.stride).follow(plan, np.arange(len(settled.starts)))
    joints, _ = settled.compiled.inverse(tips)
    return np.ascontiguousarray(joints.reshape(*tips.shape[:2], -1).swapaxes(0, 1))


@pytest.mark.parametrize("who", ["hexmj", "bare Batch.step"])
def test_steps(measure, settled, who):
    """The same model, controls and threads; hexmj also plans, measures and detects falls."""
    steps = controls(settled)

    def bare() -> None:
        model = settled.compiled.model
        batch = Batch(model, len(settled.starts), 2)
        parts = np.split(settled.state, np.cumsum([model.nq, model.nv]), axis=1)
        for name, values in zip(STATE, parts, strict=True):
            batch.bind(name)[:] = values
        ctrl = batch.bind("ctrl")
        for now in steps:
            ctrl[:] = now
            batch.step()

    def ours() -> None:
        physical_outcomes(settled, LDVS, VELOCITY, DURATION, threads=2)

    amount, unit = steps.shape[0] * steps.shape[1] / 1e3, "thousand physics steps/s"
    measure(ours if who == "hexmj" else bare, "physical walks", who, amount=amount, unit=unit, ratio=0.95, rounds=5)


@pytest.mark.parametrize("who", ["hexmj", "the open loop"])
def test_closed_loop(measure, settled, who):
    """With sensory feedback, the plan's steps are computed one by one."""
    controller = SensoryFeedback(LDVS) if who == "hexmj" else LDVS
    substeps = settled.conditions.substeps(settled.stride)
    measure(
        lambda: physical_outcomes(settled, controller, VELOCITY, DURATION, threads=2),
        "physical walks, closed loop",
        who,
        amount=len(settled.starts) * DURATION / settled.stride.dt * substeps / 1e3,
        unit="thousand physics steps/s",
        ratio=0.5,
    )
