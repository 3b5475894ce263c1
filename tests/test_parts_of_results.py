"""A part of a result, or one in another order, is drawn with the same numbers in the right places, or refused."""

import io
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hexmj.studies.variants.study import Variants
from matplotlib.lines import Line2D

import hexmj
from hexmj.errors import InputError
<<<<<<< HEAD
from hexmj.plotting import FIGURES
from hexmj.search.stages import history
from hexmj.studies.ablation import Ablation
from hexmj.studies.biology import Biology, biology_markdown
from hexmj.studies.disturbance import DisturbedWalks
from hexmj.studies.disturbed_walks import NO_DISTURBANCE
from hexmj.studies.entrants import entrants
from hexmj.studies.league import League
from hexmj.studies.stability_map import StabilityMap
from hexmj.studies.standings import league_markdown
from hexmj.studies.static_limit import StaticLimit
from hexmj.studies.terrain import Terrain
=======
from hexmj.plots import FIGURES
from hexmj.search.stages import history
from hexmj.studies.ablation.study import Ablation
from hexmj.studies.biology.study import Biology
from hexmj.studies.biology.table import biology_markdown
from hexmj.studies.disturbance.cases import NO_DISTURBANCE
from hexmj.studies.disturbance.study import DisturbedWalks
from hexmj.studies.league.entrants_by_name import entrants
from hexmj.studies.league.study import League
from hexmj.studies.league.table import league_markdown
from hexmj.studies.stability_map.study import StabilityMap
from hexmj.studies.static_limit.study import StaticLimit
from hexmj.studies.terrain.study import Terrain
from hexmj.studies.variants.study import Variants
>>>>>>> a504e1a (Join the search into five modules; move its command's logic there)
from hexmj.sweep import run_study
from tiers import few_of

PHYSICAL: dict[str, Any] = {"n_starts": 3, "observation_time": 20.0}
ON_PAPER: dict[str, Any] = {"n_starts": 20, "observation_time": 20.0, "physical": False, "strategies": ["reorganise"]}
FEW: dict[str, Any] = {"n_starts": 3, "n_physical": 2, "periods": 12}
SHORT: dict[str, Any] = FEW | {"n_tried": 1, "observation_time": 10.0}
TWO = {"ldvs": [hexmj.LDVS] * 2, "hws": [hexmj.HWS] * 2}


def searched() -> xr.Dataset:
    asked = {"population": [0.9, 0.5, 0.7], "simplex": [0.6, 0.4, 0.5]}
    return history([(stage, np.zeros((3, 1)), np.array(costs)) for stage, costs in asked.items()], ["a"], "FLSS")


MADE: dict[str, Callable[[], xr.Dataset]] = {
    "flss": lambda: hexmj.physical_flss(hexmj.LDVS, [0.5, 0.7], n_starts=3, observation_time=20.0),
    "compare": lambda: hexmj.compare({"a": hexmj.LDVS, "b": hexmj.HWS}, [0.5, 0.7], n_starts=3, observation_time=20.0),
    "map": lambda: run_study(StabilityMap(hexmj.UNCOORDINATED, "vp", [160.0, 320.0], [0.5, 0.7], **PHYSICAL)),
    "converge": lambda: run_study(StaticLimit(hexmj.LDVS, vps=[320.0, 160.0], **PHYSICAL)),
    "terrain": lambda: run_study(Terrain(hexmj.LDVS, [0.6], ["step", "hurdle"], [3.0], grasps=[0.0], n_starts=2)),
    "disturb": lambda: run_study(DisturbedWalks(hexmj.LDVS, [0.5, 0.6], ["halt", "leg"], **ON_PAPER)),
    "variants": lambda: run_study(Variants(TWO, [0.5, 0.7], n_starts=20, observation_time="start")),
    "biology": lambda: run_study(Biology(hexmj.LDVS, 4, n_starts=2)),
    "league": lambda: run_study(League(entrants(("ldvs", "hws")), (0.5, 0.7), **SHORT)),
    "ablate": lambda: run_study(Ablation({"ldvs": {"ldvs": hexmj.LDVS, "b": hexmj.HWS}}, [0.5, 0.7], **FEW)),
    "search": searched,
}


@cache
def made(name: str) -> xr.Dataset:
    return MADE[name]()


def pixels(result: xr.Dataset, which: str) -> bytes:
    drawn = io.BytesIO()
    hexmj.plot(result, which).savefig(drawn, format="rgba", dpi=50)
    return drawn.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(MADE, "flss", "compare", "variants", "search"))
