"""FLSS against velocity as figures, and what other figures share with them."""

from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.literal import in_figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURE_COLOURS = {"kinematic": "#1b6ca8", "measured": "#e08e1b", "physical": "#b3261e", "toppled": "#6a4c93"}
BESIDE = 0.03
"""Width in V_r / V_p over which the points of one velocity stand beside each other."""

CONTROLLER_LINES = ("-", "--", ":", "-.")
CONTROLLER_MARKERS = ("o", "s", "^", "D")


def comparison_figure(result: "xr.Dataset", told: str = "") -> "Figure":
    """FLSS against velocity, every measure and controller with its 95 % intervals, from `compare.compare`.

    Args:
        result: of all starts, FLSS over (controller, velocity).
        told: stands in the title: window, conditions.
    """
    figure, axes = _flss_axes(7.2, 4.6)
    styles: list[Any] = list(zip(CONTROLLER_LINES, CONTROLLER_MARKERS, strict=True)) * result.sizes["controller"]
    beside = iter(np.linspace(-0.5, 0.5, len(MEASURE_COLOURS) * result.sizes["controller"]) * BESIDE)
    for (line, marker), name in zip(styles, result.controller.values, strict=False):
        one = result.sel(controller=name)
        for measure, colour in MEASURE_COLOURS.items():
            low, middle, high = (one[measure + end].values for end in ("_low", "", "_high"))
            axes.errorbar(
                one.velocity + next(beside), middle, [middle - low, high - middle],
                color=colour, linestyle=line, marker=marker, markersize=4, capsize=2.5, linewidth=1.6,
                label=f"{in_figure(name)}, {measure}",
            )  # fmt: skip
    axes.legend(frameon=False, fontsize=9)
    title = "Loss of static stability on paper (kinematic), under the feet (measured), and falls (physical)"
    axes.set_title(_in_lines(f"{title}\n{result.sizes['start']} starts; {told}", 104), fontsize=8.5)
    return figure


def flss_figure(table: "xr.Dataset", title: str) -> "Figure":
    """One curve of FLSS against velocity with its 95 % intervals, from `frequency.frequency_table`."""
    figure, axes = _flss_axes(6.4, 4.2)
    error = [table.flss - table.low, table.high - table.flss]
    axes.errorbar(table.velocity, table.flss, error, marker="o", markersize=4, capsize=2.5, color="#1b6ca8")
    axes.set_title(_in_lines(title, 96), fontsize=8.5)
    return figure


def _in_lines(title: str, width: int) -> str:
    """A title, its lines of at most so many characters."""
    return "\n".join(in_figure(line) for long in title.split("\n") for line in wrap(long, width))


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
