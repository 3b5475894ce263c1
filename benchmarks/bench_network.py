"""FLSS of the network alone: useful start-steps a second, those before a loss or the end, on all cores."""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import plain_network
from benchmarks.peers import numba_first_loss, numpy_first_loss
from benchmarks.table import ONE_CORE
from hexmj import HWS, LDVS, Acceleration, Stride, draw_starts, first_loss
from hexmj.controllers.cruse1998.weights import general
from hexmj.timing import observation_duration, steps_within

STARTS = draw_starts(70_000, 0)
STRIDE = Stride()
SLOWER = {"plain Numba loop": 2000, "vectorised NumPy": 8000, "readable Python": 2}
"""Peers, and starts that they do in reasonable time; NumPy and the readable network run on one thread."""


def start_steps(lost: np.ndarray, duration: float) -> float:
    """Steps taken up to the losses [million]."""
    return np.minimum(np.round(lost / STRIDE.dt), int(steps_within(duration, STRIDE))).sum() / 1e6


def plain(starts: np.ndarray, velocity: float, duration: float) -> None:
    for start in starts:
        plain_network.first_loss(
            list(start), general(LDVS.weights), velocity, int(steps_within(duration, STRIDE)), STRIDE
        )


@pytest.mark.parametrize("velocity", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("who", ["hexmj", *SLOWER])
def test_constant_velocity(measure, velocity, who):
    duration = float(observation_duration("walk", np.array(velocity), STRIDE))
    most = {"hexmj": 70_000} | SLOWER
    starts = STARTS[: most[who] if velocity > 0.3 or who == "readable Python" else most[who] // 8]
    work = {
        "hexmj": lambda: first_loss(starts, LDVS, velocity, duration, threads=2),
        "plain Numba loop": lambda: numba_first_loss(starts, LDVS, velocity, duration),
        "vectorised NumPy": lambda: numpy_first_loss(starts, LDVS, velocity, duration),
        "readable Python": lambda: plain(starts, velocity, duration),
    }[who]
    amount = start_steps(first_loss(starts, LDVS, velocity, duration), duration)
    what = f"FLSS, LDVS, V = {velocity}, observation time walk"
    measure(work, what, who, amount=amount, unit="million start-steps/s", bar=150.0, rounds=5)


@pytest.mark.parametrize("who", ["hexmj", "plain Numba loop"])
@pytest.mark.parametrize("controller", [LDVS, HWS], ids=["LDVS", "HWS"])
def test_acceleration(measure, controller, who):
    loss = {"hexmj": first_loss, "plain Numba loop": numba_first_loss}[who]
    starts, acceleration = STARTS[: SLOWER.get(who, 7000)], Acceleration()
    duration = float(observation_duration("start", np.array(0.9), STRIDE, acceleration))
    amount = start_steps(first_loss(starts, controller, 0.9, duration, acceleration=acceleration), duration)
    work = partial(loss, starts, controller, 0.9, duration, acceleration=acceleration, threads=2)
    what = f"FLSS, {controller.name.upper()}, accelerating to V = 0.9"
    measure(work, what, who, amount=amount, unit="million start-steps/s", bar=100.0)


def test_one_core(measure):
    """Without a second thread: what the processor's limit is held against."""
    starts = STARTS[:7000]
    amount = start_steps(first_loss(starts, LDVS, 0.1, 660.0), 660.0)
    work = partial(first_loss, starts, LDVS, 0.1, 660.0, threads=1)
    measure(work, ONE_CORE, amount=amount, unit="million start-steps/s")


@pytest.mark.parametrize("who", ["hexmj", "all starts in memory"])
def test_memory(measure, benchmark, who):
    """Ten million starts in a process of their own."""
    program = {
        "hexmj": "from hexmj import *; flss(LDVS, [0.5], n_starts=10_000_000, observation time='start')",
        "all starts in memory": "from hexmj import *; first_loss(draw_starts(10_000_000, 0), LDVS, 0.5, 40.0)",
    }[who] + "; print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"
    command = [sys.executable, "-c", program]
    done = measure(
        lambda: subprocess.run(command, check=True, capture_output=True, text=True),
        "FLSS of 10 million starts, peak memory",
        who,
        unit="MB",
        bar=500.0,
        rounds=1,
        warm=False,
    )
    benchmark.extra_info["figure"] = float(done.stdout) * 1024 / 1e6