def test_the_order_of_the_axes_changes_nothing(name: str):
    result = made(name)
    for which in FIGURES[name]:
        whole = pixels(result, which)
        assert pixels(result.transpose(*[*result.sizes][::-1]), which) == whole
        if "start" in result.dims:
            assert pixels(result.isel(start=slice(None, None, -1)), which) == whole


def test_a_result_may_be_opened_lazily():
    assert pixels(made("map").chunk(), "map") == pixels(made("map"), "map")


@pytest.mark.parametrize(
    ("name", "axis"),
    few_of(
        [("flss", "velocity"), ("compare", "velocity"), ("disturb", "velocity"), ("converge", "vp")],
        *[("flss", "velocity"), ("compare", "velocity")],
    ),
)
def test_curves_join_neighbours_in_whatever_order_they_were_walked(name: str, axis: str):
    for order in (slice(None), slice(None, None, -1)):
        drawn = hexmj.plot(made(name).isel({axis: order}))
        curves = [line.get_xdata() for axes in drawn.axes for line in axes.lines if line.get_linestyle() != "None"]
        assert len(curves) > 0 and all(np.all(np.diff(x) >= 0.0) for x in map(np.asarray, curves))


def test_values_that_print_alike_have_bars_of_their_own():
    result = made("map").assign_coords(value=("value", [160.0, 160.0000001], made("map").value.attrs))
    bars = {patch.get_x() for patch in hexmj.plot(result, "mechanisms").axes[0].patches}  # pyright: ignore
    assert len(bars) == 2


ALL_STARTS = "flss", "compare", "map", "converge", "terrain", "disturb", "variants", "biology"


@pytest.mark.parametrize("name", few_of(ALL_STARTS, "flss", "compare", "variants"))
def test_numbers_of_all_starts_are_not_drawn_of_a_part_of_them(name: str):
    result = made(name)
    part = result.isel(start=[0])
    for which in FIGURES[name]:
        with pytest.raises(InputError, match=rf"^1 of {result.sizes['start']} along the axis start; expected all"):
            hexmj.plot(part, which)


@pytest.mark.thorough
def test_ranks_over_all_velocities_are_not_drawn_of_a_part_of_them():
    for which in FIGURES["league"]:
        with pytest.raises(InputError, match=r"^1 of 2 along the axis velocity; expected all"):
            hexmj.plot(made("league").isel(velocity=[1]), which)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "sentence"),
    [
        (lambda one: one.isel(trial=[0]), "the tables .* cannot be made of this part of a result, .*trial 1"),
        (lambda one: one.isel(measure=[0]), "the tables .* cannot be made of this part of a result, .*measure 1"),
        (lambda one: one.isel(entrant=0), "the tables .*of one entrant without an axis.; expected the result as"),
        (lambda one: one.isel(entrant=[]), "a result without the axis entrant; expected all"),
        (lambda one: one.rename(entrant="e"), "the tables .* cannot be made of this part of a result, .*e 2"),
        (lambda one: one.drop_attrs(), "the tables .* cannot be made of this part of a result, "),
    ],
)
def test_tables_of_a_part_of_a_league_are_refused_in_a_sentence(part: Callable, sentence: str):
    with pytest.raises(InputError, match=f"^{sentence}"):
        league_markdown(part(made("league")))


