"""Results and their figures: saved and loaded without a change, and every number in its place."""

import io
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text
from PIL import Image

import hexmj
from hexmj.errors import InputError
from hexmj.plotting import FIGURES
from hexmj.search.stages import history
from hexmj.studies.biology import Biology
from hexmj.sweep import run_study
from tiers import few_of

PHYSICAL: dict[str, Any] = {"n_starts": 3, "observation_time": 20.0}
NAME = "ß: 1 $"
"""A name that JSON escapes, and that figures could set as a formula."""


def compared() -> xr.Dataset:
    conditions = hexmj.Conditions(vp=200.0, ground="step", friction=0.5)
    how: dict[str, Any] = PHYSICAL | {"conditions": conditions, "acceleration": hexmj.Acceleration(rate=0.02)}
    return hexmj.compare({NAME: hexmj.LDVS, "null": hexmj.load_controller("graham")}, [0.3, 0.5], **how)


def searched() -> xr.Dataset:
    costs = {"population": [0.9, 0.5, 0.7], "simplex": [0.6, 0.4, 0.5]}
    return history([(stage, np.zeros((3, 1)), np.array(values)) for stage, values in costs.items()], ["a"], "FLSS")


def recorded() -> xr.Dataset:
    return hexmj.record(hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 10.0), 0, NAME)


MADE: dict[str, Callable[[], xr.Dataset]] = {
    "flss": lambda: hexmj.physical_flss(hexmj.LDVS, [0.5, 0.7], **PHYSICAL),
    "compare": compared,
    "biology": lambda: run_study(Biology(hexmj.LDVS, 4, n_starts=2)),
    "tasks": lambda: hexmj.run_task(["slow", "fast"], {"ldvs": hexmj.LDVS, "hws": hexmj.HWS}, n_starts=2),
    "search": searched,
    "recording": recorded,
}
QUICK = "flss", "compare", "search", "recording"


@cache
def made(name: str) -> xr.Dataset:
    return MADE[name]()


def pixels(result: xr.Dataset, which: str | None = None) -> bytes:
    drawn = io.BytesIO()
    hexmj.plot(result, which).savefig(drawn, format="rgba", dpi=50)
    return drawn.getvalue()


@pytest.mark.parametrize("name", few_of(MADE, *QUICK))
def test_a_result_and_its_figures_stay_the_same_when_saved_and_loaded(name: str, tmp_path: Path) -> None:
    result = made(name)
    read = hexmj.load(hexmj.save(result, tmp_path / "result.nc"))
    assert read.equals(result) and hexmj.settings(read) == hexmj.settings(result)
    for which in FIGURES[name]:
        assert pixels(read, which) == pixels(result, which)
        figure = hexmj.plot(result, which)
        sizes = [float(text.get_fontsize()) for text in figure.findobj(Text) if text.get_text().strip()]
        assert min(sizes) * 10.0 / figure.get_figwidth() >= 9.0, "legible on a slide of 10 inches"


@pytest.mark.parametrize("name", few_of([name for name in MADE if name != "recording"], "flss", "compare", "search"))
def test_the_order_of_the_axes_changes_no_pixel(name: str) -> None:
    result = made(name)
    for which in FIGURES[name]:
        assert pixels(result.transpose(*[*result.sizes][::-1]), which) == pixels(result, which)


@pytest.mark.parametrize(
    ("name", "axis"),
    few_of(
        [("flss", "velocity"), ("compare", "velocity")],
        ("flss", "velocity"),
    ),
)
def test_curves_join_neighbours_in_any_order(name: str, axis: str) -> None:
    drawn = hexmj.plot(made(name).isel({axis: slice(None, None, -1)}))
    curves = [line.get_xdata() for axes in drawn.axes for line in axes.lines if line.get_linestyle() != "None"]
    assert len(curves) > 0 and all(np.all(np.diff(x) >= 0.0) for x in map(np.asarray, curves))


def head_of(result: xr.Dataset) -> str:
    """The finding and the conditions above the first figure of a result."""
    texts = [text.get_text() for text in hexmj.plot(result).texts]
    return " ".join(" ".join(texts).replace("\N{NO-BREAK SPACE}", " ").split())


@pytest.mark.slow
def test_every_number_of_the_league_stands_in_its_cell() -> None:
    result = made("tasks")
    for shown in (result, result.isel(task=[1], controller=[1, 0])):
        axes = hexmj.plot(shown).axes[0]
        labels = [[label.get_text() for label in get()] for get in (axes.get_yticklabels, axes.get_xticklabels)]
        numbers = [text for text in axes.texts if text.get_fontweight() == "bold"]
        assert len(numbers) == shown.fell.size
        for text in numbers:
            column, row = (round(value) for value in text.get_position())
            fell = shown.fell.sel(controller=labels[0][row], task=labels[1][column]).item()
            assert float(text.get_text()) == round(fell, 2)


