"""Obstacles as a figure: FLSS once an obstacle has been reached, against its size."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.studies.drawing import frequency_curve, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZES = {
    "step": "height of the step [mm]",
    "gap": "length of the gap [mm]",
    "hurdle": "height of the hurdle [mm]",
    "rough": "highest bump [mm]",
}
"""Kind of ground -> label of its axis."""

COLOURS = ("#1b6ca8", "#2a9d5c", "#e08e1b", "#b3261e", "#6a4c93")
"""Of the velocities in turn."""


def terrain_figure(result: "xr.Dataset") -> "Figure":
    """A column for each kind of ground, a row for each grasp, a colour for each velocity; flat ground is at 0 mm."""
    from matplotlib.figure import Figure

    kinds, grasps = list(dict.fromkeys(result.ground.values[1:])), result.grasp.values
    size = (1.0 + 2.8 * len(kinds), 1.0 + 2.6 * len(grasps))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(grasps), len(kinds), sharey=True, sharex="col", squeeze=False)
    for row, grasp in zip(panels, grasps, strict=True):
        for axes, kind in zip(row, kinds, strict=True):
            chosen = np.isin(result.ground.values, ("flat", kind))
            _curves(axes, result.sel(grasp=grasp).isel(obstacle=np.flatnonzero(chosen)).sortby("size"))
        row[0].set_ylabel(f"FLSS, grasp {grasp:g}")
    for axes, kind in zip(panels[-1], kinds, strict=True):
        axes.set_xlabel(SIZES[kind])
    panels[0, 0].legend(frameon=False, fontsize=9, loc="upper left")
    conditions = result.attrs["conditions"]
    figure.suptitle(
        f"Falls once the obstacle has been reached, of {result.sizes['start']} starts; $V_p$ = {conditions['vp']:g}"
        f" mm/s, standing height {conditions['standing_height']:g} mm, with 95 % intervals",
        fontsize=10,
    )
    return figure


def _curves(axes: "Axes", one: "xr.Dataset") -> None:
    """FLSS against size, (obstacle, velocity), with its intervals side by side."""
    sizes, count = one["size"].values, one.sizes["velocity"]
    shifts = (np.arange(count) - (count - 1) / 2) * 0.02 * sizes.max()
    for v, colour, shift in zip(one.velocity.values, COLOURS * count, shifts, strict=False):
        frequency_curve(axes, sizes + shift, one.sel(velocity=v), "flss", color=colour, label=f"V = {v:g}")
    axes.set(ylim=(-0.02, 1.02))
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    tidy(axes)
