"""Figures 2-6 in the paper's layout.

Each function takes measurements by name, see `reproduce.measure`, and returns a figure and the data drawn in it.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.figures import TIMES
from hexmj.measures.tables import VELOCITY
from hexmj.paper.measurements import NO_SET
from hexmj.paper.quantities import kept, main_peak
from hexmj.phases import circular_mean, wilson_phase
from hexmj.plotting import SERIES, head, picture
from hexmj.timing import OBSERVATION_TIMES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

Measurements = Mapping[str, "xr.Dataset"]
"""Name of each measurement, a key of `protocol.MEASUREMENTS` -> its data, with the axis `velocity`."""

SAMPLES = 7
"""Number of samples of starts, whose mean FLSS and standard deviation are drawn."""

RELATIVE = {2: "o", 3: "s"}
"""Legs whose phases relative to leg 1 are drawn -> their symbols."""

UNCOORDINATED, IDEAL = "#7a7a7a", "#111111"
HWS, LDVS, ACCELERATED = (style["color"] for style in SERIES[:3])
MODELS = {"hws": HWS, "ldvs": LDVS}

CIRCLES: dict[str, Any] = {"color": UNCOORDINATED, "marker": "o", "markerfacecolor": "white", "markersize": 6}
BARS: dict[str, Any] = {"marker": "_", "markersize": 7, "markeredgewidth": 1.5}
IDEALS: dict[str, Any] = {"color": IDEAL, "marker": "x", "linestyle": "none", "markersize": 6.5, "markeredgewidth": 1.5}

CURVES: dict[int, dict[str, tuple[str, dict[str, Any]]]] = {
    2: {"uncoordinated": ("no coordination", CIRCLES), "ideal": ("HWS, optimised for each $V$", BARS | {"color": HWS})},
    3: {
        "uncoordinated": ("no coordination", CIRCLES),
        "hws": ("HWS", {"color": HWS, "marker": "+", "markersize": 9, "markeredgewidth": 1.5}),
        "ideal": ("ideal", IDEALS),
        "hws accelerated": ("HWS, accelerated", BARS | {"color": ACCELERATED}),
    },
    4: {
        "uncoordinated": ("no coordination", CIRCLES),
        "ldvs": ("LDVS", BARS | {"color": LDVS}),
        "ideal": ("ideal", IDEALS),
        "ldvs accelerated": ("LDVS, accelerated", {"color": ACCELERATED, "marker": "*", "markersize": 9}),
    },
}
"""Number of an FLSS figure -> names of its measurements -> label and line style, with the paper's symbols."""


def phase_figure(measured: Measurements, model: str) -> "tuple[Figure, xr.Dataset]":
    """Draw the phases of legs 2 and 3 relative to leg 1: a dot for each stable gait, a line through the main peaks.

    The figure of LDVS also shows the phases of Wilson's Gait II as crosses.
    """
    import xarray as xr

    gaits, colour = measured[f"{model} gaits"], MODELS[model]
    v = gaits.velocity.values
    phase = np.full((len(RELATIVE), len(v), gaits.sizes["start"]), np.nan)  # (leg, velocity, start)
    peak = np.full((len(RELATIVE), len(v)), np.nan)
    for i, at in enumerate(v):
        phases = kept(gaits.sel(velocity=at)).phase
        second = phases.sel(pair="1-2").values
        for row, values in enumerate((second, (second + phases.sel(pair="2-3").values) % 1.0)):
            phase[row, i, : len(values)] = values
            if len(values):
                peak[row, i] = circular_mean(values[main_peak(values)])
    dims = ("leg", "velocity")
    data = xr.Dataset(
        {"phase": ((*dims, "gait"), phase, {"units": "1"}), "main_peak": (dims, peak, {"units": "1"})},
        {"velocity": ("velocity", v, VELOCITY), "leg": list(RELATIVE)},
    )
    figure = picture(6.4, 4.6)
    axes = figure.subplots()
    for row, (leg, marker) in enumerate(RELATIVE.items()):
        axes.plot(np.repeat(v, phase.shape[2]), phase[row].ravel(), ".", color=colour, markersize=4, alpha=0.25,
                  label="single starts" if row == 0 else None)  # fmt: skip
        label = f"leg {leg} relative to leg 1"
        axes.plot(v, peak[row], color=colour, marker=marker, markersize=5, linewidth=1.3, label=label)
    if model == "ldvs":
        data["wilson"] = (dims, np.array([wilson_phase(v), 2 * wilson_phase(v) - 1]), {"units": "1"})
        for leg, label in zip(RELATIVE, ("Gait II (Wilson)", None), strict=True):
            axes.plot(v, data.wilson.sel(leg=leg), "x", color=IDEAL, markersize=8, zorder=3, label=label)
    axes.set(xlabel="velocity $V$", ylabel="relative phase", xlim=(0, 1), ylim=(0, 1))
    ends = ", ".join(f"{peak[0, n]:.2f} at V = {v[n]:g}" for n in (0, -1))
    starts = f"phases of stable steady-state gaits; {gaits.sizes['start']} starts at each V; lines: main peaks"
    head(figure, f"{model.upper()}: phase of leg 2 is {ends}", starts)
    axes.legend(frameon=False, fontsize=10)
    return figure, data


