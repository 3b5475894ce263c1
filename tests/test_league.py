"""A small league: what it comes to, and how its tables and figures show it."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.errors import InputError
from hexmj.measures.figures import rules
from hexmj.measures.kinematic import first_loss, flss, flss_over_range
from hexmj.measures.physical import physical_walk
from hexmj.physics.settle import settle
from hexmj.plain import plain
from hexmj.starts import draw_starts
from hexmj.stats import paired_difference
from hexmj.studies.entrants import Entrant, entrants
from hexmj.studies.league import League
from hexmj.studies.league_cells import losses, walks
from hexmj.studies.league_figure import FEWER, NOTHING, league_figure, walks_figure
from hexmj.studies.standings import by_rank, league_markdown, tables
from hexmj.sweep import run_cells
from hexmj.timing import Stride
from standing_still import Still

NAMES = ("wilson", "ldvs", "graham-ideal")


@pytest.fixture(scope="module")
def league() -> League:
    takes_part = {**entrants(NAMES), "still": Entrant(Still())}
    return League(takes_part, (0.3, 0.6), 12, 2, 2, observation_time=40.0, accelerating=False, periods=12, seed=0)


@pytest.fixture(scope="module")
def data(league: League, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], xr.Dataset]:
    found = run_cells(league.cells(), tmp_path_factory.mktemp("league"))
    return dict(zip(league.named_cells(), found, strict=True))


@pytest.fixture(scope="module")
def result(league: League, data) -> xr.Dataset:
    return league.result([*data.values()])


@pytest.mark.thorough
def test_frequencies_are_those_of_the_commands(league: League, result) -> None:
    table = flss(hexmj.LDVS, (0.3, 0.6), n_starts=12, observation_time=40.0)
    assert np.array_equal(result.kinematic.sel(entrant="ldvs"), table.flss)
    assert np.array_equal(result.kinematic_low.sel(entrant="ldvs"), table.low)
    j_n, _ = flss_over_range(hexmj.LDVS, 0.1, 0.5, n_starts=12, observation_time=40.0)
    assert result.range.sel(entrant="ldvs") == j_n
    falls = hexmj.physical_flss(hexmj.load_controller("wilson"), (0.3, 0.6), n_starts=2, observation_time=40.0)
    assert np.array_equal(result.physical.sel(entrant="wilson"), falls.flss)


def test_the_way_is_what_was_walked_in_whole_steps() -> None:
    stride, conditions = Stride(dt=1.0), hexmj.Conditions()
    told: Any = {"conditions": conditions, "stride": stride, "threads": 1}
    found = walks(Entrant(hexmj.LDVS), hexmj.LDVS, 0.3, 20.9, n_starts=3, seed=1, **told)
    starts = draw_starts(3, 1, stride)
    end = physical_walk(starts, hexmj.LDVS, 0.3, 20.9, **told).qpos[-1, :, 0]
    walked, upright = end - settle(starts, conditions, stride, 1).qpos[:, 0], np.isinf(found.fall.values)
    assert upright.any()
    np.testing.assert_allclose(found.way[upright], walked[upright], rtol=1e-12)


@pytest.mark.slow
def test_everything_tells_its_units(result) -> None:
    assert {values.attrs["units"] for values in result.values()} == {"1", "mm/s", "time unit"}
    assert (result.slip.units, result.reached.units, result.cost.units) == ("mm/s", "time unit", "1")


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
    still, ideal = (result.sel(entrant=name) for name in ("still", "graham-ideal"))
    assert np.isnan(still.fell.sel(trial=["halt", "leg", "push", "reads", "noise", "late"])).all()
    assert np.isfinite(still.fell.sel(trial=["load", "lost 1"])).all()
    assert np.isnan(result.fell.sel(trial=["step", "rough"])).all()  # 12 mm of way
    assert np.isnan(ideal.fell).all() and np.isnan(ideal.range) and (ideal.kinematic_starts == 1).all()
    assert (ideal.best == 0).all()
    assert by_rank(result).entrant.values[-1] == "graham-ideal"


@pytest.mark.slow
def test_cells_do_not_depend_on_threads_or_on_the_other_entrants(league: League, data) -> None:
    """But for those of disturbances, which look long for starts that keep stability until then."""
    alone = replace(league, entrants={"wilson": league.entrants["wilson"]}, velocities=(0.6,)).named_cells()
    asked = {name: cell for name, cell in alone.items() if name[1] not in ("halt", "leg", "push")}
    assert len(asked) > 10
    for name, cell in asked.items():
        assert cell.compute(threads=1).equals(data[name]), name


def test_nobody_is_pushed_in_a_window_that_holds_no_push(league: League) -> None:
    """It lasts 2 time units."""
    for observation_time, pushed in ((1.9, False), (2.0, True)):
        short = replace(league, entrants={"ldvs": league.entrants["ldvs"]}, observation_time=observation_time)
        assert (("ldvs", "push") in short.named_cells()) == pushed


def test_velocities_that_look_alike_are_not_the_same(league: League) -> None:
    near = replace(league, velocities=(0.3, 0.3000001))
    assert len(near.named_cells()) == len(league.named_cells())


@pytest.mark.parametrize("name", ["n_physical", "n_tried"])
def test_no_more_starts_walk_in_physics_than_on_paper(league: League, name: str) -> None:
    how: dict[str, Any] = {name: 13}
    with pytest.raises(InputError, match=f"{name} = 13; expected at most n_starts = 12"):
        replace(league, **how)


@pytest.mark.parametrize("observation_time", ["start", 40.0])
def test_a_window_of_accelerating_walks_begins_when_the_velocity_is_reached(observation_time: str | float) -> None:
    eq11, entrant = hexmj.Acceleration(rate=0.01), Entrant(hexmj.load_controller("uncoordinated"))
    found = losses(entrant, 0.5, observation_time, n_starts=20, seed=0, stride=Stride(), acceleration=eq11)
    lost = first_loss(hexmj.draw_starts(20, 0), hexmj.UNCOORDINATED, 0.5, 80.0, acceleration=eq11)
    assert np.array_equal(found.lost, np.isfinite(lost))


@pytest.mark.slow
def test_tables_and_figure_show_every_entrant(result) -> None:
    text = league_markdown(result)
    for table in tables(result):
        assert {row[0] for row in table.rows} == {*NAMES, "still"}
        assert all(len(row) == len(table.head) for row in table.rows)
        assert f"### {table.title}" in text
        assert ("FLSS of" in table.title) == table.title.endswith("; graham-ideal from one start")
    assert "graham-ideal from one start" in league_figure(result).get_supxlabel()
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
    assert FEWER not in str(marks(league_figure(result))) + league_figure(result).get_supxlabel()
    trials, *_ = marks(walks_figure(result))
    few, most = result.fell_starts.values, result.fell_starts.max().item()
    assert trials.count(NOTHING) == np.isnan(result.fell).sum() > 0
    assert trials.count(FEWER) == ((few > 0) & (few < most)).sum()
    assert f"{NOTHING} not asked" in walks_figure(result).get_supxlabel()
    lost = result.missing.copy()
    lost.loc[{"entrant": "still", "velocity": 0.6}] = 1
    fewer = result.assign(missing=lost)
    figure = league_figure(fewer)
    assert [one.count(FEWER) for one in marks(figure)[:3]] == [0, 1, 1]
    assert "walks are missing that diverged or were out of reach (in all still 1)" in figure.get_supxlabel()
    assert FEWER in marks(walks_figure(fewer))[3]


@pytest.mark.slow
def test_titles_and_panels_keep_clear_of_each_other(result) -> None:
    for draw in (league_figure, walks_figure):
        for shown in (result, result.isel(velocity=[0], entrant=[0]).assign_attrs(velocities="[0.3]")):
            figure = draw(shown)
            figure.draw_without_rendering()
            boxes = [axes.title.get_window_extent() for axes in figure.axes if axes.get_title()]
            assert len(boxes) == 4
            assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
            assert boxes[0].x0 >= 0 and boxes[-1].x1 <= figure.bbox.width


@pytest.mark.slow
def test_a_set_that_is_not_read_as_printed_is_told_everywhere(league: League, data) -> None:
    """Whatever it did: here all of them did what ldvs does."""
    others = replace(league, entrants=entrants(("lasting", "ldvs", "walknet", "walknet-reacog")))
    result = others.result([data["ldvs", what] for _, what in others.named_cells()])
    assert hexmj.settings(result)["not_printed"] == {"reading lasting": ["lasting"]}
    assert "| lasting (reading lasting) |" in league_markdown(result)
    for which in ("league", "walks"):
        title = hexmj.plot(result, which).get_suptitle()
        assert "reading lasting: lasting; " in title and title.count("lasting") == 2


def test_sequential_sets_and_those_that_read_legs_are_told_too() -> None:
    slow = replace(hexmj.load_controller("lasting"), order="sequential")  # pyright: ignore[reportArgumentType]
    for one in (slow, SensoryFeedback(slow)):
        assert rules(plain(one)) == "sequential order, reading lasting"
    for name in ("ldvs", "walknet", "graham"):
        assert rules(plain(hexmj.load_controller(name))) == ""
