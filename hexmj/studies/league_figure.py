"""Two figures of the league with a row for each entrant: losses and falls; and trials, gaits and costs."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hexmj.measures.figures import caption, starts_in_words
from hexmj.plotting import FEWER, NOTHING, head, heat_map, in_figure, interval, picture, velocity_columns
from hexmj.studies.standings import MEASURES, by_rank, from_one, place

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

COLUMNS = 4
"""Number of panels in a figure."""

SHARE: dict[str, Any] = {"vmin": 0.0, "vmax": 1.0}
"""Options of the colour scale of fractions and phases: from 0 to 1."""

BAR: dict[str, Any] = {"format": "%g", "fraction": 0.03}
"""Options of all colour bars."""

NOTES = f"{FEWER} of fewer starts: walks are missing that diverged or were out of reach; {NOTHING} not known"
"""Explanation of the marks in the cells of the heat maps."""

POINTS = {"range": ("#1b6ca8", "o", -0.14), "accelerated": ("#b3261e", "D", 0.14)}
"""FLSS that is not given per velocity -> colour, marker, and vertical shift of its point in the entrant's row."""


class Panel(NamedTuple):
    """A heat map with a row for each entrant."""

    title: str
    values: np.ndarray
    """(entrant, column) numbers shown as colours."""
    colours: str
    """Name of one of matplotlib's colour maps."""
    fewer: np.ndarray | bool = False
    """(entrant, column) whether walks are missing; False if none is missing in any cell."""
    ends: dict[str, Any] = SHARE


def league_figure(result: "xr.Dataset") -> "Figure":
    """Draw kinematic losses, measured losses and falls, with the lowest physical FLSS at the top."""
    shown = by_rank(result)
    missing = shown.missing.values > 0
    titles = dict(zip(MEASURES, ("kinematic losses", "measured losses", "falls (physical)"), strict=True))
    panels = []
    for name, title in titles.items():
        starts, fewer = starts_in_words(shown[f"{name}_starts"].max().item()), name != "kinematic" and missing
        panels.append(Panel(f"{title}\n{starts}", shown[name].values, "YlOrRd", fewer))
    heading = "The league: who loses static stability, and who falls; best in physics first, with the ranks there"
    figure, axes, images = _drawn(heading, shown, panels, in_figure(from_one(shown)))
    figure.colorbar(images[0], ax=axes[:3], location="bottom", label="share of the starts", **BAR, aspect=55)
    _dots(axes[3], shown)
    return figure


def walks_figure(result: "xr.Dataset") -> "Figure":
    """Draw falls in trials, steady-state gaits and costs, with the lowest physical FLSS at the top."""
    shown = by_rank(result)
    few, missing = shown.fell_starts.values, shown.missing.values > 0
    some_are = (few > 0) & (few < few.max())
    trials = f"falls in trials at V = {result.attrs['trial_velocity']:g}\n{starts_in_words(few.max())}"
    panels = [
        Panel(trials, shown.fell.values, "YlOrRd", some_are),
        Panel("steady-state gaits that\nare statically stable", shown.stable.values, "YlGn"),
        Panel("ipsilateral phase\nof the gaits", shown.ipsilateral.values, "twilight"),
        Panel("cost of transport\nof walks without a fall", shown.cost.values, "PuBu", missing, {}),
    ]
    heading = "The league: trials, steady-state gaits and costs; best in physics first"
    figure, axes, images = _drawn(heading, shown, panels, "fewer starts in trials: or plans not stable until then")
    for ax, image in zip(axes, images, strict=True):
        figure.colorbar(image, ax=ax, location="bottom", **BAR, aspect=23).ax.locator_params(nbins=2)
    turned: dict[str, Any] = {"rotation": 60, "ha": "right", "rotation_mode": "anchor", "fontsize": 8}
    axes[0].set_xticks(range(shown.sizes["trial"]), shown.trial.values, **turned)
    axes[0].set_xlabel("")
    return figure


def _drawn(heading: str, shown: "xr.Dataset", panels: list[Panel], note: str) -> "tuple[Figure, Any, list[AxesImage]]":
    """Draw panels in a figure of `COLUMNS` axes with a row for each entrant; return figure, axes and heat maps."""
    rows, images = shown.sizes["entrant"], []
    figure = picture(11.0, 2.6 + 0.22 * rows)
    axes = figure.subplots(1, COLUMNS, sharey=True)
    for ax, panel in zip(axes, panels, strict=False):
        marks = np.where(np.isfinite(panel.values), np.where(panel.fewer, FEWER, ""), NOTHING)
        images.append(heat_map(ax, panel.values, marks, cmap=panel.colours, **panel.ends))
        ax.set_title(panel.title, fontsize=10)
        velocity_columns(ax, shown.velocity.values)
    ranks = [place(shown.isel(entrant=row).sel(measure="physical")) for row in range(rows)]
    names = [f"{in_figure(name)}{rank}" for name, rank in zip(shown.entrant.values, ranks, strict=True)]
    axes[0].set_yticks(range(rows), names, fontsize=9)
    axes[0].set_ylim(rows - 0.5, -0.5)
    head(figure, heading, caption(shown))
    figure.supxlabel("; ".join(filter(None, [NOTES, note])), fontsize=8)
    return figure, axes, images


def _dots(axes: "Axes", shown: "xr.Dataset") -> None:
    """Draw J_N and the FLSS of accelerating walks with their 95 % intervals."""
    for name, (colour, marker, beside) in POINTS.items():
        middle, ends = interval(shown, name)
        style: dict[str, Any] = {"color": colour, "fmt": marker, "markersize": 4, "capsize": 2.0}
        axes.errorbar(middle, np.arange(len(middle)) + beside, xerr=ends, **style)
    for row in range(shown.sizes["entrant"]):
        axes.axhline(row, color="0.93", linewidth=0.8, zorder=0)
    axes.set(xlim=(-0.03, 1.03))
    axes.set_title("kinematic, over all velocities\nwith 95 % intervals", fontsize=10)
    points = "\N{BLACK CIRCLE} $J_N$, V drawn from 0.1 to 0.5\n\N{BLACK DIAMOND} accelerated to 0.9"
    axes.set_xlabel(f"FLSS\n{points}", fontsize=9)
    axes.tick_params(labelsize=8, left=False)
    axes.spines[["top", "right", "left"]].set_visible(False)