def flss_figure(measured: Measurements, number: int, observation_time: str) -> "tuple[Figure, xr.Dataset]":
    """Draw FLSS against velocity (Figs. 2-4): means of `SAMPLES` samples of starts, with their standard deviations."""
    import xarray as xr

    figure, curves = picture(6.4, 4.6), CURVES[number]
    axes = figure.subplots()
    every = [measured[name].lost.sel(observation_time=observation_time) for name in curves]
    lost: Any = xr.concat(every, xr.DataArray(list(curves), dims="curve", name="curve"), combine_attrs="drop")
    means = lost.values.reshape(*lost.shape[:2], SAMPLES, -1).mean(axis=3)  # (curve, velocity, sample)
    means[(lost.values == NO_SET).any(axis=2)] = np.nan
    columns = {"flss": means.mean(axis=2), "sample_sd": means.std(axis=2, ddof=1)}
    table = {name: (("curve", "velocity"), values, {"units": "1"}) for name, values in columns.items()}
    size = {"samples": f"{SAMPLES} of {lost.sizes['start'] // SAMPLES} starts"}
    data = xr.Dataset(table, {"velocity": lost.velocity, "curve": lost.curve}, size)
    for name, (label, style) in curves.items():
        one = data.sel(curve=name).dropna("velocity")
        look: dict[str, Any] = {"linewidth": 1.3, "capsize": 3} | style
        label += "" if one.sizes["velocity"] else ": not yet searched"
        axes.errorbar(one.velocity, one.flss, one.sample_sd, label=label, **look)
    axes.set(xlabel="velocity $V$", ylabel="kinematic FLSS", xlim=(0, 1), ylim=(-0.02, 1.04))
    shown = f"observation time: {TIMES[observation_time]}; samples: {data.attrs['samples']}"
    head(figure, f"Fig. {number}: kinematic FLSS over velocity", shown, "bars: standard deviations")
    axes.legend(frameon=False, fontsize=10)
    return figure, data


Draw = Callable[[Measurements], "tuple[Figure, xr.Dataset]"]  # draws a figure, returns it and its data

FIGURES: dict[str, tuple[tuple[str, ...], Draw]] = {
    **{
        f"figure-{number}-{observation_time}": (
            tuple(curves),
            partial(flss_figure, number=number, observation_time=observation_time),
        )
        for number, curves in CURVES.items()
        for observation_time in OBSERVATION_TIMES
    },
    "figure-5": (("hws gaits",), partial(phase_figure, model="hws")),
    "figure-6": (("ldvs gaits",), partial(phase_figure, model="ldvs")),
}
"""Name of each figure -> names of the measurements that it needs, and the function that draws it."""
