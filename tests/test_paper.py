"""The paper's claims: the table, what is kept of a stopped run, found sets, figures."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import numpy as np
import pytest
import xarray as xr

from hexmj.controllers.cruse1998 import HWS, LDVS, PRESETS, MODEL_VARIANTS
from hexmj.errors import InputError
from hexmj.measures.kinematic import flss, walk
from hexmj.paper import found_sets as found
from hexmj.paper.claims import CLAIMS, Claim
from hexmj.paper.figures import FIGURES
from hexmj.paper.late_losses import lost_after
from hexmj.paper.obstacles import losses_after
from hexmj.paper.protocol import FULL, MEASUREMENTS, QUICK, RANGES, Protocol, cells
from hexmj.paper.quantities import Weight
from hexmj.paper.reproduce import measure, reproduce
from hexmj.paper.rules import Answer, Band
from hexmj.paper.table import NOT_SEARCHED, Row, claims_json, claims_markdown, judge
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import OBSERVATION_TIMES, Acceleration

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
    for observation_time in ("walk", "start"):
        table = flss(LDVS, protocol.velocities, n_starts=140, seed=protocol.seed, observation_time=observation_time)
        assert lost.sel(observation_time=observation_time).mean("start").values == pytest.approx(table.flss.values)
        table = flss(
            HWS,
            protocol.velocities,
            n_starts=140,
            seed=protocol.seed,
            observation_time=observation_time,
            acceleration=protocol.acceleration,
        )
        assert fast.sel(observation_time=observation_time).mean("start").values == pytest.approx(table.flss.values)


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
    assert (none.sel(observation_time="walk") >= none.sel(observation_time="start")).all()


def test_lost_after_is_the_end_of_the_walk():
    starts, wait, durations = draw_starts(70, 3), 60.0, np.array([20.0, 45.0])
    margin = walk_margin(walk(starts, LDVS, 0.6, wait + durations[-1]))
    ours = lost_after(starts, LDVS, 0.6, wait, durations)
    for lost, duration in zip(ours, durations, strict=True):
        assert np.array_equal(lost, (margin[600 : 600 + round(10 * duration)] <= 0).any(axis=0))
    assert 0 < ours[0].sum() < ours[1].sum() < 70


@pytest.mark.slow
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


@pytest.mark.thorough
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
observation time = "walk"
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
    assert (lost.sel(observation_time="walk") >= 0).all()
    assert (lost.sel(observation_time="start") == -1).all()
    assert (measure("wide", TINY, tmp_path / "out").lost.sel(observation_time="walk") >= 0).all()
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
    places = {one.place[:3] for one in found.found_sets() if one.controller.model_variant == found.PRINTED}
    assert places == {(w, *at) for w in OBSERVATION_TIMES for at in (*((v, v) for v in FULL.velocities), *RANGES.values())}


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


@pytest.mark.thorough
def test_other_readings_stand_beside(tmp_path):
    keys = ("hws-late", "hws-regimes", "p2")
    alone, _ = reproduce(tmp_path / "alone", replace(TINY, model_variant=MODEL_VARIANTS["lasting"]), only=keys[:2])
    told = []
    rows, _ = reproduce(tmp_path, TINY, only=keys, beside=("lasting",), progress=told.append)
    assert sum(told) == pytest.approx(1.0)
    assert [row.beside["lasting"].answers for row in rows[1:]] == [row.answers for row in alone]
    head, line = (tmp_path / "claims.md").read_text().split("| section")[1].splitlines()[0:3:2]
    assert "ours, walk | ours, start | lasting, walk | lasting, start" in head
    assert line.count("|") - 2 == head.count("|") - 1
    with pytest.raises(InputError, match="reading = 'wrong'; valid names: printed, lasting"):
        reproduce(tmp_path, TINY, only=keys, beside=("wrong",))
    with pytest.raises(InputError, match="beside itself"):
        reproduce(tmp_path, TINY, only=keys, beside=("printed",))


def test_a_rows_command_tells_starts_and_readings():
    claim = CLAIMS[0]
    beside = Row(claim, {}, {"lasting": Row(claim, {})})
    quick = claims_markdown([beside], asdict(replace(QUICK, seed=7)))
    assert f"`{claim.command} --quick --seed 7 --beside lasting`" in quick
    assert f"`{claim.command}`" in claims_markdown([Row(claim, {})], asdict(FULL))


def test_other_readings_have_a_table_and_counts_of_their_own(run, tmp_path, monkeypatch):
    """On a screen of 80 columns the cells of all in one would be as narrow as syllables."""
    claim = next(claim for claim in CLAIMS if claim.key == "hws-late")
    ours, lasting = (Answer(0.25, 0.2, 0.3, "V = 0.6", agrees) for agrees in (False, True))
    row = Row(claim, dict.fromkeys(OBSERVATION_TIMES, ours), {"lasting": Row(claim, dict.fromkeys(OBSERVATION_TIMES, lasting))})
    monkeypatch.setattr("hexmj.paper.reproduce.reproduce", lambda *_, **__: ([row], []))
    code, text, _ = run("reproduce", "--only", claim.key, "--beside", "lasting", "--out", tmp_path)
    of_ours, of_lasting = text.split("section")[1:]
    assert code == 0 and "lasting" not in of_ours and "ours" not in of_lasting
    assert of_lasting.splitlines()[0].split()[-4:] == ["lasting,", "walk", "lasting,", "start"]
    assert of_lasting.splitlines()[2].count("agrees: 0.2500") == 2
    told = "reading lasting, claims on FLSS and sets, observation time start: held out 1 agrees"
    assert any(line.startswith(told) for line in claims_json([row], asdict(FULL))["summary"])


@pytest.mark.thorough
def test_reproduce_judges_chosen_claims(run, tmp_path):
    words = ["reproduce", "--quick", "--only", "ldvs-accelerated", "--json", "--out", tmp_path]
    code, text, _ = run(*words)
    assert code == 0
    (claim,) = json.loads(text)["claims"]
    assert claim["key"] == "ldvs-accelerated"
    assert set(claim["ours"]) == {"walk", "start"}
    assert claim["command"].endswith("--only ldvs-accelerated --quick")
    assert (tmp_path / "claims.md").is_file()
