"""A recording as a figure: footfall diagram and stability margin."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES, in_figure
from hexmj.walks import spans

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def walk_figure(recording: "xr.Dataset") -> "Figure":
    """Draw the footfall diagram and the stability margin of a recording over time.

    The bars are those of its film: a foot off the ground, or a protraction of a puppet.

    Args:
        recording: whole or some consecutive steps of it.
    """
    from hexmj.plotting import picture

    figure = picture(8.0, 4.8)
    footfall, margin = figure.subplots(2, 1, sharex=True, height_ratios=(1.2, 1.0))
    time, planned = recording.time.values, recording.planned_stance.values
    physical = "measured_stance" in recording
    stance = recording.measured_stance.values if physical else planned
    shown = np.isfinite(recording.qpos.values).all(axis=1)  # False after a fall
    blue, red = (MEASURE_STYLES[measure]["color"] for measure in ("kinematic", "physical"))
    for row, leg in enumerate(LEGS):
        off = spans(time, ~stance[:, row] & shown)
        footfall.broken_barh(off, (row - 0.38, 0.56 if physical else 0.76), color="0.15")
        if physical:
            footfall.broken_barh(spans(time, ~planned[:, row]), (row + 0.2, 0.18), color=blue)
        footfall.text(-0.01, row, leg, transform=footfall.get_yaxis_transform(), ha="right", va="center", fontsize=9)
    footfall.set(ylim=(5.6, -0.6), yticks=[], title=in_figure(recording.attrs["title"]))
    legend = "thick, black: foot off ground; thin, blue: planned protraction" if physical else "bars: protraction"
    footfall.set_xlabel(legend, fontsize=8)
    margin.axhline(0.0, color="0.6", linewidth=0.8)
    margin.plot(time, recording.planned_margin, color=blue, linewidth=1.2, label="planned")
    if physical:
        measured = np.where(np.isfinite(recording.measured_margin), recording.measured_margin, np.nan)
        margin.plot(time, measured, color="0.15", linewidth=1.0, label="measured")
        if (fall := float(recording.fall_time)) <= time[-1]:
            margin.axvline(fall, color=red, linewidth=1.4, label="trunk on the ground")
    margin.set(xlabel="time [time units]", ylabel="stability margin [mm]", xlim=(0.0, time[-1]))
    figure.legend(frameon=False, fontsize=8, loc="outside lower center", ncols=3)
    for axes in (footfall, margin):
        axes.spines[["top", "right"]].set_visible(False)
    return figure
