"""The benchmarks compare like with like, and what they print is computed as they say."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import plain_network
from benchmarks import solver_settings
from benchmarks.peers import numba_first_loss, numpy_first_loss
from benchmarks.table import ONE_CORE, rows
from hexmj import LDVS, Acceleration, Stride, draw_starts, first_loss
from hexmj.controllers.cruse1998.weights import general

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.2, 0.6])
def test_the_peers_give_our_answers(velocity):
    starts = draw_starts(150, 3)
    ours = first_loss(starts, LDVS, velocity, 80.0)
    np.testing.assert_array_equal(numba_first_loss(starts, LDVS, velocity, 80.0), ours)
    np.testing.assert_array_equal(numpy_first_loss(starts, LDVS, velocity, 80.0), ours)
    fast = Acceleration(0.005)
    np.testing.assert_array_equal(
        numba_first_loss(starts, LDVS, velocity, 80.0, acceleration=fast),
        first_loss(starts, LDVS, velocity, 80.0, acceleration=fast),
    )
    readable = [
        plain_network.first_loss(list(start), general(LDVS.weights), velocity, 800, Stride()) for start in starts[:5]
    ]
    np.testing.assert_array_equal(readable, ours[:5])


def test_a_ratio_above_one_is_in_our_favour():
    def one(what, who, seconds, amount, unit, bar=None, **figure):
        info = {"what": what, "who": who, "amount": amount, "unit": unit, "bar": bar, "ratio": None} | figure
        return {"extra_info": info, "stats": {"median": seconds}}

    lines = rows(
        [
            one("walks", "hexmj", 2.0, 100.0, "walks/s", 40.0),
            one("walks", "slow", 4.0, 100.0, "walks/s"),
            one("start", "hexmj", 3.0, None, "s", 2.0),
            one("start", "quick", 1.5, None, "s"),
            one("steps", "hexmj", 1.0, 95.0, "steps/s", ratio=0.9),
            one("steps", "bare", 1.0, 100.0, "steps/s"),
            one("memory", "hexmj", 9.0, None, "MB", 500.0, figure=300.0),
        ]
    )
    assert lines == [
        ["walks", "50 walks/s", "40, met", "slow: 25", "2"],
        ["start", "3 s", "2, NOT MET", "quick: 1.5", "0.5"],
        ["steps", "95 steps/s", "ratio 0.9, met", "bare: 100", "0.95"],
        ["memory", "300 MB", "500, met", "", ""],
    ]


@pytest.mark.thorough
def test_a_small_bench_prints_its_table(tmp_path):
    """Two of the figures, through pytest-benchmark into the table."""
    command = [sys.executable, "-m", "pytest", "benchmarks", "--override-ini", "python_files=bench_*.py"]
    command += ["-k", "one_core or help", "--once"]
    command += ["--benchmark-quiet", "--benchmark-json", str(tmp_path / "benchmark.json")]
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_XDIST")}
    subprocess.run(command, cwd=ROOT, check=True, env=alone)
    subprocess.run([sys.executable, "-m", "benchmarks.table", str(tmp_path)], cwd=ROOT, check=True)
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert "| hexmj --help |" in text
    assert f"| {ONE_CORE} |" in text
    assert re.search(r"does \d{3} arithmetic operations for each start and step, [248] at a time", text)


@pytest.mark.thorough
def test_solver_settings_of_a_few_starts(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(solver_settings, "ROUNDS", 1)
    solver_settings.main(str(tmp_path), "4")
    results = json.loads((tmp_path / "solver_settings.json").read_text(encoding="utf-8"))
    assert results["pairs searched for"]["flss"] == results["as shipped"]["flss"]
    assert results["pairs searched for"]["slip"] == results["as shipped"]["slip"]
    assert results["solver CG"]["slip"] == pytest.approx(results["as shipped"]["slip"], rel=0.05)
    assert "time step / 4" in capsys.readouterr().out


@pytest.mark.thorough
def test_scaling_of_a_few_starts(tmp_path):
    command = [sys.executable, "-m", "benchmarks.scaling", "--out", str(tmp_path), "--share", "0.01"]
    subprocess.run(command, cwd=ROOT, check=True)
    assert (tmp_path / "scaling.png").stat().st_size > 10_000
