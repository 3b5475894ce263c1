"""The league: entrants, cells, standings with ranks, tables and figures, and walks that fail."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

import hexmj
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import network_toml
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import settings_of
from hexmj.errors import OutOfReach, SimulationError, StillThrown
from hexmj.measures.figures import network_rules
from hexmj.measures.kinematic import first_loss, flss
from hexmj.measures.physical import physical_walk
from hexmj.measures.tables import frequencies, happened
from hexmj.physics.settle import settle
from hexmj.plotting import FEWER, NOTHING
from hexmj.starts import draw_starts
from hexmj.stats import paired_difference
from hexmj.studies.league import League
from hexmj.studies.league_cells import EVERYONE, EntrantWalks, entrants, unless_refused
from hexmj.studies.league_figure import league_figure, walks_figure
from hexmj.studies.standings import TRIALS, by_rank, league_markdown, ranks, tables
from hexmj.sweep import run_cells
from hexmj.timing import Stride
from standing_still import Still, Stretched

SHORT: dict[str, Any] = {"periods": 12, "seed": 0}
NAMES = ("wilson", "ldvs")


@pytest.fixture(scope="module")
def league() -> League:
    takes_part = {**entrants(NAMES), "still": Still()}
    return League(takes_part, (0.3, 0.6), 2, trial_starts=2, n_starts=12, observation_time=40.0, **SHORT)


@pytest.fixture(scope="module")
def data(league: League, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], xr.Dataset]:
    found = run_cells(league.cells(), tmp_path_factory.mktemp("league"))
    return dict(zip(league.named_cells(), found, strict=True))


@pytest.fixture(scope="module")
def result(league: League, data) -> xr.Dataset:
    return league.result([*data.values()])


@pytest.mark.slow
def test_frequencies_are_those_of_the_commands(league: League, result) -> None:
    table = flss(hexmj.LDVS, (0.3, 0.6), n_starts=12, observation_time=40.0)
    assert np.array_equal(result.kinematic.sel(entrant="ldvs"), table.flss)
    assert np.array_equal(result.kinematic_low.sel(entrant="ldvs"), table.low)
    falls = hexmj.physical_flss(hexmj.load_controller("wilson"), (0.3, 0.6), n_starts=2, observation_time=40.0)
    assert np.array_equal(result.physical.sel(entrant="wilson"), falls.flss)


def test_the_way_is_what_was_walked_in_whole_steps() -> None:
    stride, conditions = Stride(dt=1.0), hexmj.Conditions()
    told: Any = {"conditions": conditions, "stride": stride, "threads": 1}
    found = EntrantWalks(hexmj.LDVS, 0.3, 20.9, 3, 1, conditions, stride).outcomes(threads=1)
    starts = draw_starts(3, 1, stride)
    end = physical_walk(starts, hexmj.LDVS, 0.3, 20.9, **told).qpos[-1, :, 0]
    walked, upright = end - settle(starts, conditions, stride, 1).qpos[:, 0], np.isinf(found.fall.values)
    assert upright.any()
    np.testing.assert_allclose(found.way[upright], walked[upright], rtol=1e-12)


@pytest.mark.slow
def test_differences_are_those_on_the_same_starts(result) -> None:
    assert result.attrs["reference"] == "ldvs"
    assert not result.kinematic_above.sel(entrant="ldvs").any()
    starts, v = hexmj.draw_starts(12, 0), 0.3
    lost, of_ldvs = (
        np.isfinite(first_loss(starts, one, v, 40.0)) for one in (hexmj.load_controller("wilson"), hexmj.LDVS)
    )
    one = result.sel(entrant="wilson", velocity=v)
    ends = [one[f"kinematic_above{end}"].item() for end in ("", "_low", "_high")]
    assert np.allclose(ends, paired_difference(lost, of_ldvs))


@pytest.mark.slow
def test_what_cannot_be_asked_is_not_known(result) -> None:
    still = result.sel(entrant="still")
    assert np.isnan(still.fell.sel(trial=["halt", "leg", "push", "reads", "noise", "late"])).all()
    assert np.isfinite(still.fell.sel(trial=["load", "lost 1"])).all()
    assert np.isnan(result.fell.sel(trial=["step", "rough"])).all()  # 12 mm of way


def test_nobody_is_pushed_in_a_window_that_holds_no_push(league: League) -> None:
    """It lasts 2 time units."""
    for observation_time, pushed in ((1.9, False), (2.0, True)):
        short = replace(league, controllers={"ldvs": league.controllers["ldvs"]}, observation_time=observation_time)
        assert (("ldvs", "push") in short.named_cells()) == pushed


@pytest.mark.slow
def test_tables_and_figure_show_every_entrant(result) -> None:
    text = league_markdown(result)
    for table in tables(result):
        assert {row[0] for row in table.rows} == {*NAMES, "still"}
        assert all(len(row) == len(table.head) for row in table.rows)
        assert f"### {table.title}" in text
    assert "nan" not in text
    for draw in (league_figure, walks_figure):
        names = [label.get_text() for label in draw(result).axes[0].get_yticklabels()]
        assert [name.partition(" ")[0] for name in names] == by_rank(result).entrant.values.tolist()


def marks(figure) -> list[list[str]]:
    """What is written in the cells of each panel."""
    return [[text.get_text() for text in axes.texts] for axes in figure.axes]


@pytest.mark.slow
def test_figures_say_where_walks_are_missing_and_where_nothing_is_known(result) -> None:
    assert not result.missing.any()
    assert FEWER not in str(marks(league_figure(result)))
    trials, *_ = marks(walks_figure(result))
    few, most = result.fell_starts.values, result.fell_starts.max().item()
    assert trials.count(NOTHING) == np.isnan(result.fell).sum() > 0
    assert trials.count(FEWER) == ((few > 0) & (few < most)).sum()
    lost = result.missing.copy()
    lost.loc[{"entrant": "still", "velocity": 0.6}] = 1
    fewer = result.assign(missing=lost)
    assert [one.count(FEWER) for one in marks(league_figure(fewer))[:3]] == [0, 1, 1]
    assert FEWER in marks(walks_figure(fewer))[3]


def test_sequential_sets_and_those_that_read_legs_are_told_too() -> None:
    slow = replace(hexmj.load_controller("lasting"), order="sequential")  # pyright: ignore[reportArgumentType]
    for one in (slow, SensoryFeedback(slow)):
        assert network_rules(settings_of(one)) == "sequential order, model variant lasting"
    for name in ("ldvs", "walknet", "graham"):
        assert network_rules(settings_of(hexmj.load_controller(name))) == ""


def test_a_walk_that_is_refused_is_no_outcome_and_stops_nobody_else() -> None:
    found = EntrantWalks(Stretched(), 0.5, 10.0, 6, 0, Conditions(), Stride()).outcomes()
    refused = hexmj.draw_starts(6, 0)[:, 0] > 0
    assert refused.any() and not refused.all()
    still = EntrantWalks(Still(), 0.5, 10.0, 6, 0, Conditions(), Stride()).outcomes()
    assert np.array_equal(found.missing, refused)
    for name, values in found.drop_vars("missing").items():
        assert np.isnan(values.values[refused]).all()
        assert np.array_equal(values.values[~refused], still[name].values[~refused], equal_nan=True)
    assert np.array_equal(happened(found.fall).isnull(), refused)
    told = frequencies("fell", happened(found.fall).values[None], ("entrant",))
    assert told["fell_starts"][1] == (~refused).sum()


def test_where_every_walk_is_refused_nothing_is_known_and_the_league_goes_on() -> None:
    few: Any = SHORT | {"trial_starts": 1, "n_starts": 1, "observation_time": 10.0}
    alone = League({"far": Stretched()}, (0.5,), 1, **few)
    result = alone.result([cell.compute(threads=1) for cell in alone.cells()])
    assert np.isnan(result.physical).all() and (result.physical_starts == 0).all() and np.isnan(result.cost).all()
    assert "nan" not in league_markdown(result)
    league_figure(result)
    walks_figure(result)


@pytest.mark.parametrize("error", [SimulationError, OutOfReach, StillThrown])
def test_a_refused_walk_is_missing_and_the_others_are_as_they_were(error: type[Exception]) -> None:
    def walked(which: np.ndarray, refused: tuple[int, ...] = ()) -> xr.Dataset:
        if np.isin(which, refused).any():
            raise error("refused")
        return xr.Dataset({"fall": ("start", np.sqrt(which), {"units": "mm"})})

    def found(*refused: int) -> xr.DataArray:
        return unless_refused(lambda which: walked(which, refused), 4, {"fall": "mm"}).fall

    whole = found()
    assert found(2).identical(whole.where([True, True, False, True]))
    assert np.isnan(found(0, 1, 2, 3)).all()
    with pytest.raises(ZeroDivisionError):
        unless_refused(lambda which: walked(which[: 1 // 0]), 4, {"fall": "mm"})


def test_conditions_in_which_no_start_comes_to_rest_are_an_error() -> None:
    with pytest.raises(SimulationError):
        EntrantWalks(Still(), 0.3, 5.0, 2, 0, Conditions(settling_time=3.0), Stride()).outcomes()


def test_a_difference_is_that_of_the_starts_that_are_known_in_both() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.uniform(size=(2, 5, 4000)) < np.array([0.5, 0.3])[:, None, None]
    middle, low, high = paired_difference(one, other)
    assert_allclose(middle, one.mean(axis=1) - other.mean(axis=1))
    assert_allclose(paired_difference(other, one), [-middle, -high, -low])
    spread = (one.astype(float) - other).std(axis=1) / np.sqrt(4000)  # of the mean, for many starts
    assert_allclose(high - low, 2 * 1.96 * spread, rtol=0.01)
    known = rng.uniform(size=4000) < 0.8
    assert_allclose(
        paired_difference(np.where(known, one, np.nan), other), paired_difference(one[:, known], other[:, known])
    )
    assert np.isnan(paired_difference(np.full(50, np.nan), other[0, :50])).all()


def test_ranks_are_given_only_where_intervals_separate() -> None:
    rng = np.random.default_rng(0)
    often, rarely, seldom = (rng.uniform(size=200) < p for p in (0.8, 0.2, 0.22))
    best, worst = ranks(np.array([often, rarely, seldom, np.full(200, np.nan)], dtype=float))
    assert best.tolist() == [3, 1, 1, 0]
    assert worst.tolist() == [3, 2, 2, 0]
    few = np.array([[0.0, 0.0], [1.0, 1.0]])  # two starts show no difference
    assert [one.tolist() for one in ranks(few)] == [[1, 1], [2, 2]]


def test_everyone_is_found_and_can_be_asked_everything() -> None:
    takes_part = entrants(EVERYONE)
    assert len(takes_part) == len(EVERYONE)
    named = League(takes_part).named_cells()
    for name in takes_part:
        asked = {what for one, what in named if one == name}
        assert {"physics 0.5", "kinematic 0.5", *TRIALS} <= asked


OWN = """
from dataclasses import dataclass
from hexmj.controllers.baselines.metronomes import Metronome

@dataclass(frozen=True)
class One(Metronome):
    name: str = "one"

@dataclass(frozen=True)
class Ldvs(One):
    name: str = "ldvs"
"""


def test_controllers_of_files_have_short_and_distinct_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(OWN)
    Path("found.toml").write_text(network_toml(hexmj.LDVS))
    expected = {"own.py:One": "one", "own.py:Ldvs": "own.py:Ldvs", "found.toml": "found", "ldvs": "ldvs"}
    assert entrants([*expected]) == {short: hexmj.load_controller(name) for name, short in expected.items()}
