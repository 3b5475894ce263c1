"""The paper's claims: rules on made-up measurements, the table, what is kept of a stopped run, found sets, figures."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import numpy as np
import pytest
import xarray as xr

from hexmj.controllers.cruse1998 import HWS, LDVS, PRESETS, READINGS
from hexmj.errors import InputError
from hexmj.measures.kinematic import flss, walk
from hexmj.paper import found_sets as found
from hexmj.paper.claims import CLAIMS, INFERRED_FROM, Claim
from hexmj.paper.figures import FIGURES
from hexmj.paper.late_losses import lost_after
from hexmj.paper.obstacles import losses_after
from hexmj.paper.protocol import FULL, MEASUREMENTS, QUICK, RANGES, Protocol, cells
from hexmj.paper.quantities import Lost, Measured, Phase, Scatter, Weight, main_peak
from hexmj.paper.reproduce import measure, reproduce
from hexmj.paper.rules import Answer, Band, Rule, Seen, Trend, fisher
from hexmj.paper.table import NOT_SEARCHED, Row, claims_markdown, judge, summary
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import WINDOWS, Acceleration

TINY = replace(
    QUICK,
    samples=7,
    sample=3,
    velocities=(0.3, 0.6),
    gait_starts=3,
    gait_velocities=(0.5, 0.6),
    footfall_velocities=(0.3, 0.6),
    obstacle_starts=3,
    acceleration=Acceleration(rate=0.001),
)


def losses(*rates: float, starts: int = 1000, velocities: tuple[float, ...] = (0.1, 0.2, 0.3)) -> xr.Dataset:
    """A measurement with these frequencies, the same under both windows."""
    lost = np.arange(starts) < np.round(np.array(rates)[:, np.newaxis] * starts)
    return xr.Dataset(
        {"lost": (("window", "velocity", "start"), np.stack([lost, lost]).astype(np.int8))},
        {"window": ["walk", "start"], "velocity": list(velocities)},
    )


def gaits(phases: np.ndarray) -> xr.Dataset:
    """Accelerated gaits at V = 0.5 with the same phases, (start,), for every pair."""
    fine = np.ones((1, len(phases)), dtype=bool)
    pairs = ["1-2", "2-3", "4-5", "5-6", "1-4", "2-5", "3-6"]
    by_start = ("velocity", "start")
    return xr.Dataset(
        {
            "phase": ((*by_start, "pair"), np.repeat(phases[np.newaxis, :, np.newaxis], 7, axis=2)),
            "periodic": (by_start, fine), "stable": (by_start, fine), "lost": (by_start, ~fine),
        },
        {"velocity": [0.5], "pair": pairs},
    )  # fmt: skip


def answer_of(rule: Rule, measured: Measured, window: str) -> Answer:
    """Of a rule that can be judged."""
    answer = rule.answer(measured, window)
    assert answer is not None
    return answer


def test_rules_agree_if_every_interval_reaches_the_band():
    measured = {"hws": losses(0.01, 0.2, 0.31), "ldvs": losses(0.02, 0.1, 0.5)}
    below = Band(Lost("hws"), (0.1, 0.3), most=0.3)
    answer = answer_of(below, measured, "walk")
    assert answer.agrees and answer.where == "V = 0.3" and answer.low < 0.3 < answer.value
    assert not answer_of(Band(Lost("hws"), (0.1, 0.3), most=0.25), measured, "walk").agrees
    assert not answer_of(Band(Lost("hws"), (0.1, 0.3), least=0.1), measured, "walk").agrees
    apart = answer_of(Band(Lost("ldvs", "hws"), (0.1, 0.3), most=0.0), measured, "walk")
    assert not apart.agrees and apart.value == pytest.approx(0.19) and apart.where == "V = 0.3"
    assert answer_of(Band(Lost("hws", "ldvs", 2.0), (0.1, 0.3), most=0.0), measured, "walk").agrees
    assert answer_of(Trend(Lost("hws"), (0.1, 0.3), 1), measured, "walk").agrees
    assert not answer_of(Trend(Lost("hws"), (0.1, 0.3), -1), measured, "walk").agrees


def test_a_range_whose_ends_are_not_met_is_not_judged():
    measured = {"hws": losses(0.01, 0.2, 0.3)}
    assert answer_of(Band(Lost("hws"), (0.1, 0.35), most=0.3), measured, "walk")
    assert Band(Lost("hws"), (0.1, 0.4), most=0.3).answer(measured, "walk") is None
    unknown = losses(0.01, 0.2, 0.3)
    unknown.lost[:] = -1
    assert Band(Lost("hws"), (0.1, 0.3), most=0.3).answer({"hws": unknown}, "walk") is None


def test_phases_are_judged_in_the_main_peak_and_the_others_counted():
    phases = np.array([0.66, 0.67, 0.67, 0.68, 0.2])
    assert main_peak(phases).tolist() == [True, True, True, True, False]
    assert main_peak(np.array([0.99, 0.01, 0.02, 0.5])).tolist() == [True, True, True, False]
    measured = {"hws gaits": gaits(phases)}
    answer = answer_of(Band(Phase("hws", "ipsilateral"), (0.5, 0.5), 0.66, 0.68), measured, "")
    assert answer.agrees and answer.value == pytest.approx(0.67)
    assert not answer_of(Band(Phase("hws", "ipsilateral"), (0.5, 0.5), 0.7, 0.8), measured, "").agrees
    outside = answer_of(Band(Scatter("hws", "phases"), (0.5, 0.5), 0.0, 0.0), measured, "")
    assert outside.value == pytest.approx(0.2) and not outside.agrees


def test_a_mean_over_velocities_is_judged_on_the_same_starts():
    measured = {"hws": losses(0.1, 0.1, 0.4), "ldvs": losses(0.2, 0.2, 0.1)}
    rule = Band(Lost("hws", "ldvs"), (0.1, 0.3), most=0.0, averaged=True)
    answer = answer_of(rule, measured, "walk")
    assert answer.value == pytest.approx(0.1 / 3) and not answer.agrees and answer.where == "V = 0.1, mean to 0.3"
    assert not answer_of(replace(rule, averaged=False), measured, "walk").agrees
    assert "averaged over V in [0.1, 0.3]" in rule.words


def test_a_curve_is_compared_with_another_at_one_velocity():
    measured = {"hws accelerated": losses(0.01, 0.02, 0.05), "hws": losses(0.01, 0.9, 1.0)}
    answer = answer_of(Band(Lost("hws accelerated", "hws", at=0.1), (0.1, 0.3), -0.02, 0.02), measured, "walk")
    assert answer.value == pytest.approx(0.04) and answer.where == "V = 0.3" and not answer.agrees
    assert Band(Lost("hws", "hws", at=0.05), (0.1, 0.3)).answer(measured, "walk") is None


def test_rare_events_are_compared_with_the_papers_own_sample():
    """p of 3 of 3 against 0 of 3 is 2 / 20, of 1 of 100 against 0 of 100 it is 1, whichever comes first."""
    assert fisher(3, 3, 0, 3) == pytest.approx(0.1)
    assert fisher(1, 100, 0, 100) == fisher(0, 100, 1, 100) == 1.0
    assert fisher(0, 0, 0, 100) == 0.0
    rule = Seen(Lost("hws"), (0.1, 0.3), 0, 100)
    assert answer_of(rule, {"hws": losses(0.0, 0.05, 0.0, starts=100)}, "walk").agrees
    answer = answer_of(rule, {"hws": losses(0.0, 0.06, 0.0, starts=100)}, "walk")
    assert not answer.agrees and answer.where == "V = 0.2" and answer.value == pytest.approx(0.06)


def test_windows_are_judged_apart():
    lost = losses(0.1, 0.1, 0.1)
    lost.lost.loc[{"window": "start"}] = 0
    row = judge(Claim("a", "5", "slow", "< 0.05", Band(Lost("hws"), (0.1, 0.3), most=0.05), "why"), {"hws": lost})
    assert row.verdicts == {"walk": "differs", "start": "agrees"}
    assert row.fits == "start"
    assert row.cells[-1] == "why"
    assert "start 1" in summary([row])[-1]


def test_calibrated_claims_are_counted_apart():
    assert {key for keys in INFERRED_FROM.values() for key in keys} <= {claim.key for claim in CLAIMS}
    measured, rule = {"hws": losses(0.1, 0.1, 0.1)}, Band(Lost("hws"), (0.1, 0.3), most=0.2)
    rows = [judge(Claim(key, "5", "slow", "", rule), measured) for key in ("hws-0.4", "hws-slow")]
    assert [row.kind for row in rows] == ["calibrated", "held out"]
    assert rows[0].cells[3] == "calibrated: PEP_min; observation time"
    assert summary(rows)[0].endswith("window walk: held out 1 agrees; calibrated 1 agrees")


def test_claims_have_unique_keys_and_name_measurements():
    assert len({claim.key for claim in CLAIMS}) == len(CLAIMS) >= 40
    assert all(set(claim.rule.quantity.needs) <= set(MEASUREMENTS) for claim in CLAIMS)
    assert all(set(needs) <= set(MEASUREMENTS) for needs, _ in FIGURES.values())
    assert (FULL.samples, FULL.sample, FULL.gait_starts, FULL.gait_stride.dt) == (7, 1000, 100, 0.01)
    assert (FULL.stride.dt, FULL.acceleration.rate) == (0.1, 0.00008)


def test_measured_losses_are_those_of_flss(tmp_path):
    protocol = replace(TINY, sample=20)
    lost = measure("ldvs", protocol, tmp_path).lost
    fast = measure("hws accelerated", protocol, tmp_path).lost
    for window in ("walk", "start"):
        table = flss(LDVS, protocol.velocities, n_starts=140, seed=protocol.seed, window=window)
        assert lost.sel(window=window).mean("start").values == pytest.approx(table.flss.values)
        table = flss(
            HWS,
            protocol.velocities,
            n_starts=140,
            seed=protocol.seed,
            window=window,
            acceleration=protocol.acceleration,
        )
        assert fast.sel(window=window).mean("start").values == pytest.approx(table.flss.values)


def test_our_own_sets_are_judged_at_the_velocity_they_were_found_for():
    assert FULL.network("own", "walk", 0.3) == FULL.network("own", "start", 0.3) == PRESETS["own-0.3"]
    assert FULL.network("own", "walk", 0.35) is None


def test_obstacles_are_met_by_the_same_stable_starts():
    """What slows down to the velocity at which it walks is only halted."""
    how = 40, 3, TINY.stride
    none = losses_after(0.5, LDVS, "none", *how, None).lost
    slow = losses_after(0.5, LDVS, "slow down", *how, Acceleration(rate=0.001, start=0.5)).lost
    postures = losses_after(0.5, LDVS, "postures", *how, None).lost
    assert none.equals(slow) and none.sum() > 0
    assert postures.sum() < none.sum()
    assert (none.sel(window="walk") >= none.sel(window="start")).all()


def test_lost_after_is_the_end_of_the_walk():
    starts, wait, durations = draw_starts(70, 3), 60.0, np.array([20.0, 45.0])
    margin = walk_margin(walk(starts, LDVS, 0.6, wait + durations[-1]))
    ours = lost_after(starts, LDVS, 0.6, wait, durations)
    for lost, duration in zip(ours, durations, strict=True):
        assert np.array_equal(lost, (margin[600 : 600 + round(10 * duration)] <= 0).any(axis=0))
    assert 0 < ours[0].sum() < ours[1].sum() < 70


def test_a_stopped_run_goes_on_and_ends_the_same(tmp_path):
    class Stop(Exception):
        pass

    def until(rows: int):
        done = iter(range(rows))

        def told(_: float) -> None:
            if next(done, None) is None:
                raise Stop

        return told

    keys = ("ldvs-below-hws", "hws-late", "p2")
    protocol = replace(TINY, velocities=(0.1, 0.3, 0.5, 0.6))
    whole, _ = reproduce(tmp_path / "whole", protocol, only=keys)
    (tmp_path / "stopped").mkdir()
    (table := tmp_path / "stopped" / "claims.json").write_text("of an earlier run")
    with pytest.raises(Stop):
        reproduce(tmp_path / "stopped", protocol, only=keys, progress=until(9))
    assert table.read_text() == "of an earlier run"
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "stopped" / "measurements").iterdir()}
    assert len(kept) == 10
    rows, _ = reproduce(tmp_path / "stopped", protocol, only=keys)
    assert rows == whole
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items())
    for name in ("claims.md", "claims.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_rows_of_another_protocol_are_kept_apart(tmp_path):
    measure("hws", TINY, tmp_path)
    assert measure("hws", replace(TINY, seed=1), tmp_path).sizes["start"] == 21
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.slow
def test_everything_is_written(tmp_path):
    told = []
    rows, files = reproduce(tmp_path, TINY, progress=told.append)
    assert len(rows) == len(CLAIMS)
    assert sum(told) == pytest.approx(1.0)
    assert all(path.stat().st_size > 0 for path in files)
    assert {path.suffix for path in files} == {".md", ".json", ".pdf", ".png", ".nc"}
    assert len(files) == 2 + 3 * len(FIGURES)
    text = (tmp_path / "claims.md").read_text()
    assert all(claim.command in text for claim in CLAIMS)
    assert str(tmp_path) not in text
    data = xr.load_dataset(tmp_path / "figures" / "figure-3-walk.nc", engine="h5netcdf")
    assert data.flss.sel(curve="hws", velocity=0.3) == pytest.approx(
        flss(HWS, [0.3], n_starts=21, seed=TINY.seed).flss.item()
    )


def test_nonsense_gets_a_clear_sentence_and_destroys_nothing(tmp_path):
    with pytest.raises(InputError, match="valid keys: hws-majority"):
        reproduce(tmp_path, TINY, only=("no such claim",))
    measure("hws", TINY, tmp_path / "measurements")
    path = min((tmp_path / "measurements").iterdir())
    path.write_bytes(b"not a dataset")
    with pytest.raises(InputError, match="delete it"):
        reproduce(tmp_path, TINY, only=("hws-late", "hws-diminishes"))
    assert path.read_bytes() == b"not a dataset"
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        reproduce(tmp_path / "file", TINY)


@pytest.mark.parametrize(("seed", "told"), [(0, True), (1998, False)])
def test_starts_on_which_ideal_sets_were_searched_are_told(tmp_path, seed, told):
    _, (page, data) = reproduce(tmp_path, replace(TINY, seed=seed), only=("hws-late",))
    for text in (page.read_text(), data.read_text()):
        assert (f"seed {seed}: ideal sets were searched on these starts" in text) == told


def test_figures_of_other_samples_are_refused_before_the_work(tmp_path):
    with pytest.raises(InputError, match="samples = 3; expected 7, as the figures draw"):
        reproduce(tmp_path / "paper", replace(TINY, samples=3))
    assert not any(tmp_path.iterdir())


SET = """
[[set]]
window = "walk"
velocities = [{v}]
command = "made up"
symmetric = {{ p32_i = 4.0, p33_i = 0.3, p32_c = 0.5, p4_i = 1 }}
"""


@pytest.fixture
def table(tmp_path, monkeypatch):
    """Let another file be the table of found sets."""

    def use(text: str):
        path = tmp_path / f"sets-{len(list(tmp_path.iterdir()))}.toml"
        path.write_text(text)
        sets = found.found_sets(path)
        monkeypatch.setattr(found, "found_sets", lambda: sets)
        monkeypatch.setattr("hexmj.paper.quantities.found_sets", lambda: sets)
        return sets

    return use


def test_found_sets_feed_curves_and_claims(table, tmp_path):
    table("".join(SET.format(v=v) for v in ("0.3", "0.6", "0.1, 0.7")))
    lost = measure("ideal", TINY, tmp_path / "out").lost
    assert (lost.sel(window="walk") >= 0).all()
    assert (lost.sel(window="start") == -1).all()
    assert (measure("wide", TINY, tmp_path / "out").lost.sel(window="walk") >= 0).all()
    verdicts = [
        judge(Claim("a", "5", "", "", Band(Weight(p, "p32_i"), (0.3, 0.6), most=0.1)), {}).verdicts
        for p in ("p33_i", "p32_c")
    ]
    assert verdicts == [{"walk": "agrees", "start": NOT_SEARCHED}, {"walk": "differs", "start": NOT_SEARCHED}]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[set", "cannot be read as TOML"),
        (SET.format(v="0.1") * 2, "two sets"),
        (SET.format(v="1.5"), "velocities"),
        (SET.format(v="0.1").replace("walk", "long"), "valid names: walk, start"),
        (SET.format(v="0.1").replace("p33_i", "p34_i"), "no parameter of the HWS form"),
        (SET.format(v="0.1").replace("command", "by"), "missing or unknown"),
    ],
)
def test_a_damaged_table_of_sets_gets_a_clear_sentence(table, text, words):
    with pytest.raises(InputError, match=words):
        table(text)


def test_the_shipped_sets_are_judged_on_fresh_starts():
    """Every command names a seed, and none of them is that of the protocol's starts."""
    seeds = {int(one.command.split("--seed ")[1]) for one in found.found_sets()}
    assert seeds and FULL.seed not in seeds
    places = {one.place[:3] for one in found.found_sets() if one.controller.reading == found.PRINTED}
    assert places == {(w, *at) for w in WINDOWS for at in (*((v, v) for v in FULL.velocities), *RANGES.values())}


