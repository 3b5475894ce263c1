"""The static limit as a figure: FLSS, agreement and distances from the plan against V_p."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.captions import caption
from hexmj.measures.drawable_parts import check_starts
from hexmj.measures.figures import MEASURE_COLOURS, frequency_curve, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

COLOURS = MEASURE_COLOURS | {"grounded": "#46a35e"}

LINES = ("-", "--", ":", "-.", (0, (6, 1, 1, 1, 1, 1)), (0, (1, 3)))
"""Of the masses of the legs in turn."""

BESIDE = 1.03
"""By what factor of V_p points of the first and the last of several masses stand aside, so that all are seen."""

MARKERS = {
    "measured": "s",
    "grounded": "D",
    "physical": "^",
    "centre of pressure": "v",
    "measured, same feet stand": "o",
}
"""Of what is told in the legends."""

ABOVE: dict[str, Any] = {
    "loc": "lower left",
    "bbox_to_anchor": (0.0, 1.0),
    "frameon": False,
    "fontsize": 8,
    "handlelength": 1.6,
    "handletextpad": 0.5,
    "columnspacing": 1.2,
    "ncols": 2,
}
"""Where a legend lies on no point."""

PANELS = {  # label of the axis, then for each curve its colour and name
    "agreement": (
        "starts whose answer is the kinematic one",
        {
            "agreement_measured": (COLOURS["measured"], "measured"),
            "agreement_grounded": (COLOURS["grounded"], "grounded"),
            "agreement": (COLOURS["physical"], "physical"),
        },
    ),
    "margin": (
        "distance from the planned margin [mm]",
        {
            "margin_pressure": ("0.6", "centre of pressure"),
            "margin": (COLOURS["measured"], "measured"),
            "margin_grounded": (COLOURS["grounded"], "grounded"),
            "margin_same_feet": ("#6a4c93", "measured, same feet stand"),
        },
    ),
    "drift": ("centre of mass from O [mm]", {"drift": ("#1b6ca8", "")}),
}


def static_limit_figure(result: "xr.Dataset") -> "Picture":
    """Four panels against V_p, a kind of line for each mass of the legs, from `StaticLimit`."""
    from matplotlib.lines import Line2D

    from hexmj.pictures import head, picture

    check_starts(result)
    figure = picture(9.6, 7.6)
    axes = dict(zip(("flss", *PANELS), figure.subplots(2, 2, sharex=True).ravel(), strict=True))
    masses = result.leg_mass.values
    lines: dict[float, Any] = dict(zip(masses, LINES * len(masses), strict=False))
    shifts = np.geomspace(1.0 / BESIDE, BESIDE, len(masses)) if len(masses) > 1 else np.ones(len(masses))
    for (mass, line), shift in zip(lines.items(), shifts, strict=True):
        one, first = result.sel(leg_mass=mass).sortby("vp"), mass == masses[0]
        _frequencies(axes["flss"], one, line, shift, first)
        for panel, (_, curves) in PANELS.items():
            for name, (colour, label) in curves.items():
                values = one[name] if panel == "agreement" else one[name].mean("start")
                style = {"color": colour, "marker": MARKERS.get(label, "o"), "markersize": 4.5, "linewidth": 1.6}
                axes[panel].plot(one.vp, values, linestyle=line, label=label if first and label else None, **style)
    axes["flss"].set(ylabel="FLSS")
    for panel, (label, _) in PANELS.items():
        axes[panel].set(ylabel=label)
    for panel, one in axes.items():
        if panel in ("flss", "agreement"):
            one.set(ylim=(-0.02, 1.02))
        else:
            one.update_datalim([(0.0, 0.0)], updatex=False)  # so that the margin above is of the whole height
            one.autoscale_view(scalex=False)
            one.set(ylim=(0.0, None), xlabel="$V_p$ [mm/s]; slow walks on the left")
        _v_axis(one, result)
    handles = [Line2D([], [], color="0.1", linestyle=line, label=f"legs' mass x {m:g}") for m, line in lines.items()]
    axes["drift"].legend(handles=handles, **ABOVE)
    head(figure, f"As $V_p$ goes to zero, V = {result.attrs['velocity']:g}, with 95 % intervals", caption(result))
    return figure


def _frequencies(axes: "Axes", one: "xr.Dataset", line: Any, shift: float, first: bool) -> None:
    """The FLSS at one mass of the legs, at so many times its V_p; the kinematic one, a band, depends on neither."""
    if first:
        low, middle, high = (one[f"kinematic{end}"].values[0] for end in ("_low", "", "_high"))
        axes.axhspan(low, high, color=MEASURE_COLOURS["kinematic"], alpha=0.15, linewidth=0)
        axes.axhline(middle, color=MEASURE_COLOURS["kinematic"], linewidth=1.6, label="kinematic")
    for measure in ("measured", "grounded", "physical"):
        style = {"linestyle": line, "color": COLOURS[measure], "marker": MARKERS[measure]}
        frequency_curve(axes, one.vp * shift, one, measure, label=measure if first else None, **style)


def _v_axis(axes: "Axes", result: "xr.Dataset") -> None:
    axes.set_xscale("log")
    axes.set_xticks(result.vp.values, [f"{vp:g}" for vp in result.vp.values])
    axes.minorticks_off()
    axes.set_xlim(0.85 * result.vp.values.min(), result.vp.values.max() / 0.85)
    tidy(axes)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(**ABOVE)
