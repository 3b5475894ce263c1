"""The paper's claims: the table, measurements, found sets, and `reproduce`, which resumes and writes everything."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from hexmj.controllers.cruse1998 import HWS, LDVS, MODEL_VARIANTS, PRESETS
from hexmj.errors import InputError
from hexmj.measures.kinematic import flss, walk
from hexmj.paper.claims import Band, claims
from hexmj.paper.figures import FIGURES
from hexmj.paper.measurements import losses, losses_after
from hexmj.paper.protocol import (
    FULL,
    MEASUREMENTS,
    PRINTED,
    QUICK,
    RANGES,
    Protocol,
    cells,
    found_sets,
    searched_seeds,
)  # fmt: skip
from hexmj.paper.quantities import Measured, Weight
from hexmj.paper.reproduce import measure, reproduce
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import OBSERVATION_TIMES, Acceleration, steps_within

TINY = replace(
    QUICK,
    sample=3,
    velocities=(0.3, 0.6),
    gait_starts=3,
    gait_velocities=(0.5, 0.6),
    obstacle_starts=3,
    acceleration=Acceleration(rate=0.001),
)


def lost(name: str, protocol: Protocol, **how: Any) -> xr.DataArray:
    return measure({name}, protocol, **how).data[name].lost


def test_claims_name_measurements_and_the_protocol_is_the_papers():
    assert len(claims()) == 61
    assert all(set(claim.rule.quantity.needs) <= set(MEASUREMENTS) for claim in claims().values())
    assert all(claim.judged_by and claim.text and claim.value for claim in claims().values())
    assert all(set(needs) <= set(MEASUREMENTS) for needs, _ in FIGURES.values())
    assert (FULL.samples, FULL.sample, FULL.gait_starts, FULL.gait_stride.dt) == (7, 1000, 100, 0.01)
    assert (FULL.stride.dt, FULL.acceleration.rate) == (0.1, 0.00008)


def test_measured_losses_are_those_of_flss():
    protocol = replace(TINY, sample=20)
    how: Any = {"n_starts": 140, "seed": protocol.seed}
    slow, fast = lost("ldvs", protocol), lost("hws accelerated", protocol)
    for time in OBSERVATION_TIMES:
        table = flss(LDVS, protocol.velocities, observation_time=time, **how)
        assert slow.sel(observation_time=time).mean("start").values == pytest.approx(table.flss.values)
        table = flss(HWS, protocol.velocities, observation_time=time, acceleration=protocol.acceleration, **how)
        assert fast.sel(observation_time=time).mean("start").values == pytest.approx(table.flss.values)


def test_our_own_sets_are_judged_at_the_velocity_they_were_found_for():
    assert FULL.network("own", "walk", 0.3) == FULL.network("own", "start", 0.3) == PRESETS["own-0.3"]
    assert FULL.network("own", "walk", 0.35) is None


def test_obstacles_are_met_by_the_same_stable_starts():
    """A walk that slows down to the velocity that it has is only halted."""
    how = 40, 3, TINY.stride
    none = losses_after(0.5, LDVS, "none", *how, None).lost
    slow = losses_after(0.5, LDVS, "slow down", *how, Acceleration(rate=0.001, start=0.5)).lost
    postures = losses_after(0.5, LDVS, "postures", *how, None).lost
    assert none.equals(slow) and none.sum() > 0
    assert postures.sum() < none.sum()
    assert (none.sel(observation_time="walk") >= none.sel(observation_time="start")).all()


def test_losses_after_a_wait_are_those_of_the_end_of_the_walk():
    late = losses(0.6, (LDVS, LDVS), 70, 3, TINY.stride, None, late=True).lost.values
    wait, durations = TINY.stride.periods(0.6, 5), (TINY.stride.periods(0.6, 3), 40.0)
    margin = walk_margin(walk(draw_starts(70, 3), LDVS, 0.6, wait + durations[0]))
    for row, duration in zip(late, durations, strict=True):
        first, last = (int(steps_within(time, TINY.stride)) for time in (wait, wait + duration))
        assert np.array_equal(row, (margin[first:last] <= 0).any(axis=0))
    assert 0 < late[1].sum() < late[0].sum() < 70


def test_a_stopped_run_resumes_and_ends_the_same(tmp_path: Path):
    keys, whole, stopped = ("ldvs-below-hws", "p2"), tmp_path / "whole", tmp_path / "stopped"
    protocol = replace(TINY, velocities=(0.1, 0.3, 0.5))
    report = reproduce(whole, protocol, only=keys)
    done = 0.0

    def stop(fraction: float) -> None:
        nonlocal done
        done += fraction
        if done > 0.6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(stopped, protocol, only=keys, progress=stop)
    kept = {path: path.stat().st_mtime_ns for path in (stopped / "measurements").iterdir()}
    assert 0 < len(kept) < 6
    assert reproduce(stopped, protocol, only=keys).rows == report.rows
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items())
    for name in ("claims.md", "claims.json"):
        assert (stopped / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.slow
def test_everything_is_written(tmp_path: Path):
    progress: list[float] = []
    report = reproduce(tmp_path, TINY, progress=progress.append)
    assert len(report.rows) == len(claims())
    assert sum(progress) == pytest.approx(1.0)
    assert all(path.stat().st_size > 0 for path in report.files)
    assert len(report.files) == 2 + 3 * len(FIGURES)
    text = (tmp_path / "claims.md").read_text()
    assert all(f"| {claim.key} | {claim.judged_by} |" in text for claim in claims().values())
    data = xr.load_dataset(tmp_path / "figures" / "figure-3-walk.nc", engine="h5netcdf")
    expected = flss(HWS, [0.3], n_starts=21, seed=TINY.seed).flss.item()
    assert data.flss.sel(curve="hws", velocity=0.3) == pytest.approx(expected)


def test_other_model_variants_are_judged_too(tmp_path: Path):
    keys, variant = ("hws-late", "p2"), MODEL_VARIANTS["lasting"]
    alone = reproduce(tmp_path / "alone", replace(TINY, model_variant=variant), only=keys)
    report = reproduce(tmp_path / "both", TINY, only=keys, beside=("lasting",))
    assert [row.beside["lasting"] for row in report.rows] == [row.answers for row in alone.rows]
    heads, rows = report.table()
    assert {len(heads)} == {len(row) for row in rows}
    assert any(line.startswith("model variant lasting, ") for line in report.json()["summary"])


@pytest.mark.parametrize(("seed", "searched"), [(0, True), (1998, False)])
def test_starts_of_the_searches_are_reported(tmp_path: Path, seed: int, searched: bool):
    report = reproduce(tmp_path, replace(TINY, seed=seed), only=("hws-late",))
    assert any(line.startswith(f"seed {seed}: ") for line in report.summary) == searched


def test_found_sets_feed_curves_and_claims(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    text = "".join(
        f'[[set]]\nobservation_time = "walk"\nvelocities = {velocities}\nseed = 1\n'
        "symmetric = { p32_i = 4.0, p33_i = 0.3, p32_c = 0.5, p4_i = 1 }\n"
        for velocities in ([0.3], [0.6], [0.1, 0.7])
    )
    (tmp_path / "sets.toml").write_text(text)
    sets = found_sets(tmp_path / "sets.toml")
    for module in ("protocol", "quantities"):
        monkeypatch.setattr(f"hexmj.paper.{module}.found_sets", lambda: sets)
    ideal = lost("ideal", TINY)
    assert (ideal.sel(observation_time="walk") >= 0).all() and (ideal.sel(observation_time="start") == -1).all()
    assert (lost("wide", TINY).sel(observation_time="walk") >= 0).all()
    agrees = []
    for parameter in ("p33_i", "p32_c"):
        rule = Band(Weight(parameter, "p32_i"), (0.3, 0.6), most=0.1)
        assert rule.answer(Measured({}), "start") is None
        answer = rule.answer(Measured({}), "walk")
        agrees.append(answer and answer.agrees)
    assert agrees == [True, False]


def test_the_shipped_sets_are_complete_and_judged_on_fresh_starts():
    assert FULL.seed not in searched_seeds()
    places = {place[:3] for place in found_sets() if place[3] == PRINTED}
    velocities = *((v, v) for v in FULL.velocities), *RANGES.values()
    assert places == {(time, *at) for time in OBSERVATION_TIMES for at in velocities}


def test_a_cell_holds_only_what_its_numbers_depend_on():
    """Losses do not depend on the number of gaits or of velocities, but on the starts."""

    def records(name: str, protocol: Protocol) -> list[str]:
        return [cell.record() for cell in cells(name, protocol).values()]

    same = replace(TINY, gait_starts=9, gait_velocities=(0.9,))
    assert records("ldvs", TINY) == records("ldvs", same)
    assert records("ldvs", TINY) == records("ldvs", replace(TINY, acceleration=Acceleration(rate=0.002)))
    assert records("ldvs", replace(TINY, velocities=(0.6,))) == records("ldvs", TINY)[1:]
    for name, other in (
        ("ldvs", replace(TINY, sample=4)),
        ("ldvs accelerated", replace(TINY, acceleration=Acceleration(rate=0.002))),
        ("ldvs gaits", replace(TINY, gait_starts=9)),
        ("ldvs gaits", replace(TINY, seed=1)),
    ):
        assert not set(records(name, TINY)) & set(records(name, other))


def test_measurements_do_not_depend_on_the_executor(tmp_path: Path):
    names = {"hws", "ideal", "hws gaits"}
    with ThreadPoolExecutor(2) as executor:
        parallel = measure(names, TINY, executor=executor)
    alone = measure(names, TINY, tmp_path, threads=1)
    assert all(alone.data[name].identical(parallel.data[name]) for name in names)


def test_the_command_judges_chosen_claims(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("hexmj.paper.protocol.QUICK", TINY)
    words = ["reproduce", "--quick", "--only", "ldvs-accelerated", "--out", tmp_path]
    code, text, _ = run(*words, "--json")
    (claim,) = json.loads(text)["claims"]
    assert code == 0 and claim["key"] == "ldvs-accelerated" and set(claim["ours"]) == {"walk", "start"}
    assert (tmp_path / "claims.md").is_file()
    assert run(*words, "--beside", "lasting")[0] == 0


@pytest.mark.parametrize(
    ("chosen", "name"),
    [
        ({"only": ["nothing"]}, "claim"),
        ({"only": ["p2"], "beside": ["nothing"]}, "nothing"),
        ({"protocol": replace(TINY, samples=3)}, "samples"),
    ],
)
def test_bad_input_is_refused_before_the_work(tmp_path: Path, chosen: dict[str, Any], name: str):
    with pytest.raises(InputError, match=name):
        settings: Any = {"protocol": TINY} | chosen
        reproduce(tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()
