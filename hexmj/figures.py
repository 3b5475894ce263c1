"""Figures: FLSS against velocity, footfall diagram, stability margin.  Each function returns a matplotlib figure."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.legs import LEGS

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURE_COLOURS = {"kinematic": "#1b6ca8", "measured": "#e08e1b", "physical": "#b3261e"}
MODEL_LINES = ("-", "--", ":", "-.")


def comparison_figure(result: "xr.Dataset") -> "Figure":
    """FLSS against velocity, every measure and model with its 95 % intervals, from `comparison.compare`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    shift = 0.004
    for line, model in zip(MODEL_LINES * len(result.model), result.model.values, strict=False):
        one = result.sel(model=model)
        for offset, (measure, colour) in zip((-shift, 0.0, shift), MEASURE_COLOURS.items(), strict=True):
            low, middle, high = (one[measure + end].values for end in ("_low", "", "_high"))
            axes.errorbar(
                one.velocity + offset, middle, [middle - low, high - middle],
                color=colour, linestyle=line, marker="o", markersize=4, capsize=2.5, linewidth=1.6,
                label=f"{model}, {measure}",
            )  # fmt: skip
    _flss_axes(axes)
    axes.legend(frameon=False, fontsize=9)
    body, window = result.attrs["body"], result.attrs["window"]
    axes.set_title(
        "Loss of static stability on paper (kinematic), under the feet (measured), and falls (physical)\n"
        f"{result.sizes['start']} starts, window {window}, $V_p$ = {body['vp']:g} mm/s, step height"
        f" {body['step_height']:g} mm, standing height {body['standing_height']:g} mm, friction {body['friction']:g}",
        fontsize=9,
    )
    return figure


def flss_figure(table: "xr.Dataset", title: str) -> "Figure":
    """One curve of FLSS against velocity with its 95 % intervals, from `loss_frequency.frequency_table`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    error = [table.flss - table.low, table.high - table.flss]
    axes.errorbar(table.velocity, table.flss, error, marker="o", markersize=4, capsize=2.5, color="#1b6ca8")
    _flss_axes(axes)
    axes.set_title(title, fontsize=10)
    return figure


def walk_figure(recording: "xr.Dataset") -> "Figure":
    """Footfall diagram (bars are protraction) and stability margin over time, from a recording."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.8), layout="constrained")
    footfall, margin = figure.subplots(2, 1, sharex=True, height_ratios=(1.2, 1.0))
    time = recording.time.values
    physical = "measured_stance" in recording
    for row, leg in enumerate(LEGS):
        footfall.broken_barh(spans(time, ~recording.planned_stance.values[:, row]), (row - 0.38, 0.76), color="0.15")
        if physical:
            off = ~recording.measured_stance.values[:, row] & np.isfinite(recording.measured_x.values[:, row])
            footfall.broken_barh(spans(time, off), (row + 0.2, 0.18), color=MEASURE_COLOURS["measured"])
        footfall.text(-0.01, row, leg, transform=footfall.get_yaxis_transform(), ha="right", va="center", fontsize=9)
    footfall.set(ylim=(5.6, -0.6), yticks=[], title=recording.attrs.get("title", ""))
    legend = "black: protraction" + (", orange: foot off the ground" if physical else "")
    footfall.set_xlabel(legend, fontsize=8)
    margin.axhline(0.0, color="0.6", linewidth=0.8)
    margin.plot(time, recording.planned_margin, color=MEASURE_COLOURS["kinematic"], linewidth=1.2, label="planned")
    if physical:
        measured = np.where(np.isfinite(recording.measured_margin), recording.measured_margin, np.nan)
        margin.plot(time, measured, color=MEASURE_COLOURS["measured"], linewidth=1.0, label="measured")
        if np.isfinite(fall := float(recording.fall_time)):
            margin.axvline(fall, color=MEASURE_COLOURS["physical"], linewidth=1.4, label="trunk on the ground")
    margin.set(xlabel="time [time units of the network]", ylabel="stability margin [mm]", xlim=(0.0, time[-1]))
    margin.legend(frameon=False, fontsize=8, loc="lower right", ncols=3)
    for axes in (footfall, margin):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _flss_axes(axes: "Axes") -> None:
    axes.set(xlabel="velocity $V_r / V_p$", ylabel="FLSS", ylim=(-0.02, 1.02), xlim=(0.0, 1.0))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)


def spans(time: np.ndarray, on: np.ndarray) -> list[tuple[float, float]]:
    """Begin and length of each stretch of time in which `on`, (step,), holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    step = time[1] - time[0] if len(time) > 1 else 0.0
    return [(float(time[a] - step), float((b - a) * step)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