@pytest.mark.slow
def test_the_table_of_insects_of_too_small_a_part_is_refused_in_a_sentence():
    with pytest.raises(InputError, match=r"^the table of insects cannot be made of this part of a result, "):
        biology_markdown(made("biology").isel(row=0))


def test_a_title_names_the_controllers_that_are_shown():
    result = made("compare")
    for names in (["a"], ["b"], ["b", "a"]):
        title = hexmj.plot(result.sel(controller=names)).get_suptitle()
        assert f"\n{', '.join(sorted(names))};" in title


def test_results_of_other_settings_are_not_drawn_under_those_of_the_first():
    def one(name: str, observation_time: float) -> xr.Dataset:
        return hexmj.compare({name: hexmj.LDVS}, [0.5], n_starts=2, observation_time=observation_time)

    a, b, longer = one("a", 5.0), one("b", 5.0), one("a", 10.0)
    with pytest.raises(InputError, match=r"^a result of the controller 'b', but with the settings of a; expected"):
        hexmj.plot(xr.concat([a, b], "controller"))
    for joined in ([a, longer], [longer, a]):
        with pytest.raises(InputError, match=r"^a result with the observation time \d+\.0 in its settings, but with walks of "):
            hexmj.plot(xr.concat(joined, xr.DataArray([0.5, 0.7], dims="velocity", name="velocity")))
    told = xr.concat([a, b], "controller", combine_attrs="drop_conflicts")
    assert "a, b; 2 starts" in hexmj.plot(told).get_suptitle()


def test_velocities_of_other_numbers_of_starts_are_drawn_together():
    few, many = (hexmj.flss(hexmj.LDVS, [v], n_starts=n, observation_time=5.0) for v, n in ((0.3, 5), (0.5, 8)))
    assert "starts" not in hexmj.plot(xr.concat([few, many], "velocity", combine_attrs="drop_conflicts")).get_suptitle()


@pytest.mark.parametrize("other", [{"stride": hexmj.Stride(aep0=8.0)}, {"acceleration": hexmj.Acceleration(0.01)}])
def test_velocities_of_other_walks_are_drawn_together_without_what_differs(other):
    both = [hexmj.flss(hexmj.LDVS, [v], n_starts=5, **how) for v, how in ((0.3, {}), (0.5, other))]
    with pytest.raises(InputError, match="expected one observation time, stride and acceleration, or"):
        hexmj.plot(xr.concat(both, "velocity"))
    title = hexmj.plot(xr.concat(both, "velocity", combine_attrs="drop_conflicts")).get_suptitle()
    assert title.endswith("ldvs; 5 starts; observation time walk; seed 0")


def test_kinematic_and_physical_flss_are_not_drawn_as_one():
    results = [measure(hexmj.LDVS, [0.5], n_starts=2, observation_time=5.0) for measure in (hexmj.flss, hexmj.physical_flss)]
    for both in (results, results[::-1]):
        for told in ("override", "drop_conflicts"):
            with pytest.raises(InputError, match=r"^a result of kinematic and of physical FLSS; expected one of them$"):
                hexmj.plot(xr.concat(both, "velocity", combine_attrs=told))


def test_a_label_that_is_there_twice_is_a_sentence():
    walked = hexmj.physical_walk(hexmj.draw_starts(1, seed=0), hexmj.LDVS, 0.5, 5.0)
    twice = hexmj.record(walked).isel(leg=[0, 0, 1, 2, 3, 4, 5])
    with pytest.raises(InputError, match=r" cannot be drawn of this part of a result, .*leg 7"):
        hexmj.plot(twice)


def cells(result: xr.Dataset) -> list[tuple[str, ...]]:
    """Title, row and column of each cell of a map's panels, and what it says in words and as a colour."""
    found, figure = [], hexmj.plot(result)
    for axes in figure.axes:
        (image,) = axes.images
        labels = axes.get_xticklabels(), figure.axes[0].get_yticklabels()
        columns, rows = ([text.get_text() for text in one] for one in labels)
        for text in axes.texts:
            x, y = map(int, text.get_position())
            found.append(
                (axes.get_title(), rows[y], columns[x], text.get_text(), str(np.asarray(image.get_array())[y, x]))
            )
    return sorted(found)


