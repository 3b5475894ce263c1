"""Figures 2-6 in the paper's layout, phase histograms (Section 5.3), and footfall diagrams at several velocities.

Each function takes measurements by name, see `reproduce.measure`, and returns a figure and the data drawn in it.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.legs import LEGS
from hexmj.measures.figures import TIMES
from hexmj.measures.tables import VELOCITY
from hexmj.paper.measurements import NO_SET
from hexmj.paper.quantities import kept, main_peak
from hexmj.phases import PAIRS, circular_mean, wilson_phase
from hexmj.plotting import SERIES, head, picture
from hexmj.timing import OBSERVATION_TIMES
from hexmj.walks import spans

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


def phase_histograms(measured: Measurements, model: str) -> "tuple[Figure, xr.Dataset]":
    """Draw histograms of the relative phases: a row for each pair of legs, a column for each of five velocities."""
    import xarray as xr

    gaits = measured[f"{model} gaits"]
    gaits = gaits.isel(velocity=np.unique(np.linspace(0, gaits.sizes["velocity"] - 1, 5).round().astype(int)))
    v, edges = gaits.velocity.values, np.linspace(0, 1, 52)  # odd number of bins: 0.5 is in the middle of one
    stable = [kept(gaits.sel(velocity=at)).phase for at in v]
    counts = np.array([[np.histogram(one.sel(pair=pair), edges)[0] for pair in PAIRS] for one in stable])
    figure = picture(8.6, 7.4)
    panels = figure.subplots(len(PAIRS), len(v), sharex=True, sharey="row", squeeze=False)
    for (row, column), axes in np.ndenumerate(panels):
        axes.stairs(counts[column, row], edges, fill=True, color=MODELS[model])
        axes.set(xlim=(0, 1), ylim=(0, 1.15 * max(1, counts.max())), xticks=(0, 0.5, 1))
        axes.xaxis.set_major_formatter("{x:g}")
    for axes, at, one in zip(panels[0], v, stable, strict=True):
        axes.set_title(f"$V$ = {at:g}\n{one.sizes['start']} stable gaits", fontsize=10)
    for axes, pair in zip(panels[:, 0], PAIRS, strict=True):
        axes.set_ylabel(f"$\\Phi$ {pair}", rotation=0, ha="right", va="center", fontsize=12)
    head(
        figure,
        f"{model.upper()}: relative phases of its stable steady-state gaits",
        "legs 1 to 3 left, 4 to 6 right, from front to rear",
    )
    figure.supxlabel("relative phase", fontsize=11)
    figure.supylabel("number of starts", fontsize=11)
    middle = (edges[:-1] + edges[1:]) / 2, {"units": "1", "long_name": "relative phase"}
    coordinates = {"velocity": ("velocity", v, VELOCITY), "pair": list(PAIRS), "bin": ("bin", *middle)}
    return figure, xr.Dataset({"starts": (("velocity", "pair", "bin"), counts, {"units": "1"})}, coordinates)


def footfall_diagrams(measured: Measurements, model: str) -> "tuple[Figure, xr.Dataset]":
    """Draw the protraction of each leg as bars over three periods of a single leg, for each velocity."""
    data = measured[f"{model} footfall"]
    figure = picture(7.2, 1.35 * data.sizes["velocity"] + 0.5)
    panels = figure.subplots(data.sizes["velocity"], 1, sharex=True, squeeze=False)[:, 0]
    time = data.time.values
    for axes, v in zip(panels, data.velocity.values, strict=True):
        stance = data.stance.sel(velocity=v).values.astype(bool)
        for row in range(len(LEGS)):
            colour = MODELS[model] if row < 3 else "0.2"
            axes.broken_barh(spans(time, ~stance[:, row]), (row - 0.36, 0.72), color=colour)
        axes.set(ylim=(5.6, -0.6), xlim=(time[0], time[-1]), yticks=range(len(LEGS)), yticklabels=LEGS)
        axes.tick_params(axis="y", length=0, labelsize=9)
        axes.axhline(2.5, color="0.8", linewidth=0.8)
        axes.text(1.01, 0.5, f"$V$ = {v:g}", transform=axes.transAxes, va="center", fontsize=11)
    head(figure, f"{model.upper()}: footfalls at {len(panels)} velocities", "L left, R right, 1 front, 3 hind")
    panels[-1].set_xlabel("time [periods of a single leg, $20\\,(1 + 1/V)$];  bars: protraction")
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
    model = list(curves)[1]
    lower = _where(data.velocity.values, (data.flss.sel(curve=model) < data.flss[0]).values)
    shown = f"Fig. {number}; observation time: {TIMES[observation_time]}; samples: {data.attrs['samples']}"
    head(
        figure, f"{curves[model][0]}: lower FLSS than without coordination {lower}", shown, "bars: standard deviations"
    )
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
    **{f"phases-{model}": ((f"{model} gaits",), partial(phase_histograms, model=model)) for model in MODELS},
    **{f"footfall-{model}": ((f"{model} footfall",), partial(footfall_diagrams, model=model)) for model in MODELS},
}
"""Name of each figure -> names of the measurements that it needs, and the function that draws it."""


def _where(v: np.ndarray, holds: np.ndarray) -> str:
    """Return in words at which of the increasing velocities, (velocity,), something holds, such as "at V = 0.5"."""
    rows, at = np.flatnonzero(holds), [f"{velocity:g}" for velocity in v[holds]]
    text = f"at V = {', '.join(at)}" if at else "at no V"
    if len(at) > 1 and rows[-1] - rows[0] == len(rows) - 1:
        text = f"from V = {at[0]} " + (f"to {at[-1]}" if rows[-1] < len(v) - 1 else "on")
    return text.replace(" ", "\N{NO-BREAK SPACE}", 5)
