"""Obstacles as a figure: FLSS once an obstacle has been reached, against its size."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.captions import caption_of_at_least
from hexmj.measures.drawable_parts import check_starts
from hexmj.measures.figures import frequency_curve, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

SIZES = {
    "step": "height of the step [mm]",
    "gap": "length of the gap [mm]",
    "hurdle": "height of the hurdle [mm]",
    "rough": "highest bump [mm]",
}
"""Kind of ground -> label of its axis."""

FLAT = "flat"
"""Ground that stands in every column."""

STYLES: tuple[dict[str, Any], ...] = (
    {"color": "#1b6ca8", "marker": "o", "linestyle": "-"},
    {"color": "#2a9d5c", "marker": "s", "linestyle": "--"},
    {"color": "#e08e1b", "marker": "^", "linestyle": "-."},
    {"color": "#b3261e", "marker": "D", "linestyle": ":"},
    {"color": "#6a4c93", "marker": "v", "linestyle": "-"},
)
"""Of the velocities in turn."""


def terrain_figure(result: "xr.Dataset") -> "Picture":
    """A column for each kind of ground, a row for each grasp, a colour for each velocity; flat ground is at 0 mm."""
    from hexmj.pictures import head, picture

    check_starts(result)
    kinds, grasps = list(dict.fromkeys(result.ground.values[result.ground.values != FLAT])), result.grasp.values
    figure = picture(max(4.8, 1.0 + 2.8 * len(kinds)), 1.3 + 2.6 * len(grasps))
    panels = figure.subplots(len(grasps), len(kinds), sharey=True, sharex="col", squeeze=False)
    for row, grasp in zip(panels, grasps, strict=True):
        for axes, kind in zip(row, kinds, strict=True):
            chosen = np.isin(result.ground.values, (FLAT, kind))
            _curves(axes, result.sel(grasp=grasp).isel(obstacle=np.flatnonzero(chosen)).sortby("size"))
        row[0].set_ylabel(f"FLSS, grasp {grasp:g}")
    for axes, kind in zip(panels[-1], kinds, strict=True):
        axes.set_xlabel(SIZES[kind])
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=9, loc="outside lower center", ncols=min(5, len(labels)))
    told = caption_of_at_least(int(result.reached.min()), result)
    head(figure, "Falls once the obstacle has been reached, with 95 % intervals", told)
    return figure


def _curves(axes: "Axes", one: "xr.Dataset") -> None:
    """FLSS against size, (obstacle, velocity), with its intervals side by side."""
    sizes, count = one["size"].values, one.sizes["velocity"]
    shifts = (np.arange(count) - (count - 1) / 2) * 0.02 * sizes.max()
    for v, style, shift in zip(one.velocity.values, STYLES * count, shifts, strict=False):
        frequency_curve(axes, sizes + shift, one.sel(velocity=v), "flss", label=f"V = {v:g}", **style)
    axes.set(ylim=(-0.02, 1.02))
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    tidy(axes)
