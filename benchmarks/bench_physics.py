"""Physical FLSS: physics steps a second against MuJoCo's own loop, and insects in real time against flygym."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from mujoco.batch import Batch

from hexmj import LDVS, SensoryFeedback, compare, draw_starts
from hexmj.controllers.checked_plans import begin
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.engine import STATE, STOPPED_CLOCK
from hexmj.physics.foot_path import TipTargets
from hexmj.physics.settle import Settled, settle

FLYGYM = Path(__file__).parents[1] / ".venv-flygym" / "bin" / "python"
VELOCITY, DURATION = 0.1, 20.0  # nobody falls, so both loops take the same steps


@pytest.fixture(scope="module")
def settled() -> Settled:
    return settle(draw_starts(1000, 0))


def controls(settled: Settled) -> np.ndarray:
    """The joint targets of the whole walk, (substep, start, actuator) [rad]."""
    plan = begin(LDVS, settled.starts, VELOCITY, settled.stride).advance(round(DURATION / settled.stride.dt))
    tips = TipTargets(settled.starts, settled.conditions, settled.stride).follow(plan, np.arange(len(settled.starts)))
    joints, _ = settled.compiled.inverse(tips)
    return np.ascontiguousarray(joints.reshape(*tips.shape[:2], -1).swapaxes(0, 1))


@pytest.mark.parametrize("who", ["hexmj", "bare Batch.step", "the same, MuJoCo's clock stopped"])
def test_steps(measure, settled, who):
    """The same model, controls and threads; ours plans, measures and watches for falls besides."""
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

    def without_clock() -> None:
        with STOPPED_CLOCK:
            bare()

    def ours() -> None:
        physical_outcomes(settled, LDVS, VELOCITY, DURATION, threads=2)

    work = {"hexmj": ours, "bare Batch.step": bare}.get(who, without_clock)
    amount = steps.shape[0] * steps.shape[1] / 1e3
    measure(work, "physical walks", who, amount=amount, unit="thousand physics steps/s", ratio=0.95, rounds=5)


@pytest.mark.parametrize("who", ["hexmj", "the open loop"])
def test_closed_loop(measure, settled, who):
    """The network reads the legs before each of its steps, so these come one by one."""
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


@pytest.mark.parametrize(("observation_time", "bar"), [("start", 50.0), ("walk", 240.0)])
def test_curve(measure, observation_time, bar):
    measure(
        lambda: compare(LDVS, [v / 10 for v in range(1, 10)], n_starts=1000, observation_time=observation_time, threads=2),
        f"physical FLSS, 1000 starts, V = 0.1 to 0.9, observation time {observation_time}",
        bar=bar,
        rounds=1,
        warm=False,
    )


@pytest.mark.parametrize("n_starts", [1, 1000])
def test_real_time(measure, settled, n_starts):
    """Simulated over real time, of one insect or the sum over all."""
    some = settled if n_starts > 1 else settle(settled.starts[:1])
    duration = DURATION if n_starts > 1 else 50 * DURATION
    amount = n_starts * duration / some.stride.dt * some.conditions.seconds(some.stride)
    what = f"walking, {n_starts} insect{'s' if n_starts > 1 else ''}"
    measure(lambda: physical_outcomes(some, LDVS, VELOCITY, duration), what, amount=amount, unit="times real time")


@pytest.mark.parametrize("options", [(), ("--replay",)], ids=["as shipped", "commands replayed"])
def test_flygym(measure, benchmark, options):
    """One fly on the CPU, in an environment of its own (`make bench` makes it)."""
    if not FLYGYM.exists():
        pytest.skip("flygym is not installed")
    program = [str(FLYGYM), str(Path(__file__).with_name("flygym_walk.py")), *options]
    done = measure(
        lambda: subprocess.run(program, check=True, capture_output=True, text=True),
        "walking, 1 insect",
        "flygym",
        unit="times real time",
        rounds=1,
        warm=False,
    )
    result = json.loads(done.stdout)
    benchmark.extra_info.update(who=result["peer"], figure=result["real_time_factor"])
