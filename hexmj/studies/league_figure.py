"""Figures of the league: losses and falls; trials, gaits and costs; and how well plans predict falls."""

from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hexmj.measures.figures import caption, starts_in_words
from hexmj.plotting import FEWER, LEGEND, MEASURE_STYLES, NOTHING, head, heat_map, in_figure, picture, tidy
from hexmj.studies.standings import ABOUT_TRIALS, MEASURES, by_rank, place

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

SHARE: dict[str, Any] = {"vmin": 0.0, "vmax": 1.0}
"""Options of the colour scale of fractions and phases: from 0 to 1."""

NOTES = (
    f"in brackets: rank by falls (=: shared); {FEWER} fewer starts, others diverged or out of reach; {NOTHING} unknown"
)
"""Explanation of the marks in the cells of the heat maps."""

NAMED = 0.08
"""Difference between FLDS and frequency of falls beyond which `prediction_figure` names an entrant."""


class Panel(NamedTuple):
    """A heat map with a row for each entrant."""

    title: str
    values: np.ndarray  # (entrant, column), shown as colours
    colours: str  # name of a colour map
    fewer: np.ndarray | bool  # (entrant, column), whether walks are missing
    ends: dict[str, Any]  # options of the colour scale


def league_figure(result: "xr.Dataset") -> "Figure":
    """Draw the frequencies of all `MEASURES`, with the lowest frequency of falls at the top."""
    shown = by_rank(result)
    missing = shown.missing.values > 0
    panels = []
    for name, title in MEASURES.items():
        starts, fewer = starts_in_words(shown[f"{name}_starts"].max().item()), name != "kinematic" and missing
        panels.append(Panel(f"{title}\n{starts}", shown[name].values, "YlOrRd", fewer, SHARE))
    first = shown.entrant.values[shown.best.sel(measure="physical").values == 1]
    finding = f"fewest falls over all velocities: {', '.join(first[:4])}" + " and others" * (len(first) > 4)
    figure, axes, images = _drawn(finding, shown, panels)
    figure.colorbar(images[0], ax=axes, location="bottom", label="share of the starts", fraction=0.03, aspect=80)
    return figure


def walks_figure(result: "xr.Dataset") -> "Figure":
    """Draw falls in trials, steady-state gaits and costs, with the lowest frequency of falls at the top."""
    shown = by_rank(result)
    few, missing = shown.fell_starts.values, shown.missing.values > 0
    some_are = (few > 0) & (few < few.max())
    trials = f"frequency of falls\nin trials, {starts_in_words(few.max())}"
    panels = [
        Panel(trials, shown.fell.values, "YlOrRd", some_are, SHARE),
        Panel("steady-state gaits:\nshare that is stable", shown.stable.values, "YlGn", False, SHARE),
        Panel("steady-state gaits: phase\nof legs on one side", shown.ipsilateral.values, "twilight", False, SHARE),
        Panel("energy cost of transport\nof walks without a fall", shown.cost.values, "PuBu", missing, {}),
    ]
    worst = shown.trial.values[np.nan_to_num(shown.fell.mean("entrant").values).argmax()]
    finding = f"the trial with most falls at V = {result.attrs['trial_velocity']:g} is '{worst}'"
    figure, axes, images = _drawn(finding, shown, panels, ABOUT_TRIALS)
    for ax, image, (*_, ends) in zip(axes, images, panels, strict=True):
        ticks = [0.0, 0.5, 1.0] if ends else None
        bar = figure.colorbar(image, ax=ax, location="bottom", ticks=ticks, fraction=0.03, aspect=25)
        bar.ax.tick_params(labelsize=9)
    axes[0].set_xticks(range(shown.sizes["trial"]), shown.trial.values, rotation=90, fontsize=9)
    axes[0].set_xlabel("")
    return figure


def prediction_figure(result: "xr.Dataset") -> "Figure":
    """Draw the frequency of falls against FLDS and kinematic FLSS near V = 0.5, with a point for each entrant."""
    at = result.sel(velocity=0.5, method="nearest")
    at = at.isel(entrant=np.flatnonzero(at.physical.notnull()))
    figure, falls = picture(7.0, 6.0), at.physical.values
    axes = figure.subplots()
    axes.axline((0.0, 0.0), slope=1.0, color="0.6", linewidth=1.0)
    away = {}
    for measure in ("kinematic", "dynamic"):
        style, filled = MEASURE_STYLES[measure], measure == "dynamic"
        look: Any = {"color": style["color"], "marker": style["marker"], "label": style["label"], "linestyle": "none"}
        axes.plot(at[measure], falls, **look, mfc=style["color"] if filled else "none", markersize=6)
        away[measure] = float(np.abs(at[measure].values - falls).mean())
    for name, x, y in zip(at.entrant.values, at.dynamic.values, falls, strict=True):
        if abs(x - y) > NAMED:
            beside: Any = {"xytext": (-7, -3), "ha": "right"} if x < y else {"xytext": (5, -12)}
            axes.annotate(in_figure(name), (x, y), textcoords="offset points", fontsize=9, **beside)
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    axes.set(xlabel="frequency of losses in the plan", ylabel="frequency of falls")
    tidy(axes)
    axes.legend(loc="upper left", **LEGEND)
    finding = f"the FLDS differs from the frequency of falls by {away['dynamic']:.2f} on average"
    finding += f", the kinematic FLSS by {away['kinematic']:.2f}"
    starts = starts_in_words(int(at.physical_starts.max()))
    conditions = f"V = {at.velocity.item():g}; {starts} of each controller; names: more than {NAMED:g} apart"
    head(figure, finding, caption(result), conditions)
    return figure


def _drawn(
    finding: str, shown: "xr.Dataset", panels: list[Panel], note: str = ""
) -> "tuple[Figure, Any, list[AxesImage]]":
    """Draw panels with a row for each entrant; return figure, axes, heat maps."""
    rows, images = shown.sizes["entrant"], []
    figure = picture(10.0, 2.6 + 0.18 * rows)
    axes = figure.subplots(1, len(panels), sharey=True)
    for ax, (title, values, colours, fewer, ends) in zip(axes, panels, strict=False):
        marks = np.where(np.isfinite(values), np.where(fewer, FEWER, ""), NOTHING)
        images.append(heat_map(ax, shown.velocity.values, values, marks, cmap=colours, **ends))
        ax.set_title(title, fontsize=9)
    ranks = [place(shown.isel(entrant=row).sel(measure="physical")) for row in range(rows)]
    names = [f"{in_figure(name)}{rank}" for name, rank in zip(shown.entrant.values, ranks, strict=True)]
    axes[0].set_yticks(range(rows), names, fontsize=9)
    axes[0].set_ylim(rows - 0.5, -0.5)
    head(figure, finding, caption(shown))
    figure.supxlabel("\n".join(wrap("; ".join(filter(None, [NOTES, note])), 140)), fontsize=9)
    return figure, axes, images
