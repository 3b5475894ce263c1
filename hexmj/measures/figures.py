"""FLSS against velocity as figures, and what other figures share with them."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.literal import in_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURE_COLOURS = {"kinematic": "#1b6ca8", "measured": "#e08e1b", "physical": "#b3261e"}
CONTROLLER_LINES = ("-", "--", ":", "-.")
CONTROLLER_MARKERS = ("o", "s", "^", "D")


def comparison_figure(result: "xr.Dataset") -> "Figure":
    """FLSS against velocity, every measure and controller with its 95 % intervals, from `compare.compare`."""
    figure, axes = _flss_axes(7.2, 4.6)
    shift = 0.004
    styles: list[Any] = list(zip(CONTROLLER_LINES, CONTROLLER_MARKERS, strict=True)) * result.sizes["controller"]
    for (line, marker), name in zip(styles, result.controller.values, strict=False):
        one = result.sel(controller=name)
        for offset, (measure, colour) in zip((-shift, 0.0, shift), MEASURE_COLOURS.items(), strict=True):
            low, middle, high = (one[measure + end].values for end in ("_low", "", "_high"))
            axes.errorbar(
                one.velocity + offset, middle, [middle - low, high - middle],
                color=colour, linestyle=line, marker=marker, markersize=4, capsize=2.5, linewidth=1.6,
                label=f"{in_figure(name)}, {measure}",
            )  # fmt: skip
    axes.legend(frameon=False, fontsize=9)
    conditions = result.attrs["conditions"]
    axes.set_title(
        "Loss of static stability on paper (kinematic), under the feet (measured), and falls (physical)\n"
        f"{result.sizes['start']} starts, window {result.attrs['window']}, $V_p$ = {conditions['vp']:g} mm/s,"
        f" step height {conditions['step_height']:g} mm, standing height {conditions['standing_height']:g} mm,"
        f" friction {conditions['friction']:g}",
        fontsize=9,
    )
    return figure


def flss_figure(table: "xr.Dataset", title: str) -> "Figure":
    """One curve of FLSS against velocity with its 95 % intervals, from `kinematic.frequency_table`."""
    figure, axes = _flss_axes(6.4, 4.2)
    error = [table.flss - table.low, table.high - table.flss]
    axes.errorbar(table.velocity, table.flss, error, marker="o", markersize=4, capsize=2.5, color="#1b6ca8")
    axes.set_title(in_figure(title), fontsize=10)
    return figure


def spans(time: np.ndarray, on: np.ndarray) -> list[tuple[float, float]]:
    """Begin and length of each stretch of time in which `on`, (step,), holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    step = time[1] - time[0] if len(time) > 1 else 0.0
    return [(float(time[a] - step), float((b - a) * step)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _flss_axes(width: float, height: float) -> "tuple[Figure, Axes]":
    """A figure of FLSS against velocity, with nothing in it yet; its size in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.subplots()
    axes.set(xlabel="velocity $V_r / V_p$", ylabel="FLSS", ylim=(-0.02, 1.02), xlim=(0.0, 1.0))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)
    return figure, axes
