"""A recording as a figure: which feet are off the ground, as in films, and the stability margin."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.diagrams import spans
from hexmj.errors import InputError
from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES, in_figure
from hexmj.replay.schema import ROUNDING

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def walk_figure(recording: "xr.Dataset") -> "Figure":
    """Footfall diagram and stability margin over time, from a recording or an even share of its steps.

    The bars are those of its film: a foot off the ground, or a protraction where a puppet shows the plan.

    Raises:
        InputError: no steps, or some that do not follow one another evenly.
    """
    from hexmj.plotting import picture

    if not recording.sizes["step"]:
        raise InputError(f"the recording {recording.attrs['title']!r} holds no steps; expected at least one")
    steps = np.diff(recording.time.values)
    if not (np.allclose(steps, steps[:1], ROUNDING, 0.0) and (steps > 0).all()):
        raise InputError(
            f"the recording {recording.attrs['title']!r} has steps of {steps.min():g} to {steps.max():g} time units;"
            " expected one step after the other, all of one length"
        )
    recording = recording.sel(leg=list(LEGS))
    figure = picture(8.0, 4.8)
    footfall, margin = figure.subplots(2, 1, sharex=True, height_ratios=(1.2, 1.0))
    time = recording.time.values
    physical = "measured_stance" in recording
    planned = recording.planned_stance.values
    stance = recording.measured_stance.values if physical else planned
    shown = np.isfinite(recording.qpos.values).all(axis=1)  # not after a fall
    for row, leg in enumerate(LEGS):
        off = spans(time, ~stance[:, row] & shown)
        footfall.broken_barh(off, (row - 0.38, 0.56 if physical else 0.76), color="0.15")
        if physical:
            swings = spans(time, ~planned[:, row])
            footfall.broken_barh(swings, (row + 0.2, 0.18), color=MEASURE_STYLES["kinematic"]["color"])
        footfall.text(-0.01, row, leg, transform=footfall.get_yaxis_transform(), ha="right", va="center", fontsize=9)
    footfall.set(ylim=(5.6, -0.6), yticks=[], title=in_figure(recording.attrs["title"]))
    legend = "thick, black: foot off ground; thin, blue: planned protraction" if physical else "bars: protraction"
    footfall.set_xlabel(legend, fontsize=8)
    margin.axhline(0.0, color="0.6", linewidth=0.8)
    mark = {"marker": "o", "markersize": 3} if len(time) == 1 else {}  # a line through one point is none
    blue = {"color": MEASURE_STYLES["kinematic"]["color"], "linewidth": 1.2, "label": "planned"}
    margin.plot(time, recording.planned_margin, **blue, **mark)
    if physical:
        measured = np.where(np.isfinite(recording.measured_margin), recording.measured_margin, np.nan)
        margin.plot(time, measured, color="0.15", linewidth=1.0, label="measured", **mark)
        if (fall := float(recording.fall_time)) <= time[-1]:
            margin.axvline(fall, color=MEASURE_STYLES["physical"]["color"], linewidth=1.4, label="trunk on the ground")
    margin.set(xlabel="time [time units]", ylabel="stability margin [mm]", xlim=(0.0, time[-1]))
    figure.legend(frameon=False, fontsize=8, loc="outside lower center", ncols=3)
    for axes in (footfall, margin):
        axes.spines[["top", "right"]].set_visible(False)
    return figure
