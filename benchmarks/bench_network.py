"""Kinematic FLSS beside plain Numba, vectorised NumPy and readable Python.

A figure is useful start-steps per second: those before a loss or the end.
"""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest

import plain_network
from benchmarks.peers import numba_first_loss, numpy_first_loss
from hexmj import HWS, LDVS, Acceleration, Stride, draw_starts, first_loss
from hexmj.controllers.cruse1998.weights import general
from hexmj.timing import observation_duration, steps_within

STARTS = draw_starts(70_000, 0)
STRIDE = Stride()
COUNTS = {"hexmj": 70_000, "plain Numba loop": 2000, "vectorised NumPy": 8000, "readable Python": 2}
"""Peers and their starts. hexmj and Numba use two threads, the others one."""


def start_steps(lost: np.ndarray, duration: float) -> float:
    """Return the steps up to the losses [million]."""
    return np.minimum(np.round(lost / STRIDE.dt), int(steps_within(duration, STRIDE))).sum() / 1e6


def readable(starts: np.ndarray, velocity: float, duration: float) -> None:
    """Walk the readable network of the tests."""
    weights, steps = general(LDVS.weights), int(steps_within(duration, STRIDE))
    for start in starts:
        plain_network.first_loss(list(start), weights, velocity, steps, STRIDE)


@pytest.mark.parametrize("velocity", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("who", COUNTS)
def test_constant_velocity(measure, velocity, who):
    duration = float(observation_duration("walk", np.array(velocity), STRIDE))
    starts = STARTS[: COUNTS[who] if velocity > 0.3 or who == "readable Python" else COUNTS[who] // 8]
    work = {
        "hexmj": lambda: first_loss(starts, LDVS, velocity, duration, threads=2),
        "plain Numba loop": lambda: numba_first_loss(starts, LDVS, velocity, duration),
        "vectorised NumPy": lambda: numpy_first_loss(starts, LDVS, velocity, duration),
        "readable Python": lambda: readable(starts, velocity, duration),
    }[who]
    amount = start_steps(first_loss(starts, LDVS, velocity, duration), duration)
    measure(work, f"FLSS, LDVS, V = {velocity}", who, amount=amount, unit="million start-steps/s", ratio=2.5, rounds=5)


@pytest.mark.parametrize("who", ["hexmj", "plain Numba loop"])
@pytest.mark.parametrize("controller", [LDVS, HWS], ids=["LDVS", "HWS"])
def test_acceleration(measure, controller, who):
    loss = {"hexmj": first_loss, "plain Numba loop": numba_first_loss}[who]
    starts, acceleration = STARTS[: min(COUNTS[who], 7000)], Acceleration()
    duration = float(observation_duration("start", np.array(0.9), STRIDE, acceleration))
    amount = start_steps(first_loss(starts, controller, 0.9, duration, acceleration=acceleration), duration)
    work = partial(loss, starts, controller, 0.9, duration, acceleration=acceleration, threads=2)
    what = f"FLSS, {controller.name.upper()}, accelerating to V = 0.9"
    measure(work, what, who, amount=amount, unit="million start-steps/s", ratio=2.5)


@pytest.mark.parametrize("who", ["hexmj", "all starts in memory"])
def test_memory(measure, benchmark, who):
    """Peak memory of a process, above that of another one with a thousandth of the starts."""
    program = {
        "hexmj": "flss(LDVS, [0.5], n_starts={}, observation_time='start')",
        "all starts in memory": "first_loss(draw_starts({}, 0), LDVS, 0.5, 40.0)",
    }[who]

    def peak(n_starts: int) -> float:
        code = f"from hexmj import *; {program.format(n_starts)}; print(open('/proc/self/status').read())"
        done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
        return float(done.stdout.split("VmHWM:")[1].split()[0]) * 1024 / 1e6

    base = peak(5000)
    what = "FLSS of 5 million starts, memory"
    megabytes = measure(lambda: peak(5_000_000), what, who, unit="MB", ratio=4.0, rounds=1, warm=False) - base
    benchmark.extra_info["figure"] = max(megabytes, 1.0)