def test_a_cell_holds_only_what_its_numbers_depend_on():
    """Another number of gaits, or of velocities, makes no loss anew; other starts do."""

    def records(name: str, protocol: Protocol) -> list[str]:
        return [cell.record() for cell in cells(name, protocol)]

    same = replace(TINY, gait_starts=9, gait_velocities=(0.9,), footfall_velocities=(0.9,))
    assert records("ldvs", TINY) == records("ldvs", same)
    assert records("ldvs", TINY) == records("ldvs", replace(TINY, acceleration=Acceleration(rate=0.002)))
    assert records("ldvs", replace(TINY, velocities=(0.6,))) == records("ldvs", TINY)[1:]
    for name, other in (
        ("ldvs", replace(TINY, sample=4)),
        ("ldvs accelerated", replace(TINY, acceleration=Acceleration(rate=0.002))),
        ("ldvs gaits", replace(TINY, gait_starts=9)),
        ("ldvs footfall", replace(TINY, seed=1)),
    ):
        assert not set(records(name, TINY)) & set(records(name, other))


def test_the_numbers_do_not_depend_on_who_measures(tmp_path):
    with ThreadPoolExecutor(2) as executor:
        both = [measure(name, TINY, executor=executor) for name in ("hws", "ideal", "hws footfall")]
    for name, one in zip(("hws", "ideal", "hws footfall"), both, strict=True):
        assert one.identical(measure(name, TINY, tmp_path, threads=1))


