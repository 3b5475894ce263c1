"""Dynamic stability maps as figures: two heat maps, and the mechanisms as stacked bars."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.captions import caption
from hexmj.measures.drawable_parts import check_starts
from hexmj.studies.stability_map.mechanisms import SAVED

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

MECHANISM_COLOURS = {
    "never_lost": "#e4e4e4",
    "still_standing": "#cde8c9",
    "too_short": "#8fce8a",
    "landed_in_time": "#46a35e",
    "caught": "#14663a",
    "tipped_behind": "#f5a25d",
    "tipped_ahead": "#f6d55c",
    "thrown": "#b3261e",
    "unplanned": "#6a4c93",
    "narrow": "#b79bd6",
}
"""Grey where nothing happened, greens for the saved, warm colours for falls after a planned loss, violet for others."""

HATCHES = {"tipped_behind": "//", "tipped_ahead": "\\\\", "thrown": "xx", "unplanned": "..", "narrow": "--"}
"""Of those that fell, where colours are not seen."""

BAR: Mapping[str, Any] = {"marker": "_", "linestyle": "none"}
MARKS: Mapping[str, Mapping[str, Any]] = {
    "physical": {"color": "0.1", "markersize": 22, "markeredgewidth": 1.8},
    "toppled": {"color": "white", "markersize": 14, "markeredgewidth": 1.8},
}
"""Measure -> the mark above which its starts lie."""


def map_figure(result: "xr.Dataset") -> "Picture":
    """Physical FLSS above the kinematic one, and how many static losses dynamics saves, from `StabilityMap`."""
    from hexmj.pictures import head, picture

    result = _drawn(result)
    rows, columns = result.sizes["value"], result.sizes["velocity"]
    figure = picture(max(8.0, 2.4 + 2.0 * columns), 1.9 + 0.62 * (rows + 1))
    physical, saved = figure.subplots(1, 2, sharey=True)
    numbers = np.concatenate([result.kinematic.values[:1], result.physical.values])
    words = [[f"{number:.2f}" for number in row] for row in numbers]
    if result.attrs["over"] == "vp":
        for (row, column), number in np.ndenumerate(result.froude.values):
            words[1 + row][column] += f"\nFr {number:.2g}"
    _heat(physical, numbers, words, "YlOrRd")
    lost = np.isfinite(result.static_loss.values).sum(axis=-1)
    counts = result["count"].sel(mechanism_name=list(SAVED)).sum("mechanism_name").values
    words = [
        [f"{a} of {b}" if b else "none lost" for a, b in zip(*row, strict=True)]
        for row in zip(counts, lost, strict=True)
    ]
    lost_on_paper = np.isfinite(result.planned_loss.isel(value=0).values).sum(axis=-1)
    words = [[f"{n} lost" for n in lost_on_paper], *words]
    _heat(saved, np.concatenate([np.full((1, columns), np.nan), result.saved.values]), words, "YlGn")
    physical.set_yticks(range(rows + 1), ["on paper", *(f"{value:g}" for value in result.value.values)])
    physical.set_ylabel(_label(result))
    titles = {physical: "physical FLSS", saved: "saved by dynamics, of the static losses"}
    for axes, title in titles.items():
        axes.axhline(0.5, color="white", linewidth=9.0)
        axes.set_title(title, fontsize=11)
        axes.set_xticks(range(columns), [f"{v:g}" for v in result.velocity.values])
        axes.set_xlabel("velocity $V_r / V_p$")
    head(figure, "What falls in physics, and what dynamics saves", _told(result))
    return figure


def mechanisms_figure(result: "xr.Dataset") -> "Picture":
    """What happened to every start, a panel for each velocity, from `StabilityMap`."""
    from hexmj.pictures import head, picture

    result = _drawn(result)
    columns, total = result.sizes["velocity"], result.sizes["start"]
    figure = picture(max(8.0, 2.6 + 2.3 * columns), 4.6)
    panels = np.atleast_1d(figure.subplots(1, columns, sharey=True))
    values = range(result.sizes["value"])
    for panel, v in zip(panels, result.velocity.values, strict=True):
        bottom = np.zeros(len(values))
        for name, colour in MECHANISM_COLOURS.items():
            share = result["count"].sel(velocity=v, mechanism_name=name).values / total
            style = {"color": colour, "hatch": HATCHES.get(name), "edgecolor": "0.25", "linewidth": 0.0}
            panel.bar(values, share, 0.82, bottom, label=name.replace("_", " "), **style)
            bottom = bottom + share
        for measure, style in MARKS.items():
            panel.plot(values, 1.0 - result[measure].sel(velocity=v).values, **BAR, **style)
        panel.set_title(f"V = {v:g}", fontsize=11)
        panel.set_xticks(values, [f"{value:g}" for value in result.value.values])
        panel.set(ylim=(0.0, 1.0), xlabel=_label(result).replace(" [", "\n["))
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("starts\n(above the marks: fell black, toppled white)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], frameon=False, fontsize=9, loc="outside right center")
    head(figure, "What happened to every start", _told(result))
    return figure


def _drawn(result: "xr.Dataset") -> "xr.Dataset":
    """The axes in their order, if all starts are there that were counted."""
    counted = result["count"].sel(mechanism_name=list(MECHANISM_COLOURS)).sum("mechanism_name")
    check_starts(result, counted.max().item())
    return result.transpose("value", "velocity", "start", ...)


def _told(result: "xr.Dataset") -> str:
    """Who walked, and how many of the starts count."""
    count, drawn = result.sizes["start"], result.attrs["starts"]
    left = f"; {count} of them stand and reach nine of ten tips at every value" if count < drawn else ""
    return caption(result) + left


def _heat(axes: "Axes", numbers: np.ndarray, words: list[list[str]], colours: str) -> None:
    """Fractions as colours with words in every cell, the first row at the bottom."""
    axes.imshow(numbers, cmap=colours, vmin=0.0, vmax=1.0, origin="lower", aspect="auto")
    for row, column in np.ndindex(numbers.shape):
        colour = "white" if numbers[row, column] > 0.6 else "0.1"
        axes.text(column, row, words[row][column], ha="center", va="center", color=colour, fontsize=10, linespacing=1.1)
    axes.set_xticks(np.arange(numbers.shape[1] - 1) + 0.5, minor=True)
    axes.set_yticks(np.arange(numbers.shape[0] - 1) + 0.5, minor=True)
    axes.grid(which="minor", color="white", linewidth=2.0)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)


def _label(result: "xr.Dataset") -> str:
    name, unit = result.value.attrs["long_name"], result.value.attrs["units"]
    return name.replace("V_p", "$V_p$") + (f" [{unit}]" if unit != "1" else "")
