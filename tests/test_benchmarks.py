"""Peers of the benchmarks give hexmj's answers, and the scripts run at a small size."""

import numpy as np
import pytest

import plain_network
from benchmarks import scaling, solver_settings
from benchmarks.peers import numba_first_loss, numpy_first_loss
from benchmarks.table import rows
from hexmj import LDVS, Acceleration, Stride, draw_starts, first_loss
from hexmj.controllers.cruse1998.weights import general
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.settle import settle


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.2, 0.6])
def test_peers_give_the_same_losses(velocity):
    starts = draw_starts(150, 3)
    ours = first_loss(starts, LDVS, velocity, 80.0)
    np.testing.assert_array_equal(numba_first_loss(starts, LDVS, velocity, 80.0), ours)
    np.testing.assert_array_equal(numpy_first_loss(starts, LDVS, velocity, 80.0), ours)
    fast = Acceleration(0.005)
    accelerated = first_loss(starts, LDVS, velocity, 80.0, acceleration=fast)
    np.testing.assert_array_equal(numba_first_loss(starts, LDVS, velocity, 80.0, acceleration=fast), accelerated)
    weights, stride = general(LDVS.weights), Stride()
    readable = [plain_network.first_loss(list(start), weights, velocity, 800, stride) for start in starts[:5]]
    np.testing.assert_array_equal(readable, ours[:5])


def test_a_ratio_above_one_is_in_favour_of_hexmj():
    def figure(what, who, seconds, amount, unit, ratio, **own):
        info = {"what": what, "who": who, "amount": amount, "unit": unit, "ratio": ratio} | own
        return {"extra_info": info, "stats": {"median": seconds}}

    lines = rows(
        [
            figure("walks", "hexmj", 2.0, 100.0, "walks/s", 1.5),
            figure("walks", "slow", 4.0, 100.0, "walks/s", 1.5),
            figure("start", "hexmj", 3.0, None, "s", 0.6),
            figure("start", "quick", 1.5, None, "s", 0.6),
            figure("memory", "hexmj", 9.0, None, "MB", 2.0, figure=300.0),
            figure("memory", "large", 9.0, None, "MB", 2.0, figure=900.0),
        ]
    )
    assert lines == [
        ["walks", "50 walks/s", "ratio 1.5, met", "slow: 25", "2"],
        ["start", "3 s", "ratio 0.6, NOT MET", "quick: 1.5", "0.5"],
        ["memory", "300 MB", "ratio 2, met", "large: 900", "3"],
    ]


def test_parts_of_the_displacement_add_up():
    """Landing and creep are the slip; along the displacement, they and rolling add up to it."""
    settled = settle(draw_starts(3, 1))
    divided = solver_settings.Parts(settled)
    outcomes = physical_outcomes(settled, LDVS, 0.7, 20.0, effort=divided)
    lengths, along = divided.speeds()
    assert lengths[1] + lengths[3] == pytest.approx(outcomes.slip.mean())
    assert along[1:].sum() == pytest.approx(along[0]) == pytest.approx(lengths[0])


@pytest.mark.slow
def test_solver_settings_and_scaling_of_a_few_starts(tmp_path, monkeypatch):
    """The table replaces what stands between its comments."""
    page = tmp_path / "page.md"
    page.write_text(f"before\n{solver_settings.BEGIN}old\n{solver_settings.END}\nafter\n", encoding="utf-8")
    monkeypatch.setattr(solver_settings, "FRICTION", {})
    solver_settings.main("2", str(page))
    assert [page.read_text(encoding="utf-8").count(text) for text in ("before", "old", "after", "discrete")] == [
        1,
        0,
        1,
        3,
    ]
    scaling.main(["--out", str(tmp_path), "--share", "0.003"])
    assert (tmp_path / "scaling.png").stat().st_size > 10_000