def test_other_readings_stand_beside(tmp_path):
    keys = ("hws-late", "hws-regimes", "p2")
    alone, _ = reproduce(tmp_path / "alone", replace(TINY, reading=READINGS["lasting"]), only=keys[:2])
    rows, _ = reproduce(tmp_path, TINY, only=keys, beside=("lasting",))
    assert [row.beside["lasting"].answers for row in rows[1:]] == [row.answers for row in alone]
    head, line = (tmp_path / "claims.md").read_text().split("| section")[1].splitlines()[0:3:2]
    assert "ours, walk | ours, start | lasting, walk | lasting, start" in head
    assert line.count("|") - 2 == head.count("|") - 1
    with pytest.raises(InputError, match="reading = 'wrong'; valid names: printed, lasting"):
        reproduce(tmp_path, TINY, only=keys, beside=("wrong",))
    with pytest.raises(InputError, match="readings beside"):
        reproduce(tmp_path, TINY, only=keys, beside=("printed",))


def test_a_rows_command_tells_starts_and_readings():
    claim = CLAIMS[0]
    beside = Row(claim, {}, {"lasting": Row(claim, {})})
    quick = claims_markdown([beside], asdict(replace(QUICK, seed=7)))
    assert f"`{claim.command} --quick --seed 7 --beside lasting`" in quick
    assert f"`{claim.command}`" in claims_markdown([Row(claim, {})], asdict(FULL))


def test_reproduce_judges_chosen_claims(run, tmp_path):
    words = ["reproduce", "--quick", "--only", "ldvs-accelerated", "--json", "--out", tmp_path]
    code, text, _ = run(*words)
    assert code == 0
    (claim,) = json.loads(text)["claims"]
    assert claim["key"] == "ldvs-accelerated"
    assert set(claim["ours"]) == {"walk", "start"}
    assert claim["command"].endswith("--only ldvs-accelerated --quick")
    assert (tmp_path / "claims.md").is_file()
