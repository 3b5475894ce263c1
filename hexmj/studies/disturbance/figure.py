"""Disturbed walks as a figure: FLSS after the disturbance against velocity, a line for each strategy."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.studies.drawing import frequency_curve, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

COLOURS = {"none": "#b3261e", "reorganise": "#1b6ca8", "slow_down": "#2a9d5c", "grasp": "#e08e1b"}
"""Strategy -> colour."""
UNDISTURBED: dict[str, Any] = {"color": "0.15", "linestyle": ":", "linewidth": 1.4, "marker": "x", "markersize": 6}
ROWS = {"kinematic": "on paper (kinematic)", "physical": "falls (physical)"}
"""Measure -> what its row of panels is called."""


def disturbed_figure(result: "xr.Dataset") -> "Figure":
    """A column of panels for each disturbance, a row for each measure; window `whole`, from `DisturbedWalks`."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    names, strategies = result.disturbance.values, result.strategy.values
    kinds = list(dict.fromkeys(names[1:]))
    measures = [measure for measure in ROWS if measure in result]
    figure = Figure(figsize=(2.2 + 2.5 * len(kinds), 1.4 + 2.5 * len(measures)), layout="constrained")
    panels = figure.subplots(len(measures), len(kinds), sharex=True, sharey=True, squeeze=False)
    used = [strategy for strategy in COLOURS if strategy in strategies]
    shifts = dict(zip(used, np.linspace(-0.012, 0.012, len(used)), strict=True))
    one = result.sel(window="whole")
    for (row, column), axes in np.ndenumerate(panels):
        measure, kind = measures[row], kinds[column]
        if measure == "kinematic" and kind.startswith("push"):
            axes.axis("off")
            axes.text(0.5, 0.5, "a plan knows nothing\nof a push", transform=axes.transAxes, ha="center", color="0.4")
            continue
        axes.plot(one.velocity, one[measure].isel(case=0), **UNDISTURBED, zorder=5)
        for case in np.flatnonzero((names == kind) & ((strategies != "grasp") | (measure == "physical"))):
            strategy = strategies[case]
            x, colour = one.velocity + shifts[strategy], COLOURS[strategy]
            frequency_curve(axes, x, one.isel(case=case), measure, color=colour)
        axes.set(ylim=(-0.03, 1.03))
        tidy(axes)
    for column, kind in enumerate(kinds):
        panels[0, column].set_title(_title(kind), fontsize=10)
        panels[-1, column].set_xlabel("velocity $V_r / V_p$")
    for row, measure in enumerate(measures):
        panels[row, 0].set_ylabel(f"FLSS {ROWS[measure]}", fontsize=9)
    entries = [Line2D([], [], color=COLOURS[one], marker="o", label=one.replace("_", " ")) for one in used]
    entries.append(Line2D([], [], **UNDISTURBED, label="undisturbed"))
    figure.legend(handles=entries, frameon=False, fontsize=9, loc="outside right center", title="strategy")
    figure.suptitle(
        f"After a disturbance in mid-walk: {result.sizes['start']} starts at each velocity, 95 % intervals", fontsize=10
    )
    return figure


def _title(disturbance: str) -> str:
    kind, _, impulse = disturbance.partition(" ")
    return {"halt": "body halted", "leg": "one leg stopped"}.get(kind, f"push of {impulse} $m V_p$")
