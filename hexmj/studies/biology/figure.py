"""The animal beside the machine as a figure: ours as dots with their starts' spread, the animals' ranges as bands."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.measures.captions import caption
from hexmj.measures.drawable_parts import check_starts
from hexmj.measures.figures import tidy
from hexmj.phases import unrolled
from hexmj.studies.biology.animals import ANIMALS
from hexmj.studies.biology.names import JOINTS, PHASES, SEGMENTS
from hexmj.studies.biology.study import walked

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

OURS, INSECTS = "#1b6ca8", "#e08e1b"
COLOURS = ("#1b6ca8", "#2a9d5c", "#6a4c93")
"""Of directions or joints in turn."""

OVER_SPEED = {
    "phase, ipsilateral": "ipsilateral phase",
    "duty factor": "duty factor",
    "period": "period [s]",
    "ripple: least over mean speed": "least over mean speed",
}
"""Quantity -> label of its axis."""

BARS = {
    "force on both legs [% of the weight]": ("vertical impulse", "fore-aft impulse", "inward impulse"),
    "torque of a standing leg [mN mm]": tuple(f"{joint} torque" for joint in JOINTS),
}
"""Label of an axis -> what stands side by side there for each pair of legs."""


def biology_figure(result: "xr.Dataset") -> "Picture":
    """Two panels over the pairs of legs, means of a stride and of its stance; four over speed; from `Biology`."""
    from hexmj.pictures import head, picture

    check_starts(result)
    figure = picture(11.0, 6.4)
    axes = figure.subplots(2, 3).ravel()
    for panel, (label, names) in zip(axes[:2], BARS.items(), strict=True):
        _bars(panel, result.value.sel(speed=24.0), names)
        panel.set_ylabel(label)
    for panel, (name, label) in zip(axes[2:], OVER_SPEED.items(), strict=True):
        _over_speed(panel, result.value.sel(quantity=name), name)
        panel.set(ylabel=label, xlabel="speed [mm/s]")
    axes[2].legend(frameon=False, fontsize=9)
    fewer = [f"{n} at {speed:g}" for speed, n in walked(result).items() if n < result.sizes["start"]]
    told = "; ".join([caption(result), *([f"whole strides of {', '.join(fewer)} mm/s"] if fewer else [])])
    spread = ", with standard deviations" if walked(result)[24.0] > 1 else ""
    head(figure, f"The walking insect beside measured ones; bars at 24 mm/s{spread}", told)
    return figure


def _bars(axes: "Axes", values: "xr.DataArray", names: tuple[str, ...]) -> None:
    """Means over the starts, (quantity, start), a group for each pair of legs."""
    for n, (name, colour) in enumerate(zip(names, COLOURS, strict=True)):
        one = values.sel(quantity=[f"{name}, {segment}" for segment in SEGMENTS])
        places = np.arange(len(SEGMENTS)) + (n - 1) * 0.27
        label = name.removesuffix(" impulse").removesuffix(" torque")
        axes.bar(places, one.mean("start"), 0.25, yerr=one.std("start", ddof=1), color=colour, capsize=2, label=label)
    axes.set_xticks(range(len(SEGMENTS)), [f"{segment} legs" for segment in SEGMENTS])
    axes.axhline(0.0, color="0.4", linewidth=0.8)
    axes.set_xlim(-0.55, len(SEGMENTS) - 0.45)  # also where a pair has no bars
    low, high = axes.get_ylim()
    axes.set_ylim(low, low + 1.35 * (high - low))  # room for the legend above the bars
    axes.legend(frameon=False, fontsize=9, loc="upper left")
    tidy(axes)
    axes.set_axisbelow(True)


def _over_speed(axes: "Axes", values: "xr.DataArray", name: str) -> None:
    """Ours, (speed, start), and the animals' ranges, at one speed or at any."""
    for row in ANIMALS:
        if row.quantity == name:
            ends = (row.speed - 0.4, row.speed + 0.4) if row.depends else (20.0, 40.0)
            axes.fill_between(ends, row.low, row.high, color=INSECTS, alpha=0.5, linewidth=0)
    dots = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2.5, "color": OURS}
    mean, deviation = values.mean("start"), values.std("start", ddof=1)
    if name in PHASES:
        beside = values.copy(data=np.apply_along_axis(unrolled, values.get_axis_num("start"), values.values))
        mean, deviation = beside.mean("start") % 1.0, beside.std("start", ddof=1)
    axes.errorbar(values.speed, mean, deviation, label="ours", **dots)
    axes.fill_between([], [], color=INSECTS, alpha=0.5, linewidth=0, label="insects")
    axes.set_xlim(20.0, 40.0)
    if name.startswith("ripple"):
        axes.set_ylim(min(0.0, axes.get_ylim()[0]), 1.0)
    tidy(axes)
