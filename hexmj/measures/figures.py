"""FLSS against velocity as figures, and what other figures share with them."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.io import settings
from hexmj.measures.captions import caption, conditions
from hexmj.measures.drawable_parts import check_starts
from hexmj.pictures import in_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

MEASURE_COLOURS = {"kinematic": "#1b6ca8", "measured": "#e08e1b", "physical": "#b3261e", "toppled": "#6a4c93"}
MEASURE_STYLES: dict[str, dict[str, Any]] = {
    "kinematic": {"marker": "o", "linestyle": "-"},
    "measured": {"marker": "s", "linestyle": "--"},
    "physical": {"marker": "^", "linestyle": "-."},
    "toppled": {"marker": "x", "linestyle": ":"},
}
"""What tells the measures apart where colours are not seen."""

BESIDE = 0.024
"""Width in V_r / V_p over which the points of one velocity stand beside each other."""

IN_A_ROW = 3
"""Panels of controllers beside each other, at most."""

MOST_TICKS = 9
"""Velocities that are written at an axis; of more, round numbers are."""


def comparison_figure(result: "xr.Dataset") -> "Picture":
    """FLSS against velocity with 95 % intervals, a panel for each controller, from `compare.compare`."""
    from hexmj.pictures import head, picture

    check_starts(result)
    names = result.controller.values
    columns = min(IN_A_ROW, len(names))
    rows = -(-len(names) // columns)
    figure = picture(max(5.6, 3.4 * columns), 1.3 + 2.7 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    shifts = dict(zip(MEASURE_COLOURS, np.linspace(-0.5, 0.5, len(MEASURE_COLOURS)) * BESIDE, strict=True))
    for axes, name in zip(panels.ravel(), names, strict=False):
        one = result.sel(controller=name).sortby("velocity")
        for measure, colour in MEASURE_COLOURS.items():
            style = {"color": colour, "label": measure, "markersize": 4.5} | MEASURE_STYLES[measure]
            frequency_curve(axes, one.velocity + shifts[measure], one, measure, **style)
        axes.set_title(in_figure(name), fontsize=10)
        flss_axes(axes, result.velocity.values)
    for n, axes in enumerate(panels.ravel()):
        axes.set_visible(n < len(names))
        axes.tick_params(labelbottom=n + columns >= len(names))
        axes.set(xlabel=axes.get_xlabel() if n + columns >= len(names) else "", ylabel="" if n % columns else "FLSS")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=9, loc="outside lower center", ncols=len(labels))
    title = "Loss of static stability on paper (kinematic) and under the feet (measured); falls (physical)"
    head(figure, title, caption(result))
    return figure


def flss_figure(table: "xr.Dataset") -> "Picture":
    """One curve of FLSS against velocity with its 95 % intervals, from `kinematic.flss` or `compare.physical_flss`."""
    from hexmj.pictures import head, picture

    check_starts(table)
    figure, told = picture(6.4, 4.2), settings(table)
    kind = "physical" if conditions(told) else "kinematic"
    if ("fall" in table) != (kind == "physical") or (kind == "physical" and table.fall.isnull().any()):
        raise InputError("a result of kinematic and of physical FLSS; expected one of them")
    axes = figure.subplots()
    style = {"color": MEASURE_COLOURS[kind], "markersize": 4.5} | MEASURE_STYLES[kind]
    named = table.rename(low="flss_low", high="flss_high").sortby("velocity")
    frequency_curve(axes, named.velocity, named, "flss", **style)
    flss_axes(axes, table.velocity.values)
    head(figure, f"{kind} FLSS with 95 % intervals", caption(table))
    return figure


def velocity_ticks(axes: "Axes", velocities: np.ndarray) -> None:
    """Ticks at the velocities that were walked, unless they are too many to be read."""
    if len(velocities) <= MOST_TICKS:
        axes.set_xticks(velocities, [f"{v:g}" for v in velocities])


def flss_axes(axes: "Axes", velocities: np.ndarray) -> None:
    """Axes of FLSS against velocity."""
    low, high = max(-BESIDE, velocities.min() - 0.1), min(1.0 + BESIDE, velocities.max() + 0.1)
    axes.set(xlabel="velocity $V_r / V_p$", xlim=(low, high), ylabel="FLSS", ylim=(-0.02, 1.02))
    velocity_ticks(axes, velocities)
    tidy(axes)


def frequency_curve(axes: "Axes", x: "np.ndarray | xr.DataArray", one: "xr.Dataset", name: str, **style: Any) -> None:
    """One of a result's frequencies, `name`, with its interval `_low`, `_high`, against x, all of one dimension, in the
    style of `Axes.errorbar`."""
    low, middle, high = (one[name + end].values for end in ("_low", "", "_high"))
    dots: dict[str, Any] = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2.5}
    axes.errorbar(x, middle, [middle - low, high - middle], **dots | style)


def tidy(axes: "Axes") -> None:
    """A grid, and no frame above and on the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)
