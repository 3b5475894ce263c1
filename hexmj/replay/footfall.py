"""A recording as a figure: which feet stand, and the stability margin."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.diagrams import spans
from hexmj.legs import LEGS
from hexmj.literal import in_figure
from hexmj.measures.figures import MEASURE_COLOURS

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.pictures import Picture


def walk_figure(recording: "xr.Dataset") -> "Picture":
    """Footfall diagram (bars are protraction) and stability margin over time, from a recording."""
    from hexmj.pictures import picture

    figure = picture(8.0, 4.8)
    footfall, margin = figure.subplots(2, 1, sharex=True, height_ratios=(1.2, 1.0))
    time = recording.time.values
    physical = "measured_stance" in recording
    for row, leg in enumerate(LEGS):
        footfall.broken_barh(spans(time, ~recording.planned_stance.values[:, row]), (row - 0.38, 0.76), color="0.15")
        if physical:
            off = ~recording.measured_stance.values[:, row] & np.isfinite(recording.measured_x.values[:, row])
            footfall.broken_barh(spans(time, off), (row + 0.2, 0.18), color=MEASURE_COLOURS["measured"])
        footfall.text(-0.01, row, leg, transform=footfall.get_yaxis_transform(), ha="right", va="center", fontsize=9)
    footfall.set(ylim=(5.6, -0.6), yticks=[], title=in_figure(recording.attrs["title"]))
    legend = "black: protraction" + (", orange: foot off the ground" if physical else "")
    footfall.set_xlabel(legend, fontsize=8)
    margin.axhline(0.0, color="0.6", linewidth=0.8)
    margin.plot(time, recording.planned_margin, color=MEASURE_COLOURS["kinematic"], linewidth=1.2, label="planned")
    if physical:
        measured = np.where(np.isfinite(recording.measured_margin), recording.measured_margin, np.nan)
        margin.plot(time, measured, color=MEASURE_COLOURS["measured"], linewidth=1.0, label="measured")
        if np.isfinite(fall := float(recording.fall_time)):
            margin.axvline(fall, color=MEASURE_COLOURS["physical"], linewidth=1.4, label="trunk on the ground")
    margin.set(xlabel="time [time units]", ylabel="stability margin [mm]", xlim=(0.0, time[-1]))
    margin.legend(frameon=False, fontsize=8, loc="lower right", ncols=3)
    for axes in (footfall, margin):
        axes.spines[["top", "right"]].set_visible(False)
    return figure
