"""Physical FLSS: physics steps a second against MuJoCo's own loop, and insects in real time against flygym."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mujoco.batch import Batch

from hexmj import LDVS, compare, draw_starts
from hexmj.network import NetworkRun
from hexmj.physics import insect
from hexmj.physics.clock import stopped_clock
from hexmj.physics.kinematics import tips_to_joints
from hexmj.physics.physical_walks import physical_outcomes
from hexmj.physics.settling import Settled, settle
from hexmj.physics.targets import TipTargets

FLYGYM = Path(__file__).parents[1] / ".venv-flygym" / "bin" / "python"
VELOCITY, DURATION = 0.1, 20.0  # nobody falls, so both loops take the same steps


@pytest.fixture(scope="module")
def settled() -> Settled:
    return settle(draw_starts(1000, 0))


def controls(settled: Settled) -> np.ndarray:
    """The joint targets of the whole walk, (substep, start, actuator) [rad]."""
    plan = NetworkRun(settled.starts, LDVS, VELOCITY).advance(round(DURATION / settled.network.dt))
    tips = TipTargets(settled.starts, settled.body, settled.network).follow(plan, np.arange(len(settled.starts)))
    joints, _ = tips_to_joints(tips, insect.dimensions(settled.mujoco_model))
    return np.ascontiguousarray(joints.reshape(*tips.shape[:2], -1).swapaxes(0, 1))


@pytest.mark.parametrize("who", ["hexmj", "bare Batch.step", "the same, MuJoCo's clock stopped"])
def test_steps(measure, settled, who):
    """The same model, controls and threads; ours plans, measures and watches for falls besides."""
    steps = controls(settled)

    def bare() -> None:
        batch = Batch(settled.mujoco_model, len(settled.starts), 2)
        batch.bind("qpos")[:], batch.bind("qvel")[:] = settled.qpos, settled.qvel
        batch.bind("qacc_warmstart")[:] = settled.warmstart
        ctrl = batch.bind("ctrl")
        for now in steps:
            ctrl[:] = now
            batch.step()

    def without_clock() -> None:
        with stopped_clock():
            bare()

    def ours() -> None:
        physical_outcomes(settled, LDVS, VELOCITY, DURATION, threads=2)

    work = {"hexmj": ours, "bare Batch.step": bare}.get(who, without_clock)
    amount = steps.shape[0] * steps.shape[1] / 1e3
    measure(work, "physical walks", who, amount=amount, unit="thousand physics steps/s", ratio=0.95, rounds=5)


@pytest.mark.parametrize("who", ["hexmj", "the open loop"])
def test_closed_loop(measure, settled, who):
    """The network reads the legs before each of its steps, so these come one by one."""
    some = replace(settled, body=replace(settled.body, feedback=who == "hexmj"))
    measure(
        lambda: physical_outcomes(some, LDVS, VELOCITY, DURATION, threads=2),
        "physical walks, closed loop",
        who,
        amount=len(some.starts) * DURATION / some.network.dt * some.body.substeps(some.network) / 1e3,
        unit="thousand physics steps/s",
        ratio=0.5,
    )


@pytest.mark.parametrize(("window", "bar"), [("start", 50.0), ("walk", 240.0)])
def test_curve(measure, window, bar):
    measure(
        lambda: compare(LDVS, [v / 10 for v in range(1, 10)], starts=1000, window=window, threads=2),
        f"physical FLSS, 1000 starts, V = 0.1 to 0.9, window {window}",
        bar=bar,
        rounds=1,
        warm=False,
    )


@pytest.mark.parametrize("starts", [1, 1000])
def test_real_time(measure, settled, starts):
    """Simulated over real time, of one insect or the sum over all."""
    some = settled if starts > 1 else settle(settled.starts[:1])
    duration = DURATION if starts > 1 else 50 * DURATION
    amount = starts * duration / some.network.dt * some.body.seconds(some.network)
    what = f"walking, {starts} insect{'s' if starts > 1 else ''}"
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
