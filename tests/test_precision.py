"""Frequencies to a wanted precision: coverage and cost on recorded walks, laws of small comparisons."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.measures.precision import MEASURES, PLANNED, STRATA, StratifiedWalks
from hexmj.stats import WILSON_Z

FALLS = {"physical": MEASURES["physical"]}

# Starts and falls in each stratum: `hexmj flss --measure physical --starts 600 --seed 66` at V = 0.3 and 0.5.
RECORDED = {
    0.3: ([452, 31, 26, 19, 10, 43, 19], [2, 0, 6, 14, 8, 42, 18]),
    0.5: ([235, 55, 51, 28, 47, 126, 58], [0, 2, 15, 13, 41, 118, 58]),
}


def repeated(v: float, precision: float, seed: int) -> tuple[bool, float]:
    """Whether the interval covers the frequency of the recorded walks, and the walks over those of plain sampling."""
    rng, (starts, fell) = np.random.default_rng(seed), np.array(RECORDED[v])
    stratum = rng.choice(STRATA, PLANNED, p=starts / starts.sum())
    falls = np.where(rng.random(PLANNED) < (fell / starts)[stratum], 1.0, np.inf)
    sample, walks = StratifiedWalks(xr.Dataset({"stratum": ("start", stratum)})), 0
    while len(chosen := sample.next_starts(FALLS, precision)):
        sample.walk(chosen, xr.Dataset({"fall": ("start", falls[chosen])}))
        walks += len(chosen)
    true = fell.sum() / starts.sum()
    found = sample.estimate(np.isfinite(np.concatenate([batch.fall.values for batch in sample.batches])))
    assert found.half <= precision
    return abs(found.value - true) <= found.half, walks / (WILSON_Z**2 * true * (1.0 - true) / precision**2)


@pytest.mark.slow
@pytest.mark.parametrize("v", RECORDED)
def test_intervals_cover_the_frequency_and_need_a_quarter_of_the_walks(v):
    covers, shares = np.transpose([repeated(v, 0.03, seed) for seed in range(500)])
    assert covers.mean() >= 0.93
    assert np.median(shares[:20]) <= 0.25


def test_a_precise_comparison_walks_like_any_other_and_resumes(tmp_path):
    """The same outcomes as those starts have in a comparison of all starts; a second run reads every walk."""
    how: Any = {"observation_time": 30.0, "folder": tmp_path}
    seen: list[float] = []
    found = hexmj.compare(hexmj.LDVS, [0.7], precision=0.2, **how)
    again = hexmj.compare(hexmj.LDVS, [0.7], precision=0.2, progress=seen.append, **how)
    assert found.identical(again)
    assert sum(seen) == pytest.approx(1.0)
    for name in ("grounded", "carried", "physical"):
        assert (found[f"{name}_high"] - found[f"{name}_low"] <= 0.4 + 1e-9).all()
    assert found.weight.sum() == pytest.approx(1.0)
    walked = found.start.values[found.start.values < 400][:5]
    starts = hexmj.draw_starts(400, 0)[walked]
    outcomes = hexmj.physical_walk(starts, hexmj.LDVS, 0.7, 30.0).outcomes
    for name in ("planned_loss", "dynamic_loss", "grounded_loss", "carried_loss", "fall", "slip"):
        assert np.array_equal(found[name].sel(start=walked).values.ravel(), getattr(outcomes, name))
    assert found.kinematic.item() == hexmj.flss(hexmj.LDVS, 0.7, n_starts=PLANNED, observation_time=30.0).flss.item()


def test_precise_falls_need_no_more_walks_than_a_comparison():
    falls = hexmj.physical_flss(hexmj.LDVS, [0.7], precision=0.2, observation_time=30.0)
    assert falls.high - falls.low <= 0.4
    assert falls.sizes["start"] == falls.walks
    compared = hexmj.compare(hexmj.LDVS, [0.7], precision=0.2, observation_time=30.0)
    assert falls.walks <= compared.walks


@pytest.mark.parametrize("precision", [0.0, 0.7, float("nan"), "narrow"])
def test_a_precision_out_of_range_is_refused(precision):
    with pytest.raises(InputError, match="precision"):
        hexmj.compare(hexmj.LDVS, [0.5], precision=precision)