def test_every_number_of_a_map_stands_in_its_cell():
    result = made("map")
    whole = cells(result)
    assert {words for *_, words in whole} - {"0.0", "nan"}
    backwards = {"value": slice(None, None, -1), "velocity": slice(None, None, -1)}
    for other in (
        result.transpose("velocity", "value", ...),
        result.isel(backwards),
        result.sortby("value", ascending=False),
    ):
        assert cells(other) == whole
    assert set(cells(result.isel(velocity=[1]))) < set(whole)


def undisturbed(figure: Any) -> list[Line2D]:
    return [line for axes in figure.axes for line in axes.lines if line.get_linestyle() == ":"]


@pytest.mark.slow
def test_only_the_undisturbed_case_is_drawn_as_such():
    result = made("disturb")
    whole = hexmj.plot(result)
    expected = result.kinematic.sel(observation_time="whole").isel(case=0).values
    for one in (whole, hexmj.plot(result.isel(case=slice(None, None, -1)))):
        assert len(undisturbed(one)) == 2
        assert all(np.array_equal(line.get_ydata(), expected) for line in undisturbed(one))
        assert sorted(axes.get_title() for axes in one.axes) == ["body halted", "one leg stopped"]
    assert {NO_DISTURBANCE} < {text.get_text() for text in whole.legends[0].get_texts()}
    part = hexmj.plot(result.isel(case=result.disturbance.values == "halt"))
    assert not undisturbed(part)
    assert [axes.get_title() for axes in part.axes] == ["body halted"]
    assert NO_DISTURBANCE not in {text.get_text() for text in part.legends[0].get_texts()}


def test_obstacles_without_flat_ground_have_a_column_each():
    result = made("terrain")
    part = hexmj.plot(result.isel(obstacle=result.ground.values != "flat"))
    assert [axes.get_xlabel() for axes in part.axes] == ["height of the step [mm]", "height of the hurdle [mm]"]


def test_the_mean_of_variants_is_that_of_those_shown():
    result = made("variants").isel(network=[0], velocity=[0])
    for one in (result, result.isel(variant=[0, 1])):
        *_, mean = (line for line in hexmj.plot(one).axes[0].lines if line.get_marker() == "|")
        assert np.asarray(mean.get_xdata())[0] == pytest.approx(one.flss.mean().item())
    assert result.flss.mean().item() == pytest.approx(result["mean"].item())


def test_candidates_stand_at_their_evaluation():
    def drawn(history: xr.Dataset) -> list[list[tuple[float, float]]]:
        return [
            [*zip(*np.asarray(line.get_data()).tolist(), strict=True)] for line in hexmj.plot(history).axes[0].lines
        ]

    history = made("search")
    assert drawn(history)[:2] == [[(1, 0.9), (2, 0.5), (3, 0.7)], [(1, 0.9), (2, 0.5), (3, 0.5)]]
    assert drawn(history.sortby("cost")) == drawn(history)
    assert drawn(history.drop_vars("evaluation")) == drawn(history)
    assert drawn(history.isel(evaluation=slice(4, None))) == [[(5, 0.4), (6, 0.5)], [(5, 0.4), (6, 0.4)]]


@pytest.mark.slow
def test_each_group_of_an_ablation_is_set_off_however_its_rows_are_sorted():
    model, other = {"ldvs": hexmj.LDVS, "a": hexmj.HWS, "b": hexmj.HWS}, {"hws": hexmj.HWS}
    result = run_study(Ablation({"ldvs": model, "hws": other}, [0.5], **FEW))
    for one, row in ((result, 2.5), (result.isel(controller=slice(None, None, -1)), 0.5)):
        assert [np.asarray(line.get_ydata())[0] for line in hexmj.plot(one).axes[0].lines] == [row]