def test_candidates_stand_at_their_evaluation() -> None:
    def drawn(search: xr.Dataset) -> list[list[tuple[float, float]]]:
        lines = hexmj.plot(search).axes[0].lines
        return [[*zip(*np.asarray(line.get_data()).tolist(), strict=True)] for line in lines]

    search = made("search")
    assert drawn(search)[:2] == [[(1, 0.9), (2, 0.5), (3, 0.7)], [(1, 0.9), (2, 0.5), (3, 0.5)]]
    assert drawn(search.sortby("cost")) == drawn(search)


def test_one_velocity_is_a_list_of_one_and_is_seen() -> None:
    alone, listed = (hexmj.flss(hexmj.LDVS, v, n_starts=5) for v in (0.3, [0.3]))
    assert alone.identical(listed)
    for result in (alone, made("compare").isel(velocity=[0])):
        lines = [line for axes in hexmj.plot(result).axes for line in axes.get_lines()]
        assert lines and all(line.get_marker() not in ("None", "", " ", None) for line in lines)


def test_settings_are_those_that_were_given() -> None:
    made_with = hexmj.settings(made("compare"))
    assert made_with["study"] == "compare" and [*made_with["controllers"]] == [NAME, "null"]
    assert made_with["conditions"] == hexmj.Conditions(vp=200.0, ground="step", friction=0.5).settings()
    assert made_with["acceleration"] == {"rate": 0.02, "start": 0.1}
    assert (made_with["observation_time"], made_with["starts"], made_with["seed"]) == (20.0, 3, 0)
    assert hexmj.settings(hexmj.flss(hexmj.LDVS, 0.5, n_starts=2, seed=2**70))["seed"] == 2**70


def test_the_title_names_what_differs_from_the_defaults() -> None:
    title = head_of(made("compare"))
    for words in ("3 starts", "seed 0", "20 time units", "200 mm/s", "friction = 0.5", "ground = step", "a = 0.02"):
        assert words in title
    assert "step height" not in title
    lasting = hexmj.flss(hexmj.load_controller("lasting"), 0.5, n_starts=5, stride=hexmj.Stride(aep0=9.5))
    title = head_of(lasting)
    assert title.count("lasting") == 2 and "9.5" in title
    shown = head_of(made("compare").sel(controller=["null"]))
    assert "null" in shown and NAME[:2] not in shown


def test_a_concatenated_result_names_its_coordinates() -> None:
    result = xr.concat([made("compare").assign_coords(friction=value) for value in (0.2, 0.7)], "friction")
    assert "friction = 0.2, 0.7" in head_of(result) and "friction = 0.5" not in head_of(result)
    panels = [axes.get_title().replace("\N{NO-BREAK SPACE}", " ") for axes in hexmj.plot(result).axes]
    assert len(panels) == 4 and "friction = 0.2" in panels[0] and "friction = 0.7" in panels[-1]
    assert "friction = 0.7" in head_of(result.sel(friction=0.7))


def test_the_finding_of_a_comparison_is_the_distance_of_both_plans_from_the_falls() -> None:
    result = made("compare")
    away = {"kinematic": 0.37, "dynamic": xr.where(result.velocity == 0.5, 0.12, -0.12), "physical": 0.0}
    for measure, distance in away.items():
        for end in ("", "_low", "_high"):
            result[measure + end] = 0.5 + distance + 0.0 * result.physical
    assert "FLSS 0.37, FLDS 0.12" in head_of(result)


def test_a_notebook_shows_a_figure() -> None:
    shown = Image.open(io.BytesIO(hexmj.plot(made("flss"))._repr_png_()))  # pyright: ignore
    assert shown.format == "PNG" and len(shown.convert("RGB").getcolors(1 << 20) or ()) > 20


@pytest.mark.parametrize(
    "draw",
    [
        lambda: hexmj.plot(xr.Dataset({"x": 1.0})),
        lambda: hexmj.plot(made("flss"), "fate"),
        lambda: hexmj.load("no such file.nc"),
        lambda: hexmj.save(xr.Dataset({"x": ("i", np.array([{}, {}]))}), "a.nc"),
    ],
)
def test_what_cannot_be_drawn_loaded_or_saved_is_an_error(
    draw: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        draw()


@pytest.mark.slow
@pytest.mark.parametrize("form", few_of(["svg", "png", "pdf"], "png"))
def test_a_command_draws_what_can_be_drawn_again(form: str, tmp_path: Path) -> None:
    words = ["compare", "--velocity", "0.5", "--starts", "2", "--observation-time", "10"]
    words += ["--format", form, "--out", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "hexmj", *words], check=True, capture_output=True)
    drawn = tmp_path / f"comparison.{form}"
    assert drawn.read_bytes()[:5] == {"png": b"\x89PNG\r", "pdf": b"%PDF-", "svg": b"<?xml"}[form]
    if form == "png":
        hexmj.plot(hexmj.load(tmp_path / "comparison.nc")).savefig(tmp_path / "again.png", dpi=150)
        assert (tmp_path / "again.png").read_bytes() == drawn.read_bytes()
