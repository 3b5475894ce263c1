"""Disturbed walks as a figure: FLSS after the disturbance against velocity, a line for each strategy."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.measures.captions import caption_of_at_least
from hexmj.measures.drawable_parts import check_starts
from hexmj.measures.figures import frequency_curve, tidy, velocity_ticks
from hexmj.studies.disturbance.cases import NO_DISTURBANCE
from hexmj.studies.disturbance.study import strategies_in_words

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.pictures import Picture

STYLES: dict[str, dict[str, Any]] = {
    "none": {"color": "#b3261e", "marker": "o", "linestyle": "-"},
    "reorganise": {"color": "#1b6ca8", "marker": "s", "linestyle": "--"},
    "slow_down": {"color": "#2a9d5c", "marker": "^", "linestyle": "-."},
    "grasp": {"color": "#e08e1b", "marker": "D", "linestyle": (0, (5, 1))},
}
"""Of the strategies."""
UNDISTURBED: dict[str, Any] = {"color": "0.15", "linestyle": ":", "linewidth": 1.4, "marker": "x", "markersize": 6}
BESIDE = 0.05
"""Room on both sides of the velocities."""

ROWS = {"kinematic": "on paper (kinematic)", "physical": "falls (physical)"}
"""Measure -> what its row of panels is called."""


def disturbed_figure(result: "xr.Dataset") -> "Picture":
    """A column of panels for each disturbance, a row for each measure; observation time `whole`, from `DisturbedWalks`."""
    from matplotlib.lines import Line2D

    from hexmj.pictures import head, picture

    check_starts(result)
    names, strategies = result.disturbance.values, result.strategy.values
    kinds, undisturbed = list(dict.fromkeys(names[names != NO_DISTURBANCE])), names == NO_DISTURBANCE
    measures = [measure for measure in ROWS if measure in result]
    figure = picture(2.6 + 2.5 * len(kinds), 1.6 + 2.5 * len(measures))
    panels = figure.subplots(len(measures), len(kinds), sharex=True, sharey=True, squeeze=False)
    used = [strategy for strategy in STYLES if strategy in strategies]
    shifts = dict(zip(used, np.linspace(-0.012, 0.012, len(used)), strict=True))
    one = result.sel(observation_time="whole").sortby("velocity")
    for (row, column), axes in np.ndenumerate(panels):
        measure, kind = measures[row], kinds[column]
        if measure == "kinematic" and kind.startswith("push"):
            axes.axis("off")
            axes.text(0.5, 0.5, "a plan knows nothing\nof a push", transform=axes.transAxes, ha="center", color="0.4")
            continue
        for case in np.flatnonzero(undisturbed):
            axes.plot(one.velocity, one[measure].isel(case=case), **UNDISTURBED, zorder=5)
        for case in np.flatnonzero((names == kind) & ((strategies != "grasp") | (measure == "physical"))):
            strategy = strategies[case]
            x = one.velocity + shifts[strategy]
            frequency_curve(axes, x, one.isel(case=case), measure, **STYLES[strategy])
        v = one.velocity.values
        velocity_ticks(axes, v)
        axes.set(xlim=(v.min() - BESIDE, v.max() + BESIDE), ylim=(-0.03, 1.03))
        tidy(axes)
    for column, kind in enumerate(kinds):
        panels[0, column].set_title(_title(kind), fontsize=10)
        panels[-1, column].set_xlabel("velocity $V_r / V_p$")
    for row, measure in enumerate(measures):
        panels[row, 0].set_ylabel(f"FLSS, {ROWS[measure]}")
    entries = [Line2D([], [], markersize=4, label=one.replace("_", " "), **STYLES[one]) for one in used]
    entries += [Line2D([], [], **UNDISTURBED, label="undisturbed")] if undisturbed.any() else []
    least = min(int(one[f"{measure}_reached"].min()) for measure in measures)
    figure.legend(handles=entries, frameon=False, fontsize=9, loc="outside right center", title="strategy")
    told = "; ".join(filter(None, [caption_of_at_least(least, result), strategies_in_words(result)]))
    head(figure, "FLSS after a disturbance in mid-walk, with 95 % intervals", told)
    return figure


def _title(disturbance: str) -> str:
    kind, _, impulse = disturbance.partition(" ")
    return {"halt": "body halted", "leg": "one leg stopped"}.get(kind, f"push of {impulse} $m V_p$")
