"""The league as two figures with a row for each entrant: losses and falls, and gaits, trials and costs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from hexmj.measures.figures import caption, starts_in_words
from hexmj.plotting import head, heat_map, in_figure, interval, picture, velocity_columns
from hexmj.studies.standings import MEASURES, by_rank, from_one, place

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

SHARES = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
"""Between these shares a colour is the same."""

PHASES = (*np.arange(-1, 26, 2) / 24,)
"""The same for phases: twelfths of a cycle lie in the middle of a colour."""

FEWER, NOTHING = "\N{BULLET}", "\N{EN DASH}"
"""Marks of a cell with missing walks, and of one without a number."""

BAR_HEIGHT = 0.25
"""Height of the place of a colour bar [inch]."""

NAMED = 6
"""Most entrants that a note names."""

POINTS = {"range": ("#1b6ca8", "o", -0.14), "accelerated": ("#b3261e", "D", 0.14)}
"""Number over all velocities -> colour, mark and place in its row."""


class Panel(NamedTuple):
    """A heat map."""

    title: str
    values: np.ndarray
    """(entrant, column)."""
    colours: str
    """Name of a colour map of matplotlib."""
    levels: tuple[float, ...]
    """Between which a colour is the same."""
    fewer: np.ndarray | Literal[False] = False
    """Where walks are missing, (entrant, column), if any are."""


def league_figure(result: "xr.Dataset") -> "Figure":
    """Draw kinematic and measured losses and falls, the best in physics at the top."""
    shown = by_rank(result)
    missing = shown.missing.values > 0
    titles = dict(zip(MEASURES, ("kinematic losses", "measured losses", "falls (physical)"), strict=True))
    panels = [
        Panel(f"{title}\n{starts_in_words(shown[f'{name}_starts'].max().item())}", shown[name].values, "YlOrRd", SHARES,
              name != "kinematic" and missing)
        for name, title in titles.items()
    ]  # fmt: skip
    figure, axes = _rows(shown, (1.0, 1.0, 1.0, 0.95))
    images = [_heat(one, panel, shown) for one, panel in zip(axes, panels, strict=False)]
    _colour_bar(figure, axes[:3], images[0], "share of the starts", aspect=55, shrink=0.7)
    _dots(axes[3], shown)
    heading = "The league: who loses static stability, and who falls; best in physics first, with the ranks there"
    _head(figure, heading, result, in_figure(from_one(shown)), _nothing(panels), _missing(shown))
    return figure


def walks_figure(result: "xr.Dataset") -> "Figure":
    """Draw falls in trials, steady-state gaits and costs, the best in physics at the top."""
    shown = by_rank(result)
    few = shown.fell_starts.values
    some_are = (few > 0) & (few < few.max())
    trials = f"falls in trials at V = {result.attrs['trial_velocity']:g}\n{starts_in_words(few.max())}"
    panels = (
        Panel(trials, shown.fell.values, "YlOrRd", SHARES, some_are),
        Panel("steady-state gaits that\nare statically stable", shown.stable.values, "YlGn", SHARES),
        Panel("ipsilateral phase\nof the gaits", shown.ipsilateral.values, "twilight", PHASES),
        Panel("cost of transport\nof walks without a fall", shown.cost.values, "PuBu", _round_levels(shown.cost.values),
              shown.missing.values > 0),
    )  # fmt: skip
    figure, axes = _rows(shown, (1.33, 1.0, 1.0, 1.0))
    labels = ("share of the starts", "share of the starts", "phase", "")
    for one, panel, label in zip(axes, panels, labels, strict=True):
        bar = _colour_bar(figure, one, _heat(one, panel, shown), label, aspect=23)
        if panel.colours == "twilight":
            bar.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0])
    turned: dict[str, Any] = {"rotation": 60, "ha": "right", "rotation_mode": "anchor", "fontsize": 8}
    axes[0].set_xticks(range(shown.sizes["trial"]), shown.trial.values, **turned)
    axes[0].set_xlabel("")
    heading = "The league: trials, steady-state gaits and costs; best in physics first"
    unstable = f"{FEWER} among the trials: of fewer starts; plans not stable until halt, leg or push, or walks missing"
    _head(figure, heading, result, _nothing(panels), unstable if some_are.any() else "", _missing(shown))
    return figure


def _rows(shown: "xr.Dataset", widths: tuple[float, ...]) -> "tuple[Figure, Any]":
    """Return panels that share the entrants as their rows."""
    rows = shown.sizes["entrant"]
    figure = picture(11.0, 2.6 + 0.22 * rows)
    axes = figure.subplots(1, len(widths), sharey=True, width_ratios=widths)
    ranks = [place(shown.isel(entrant=row).sel(measure="physical")) for row in range(rows)]
    names = [f"{in_figure(name)}{rank}" for name, rank in zip(shown.entrant.values, ranks, strict=True)]
    axes[0].set_yticks(range(rows), names, fontsize=9)
    axes[0].set_ylim(rows - 0.5, -0.5)
    return figure, axes


def _head(figure: "Figure", heading: str, result: "xr.Dataset", *notes: str) -> None:
    """Write a title, and below the panels the meaning of the marks."""
    head(figure, heading, caption(result))
    figure.supxlabel("\n".join(filter(None, notes)), fontsize=8)


def _nothing(panels: Sequence[Panel]) -> str:
    """Return the meaning of a dash, if there is one."""
    unknown = any(np.isnan(panel.values).any() for panel in panels)
    return f"{NOTHING} not tried, or no walk or gait is left" if unknown else ""


def _round_levels(values: np.ndarray) -> tuple[float, ...]:
    """Return a few round numbers around all values."""
    from matplotlib.ticker import MaxNLocator

    known = values[np.isfinite(values)]
    ends = (known.min(), known.max()) if known.size else (0.0, 1.0)
    return (*MaxNLocator(6, min_n_ticks=2).tick_values(ends[0], max(ends[1], ends[0] + 0.1)),)


def _missing(shown: "xr.Dataset") -> str:
    """Return a note on missing walks, if there are any."""
    of = shown.missing.sum("velocity")
    found = [f"{in_figure(name)} {count:g}" for name, count in zip(of.entrant.values, of.values, strict=True) if count]
    if not found:
        return ""
    names = ", ".join(found[:NAMED]) + (f" and {len(found) - NAMED} more" if len(found) > NAMED else "")
    return f"{FEWER} of fewer starts: walks are missing that diverged or were out of reach (in all {names})"


def _heat(axes: "Axes", panel: Panel, shown: "xr.Dataset") -> "AxesImage":
    """Draw numbers as colours, with a dash for no number and a mark for missing walks."""
    import matplotlib
    from matplotlib.colors import BoundaryNorm

    colours = matplotlib.colormaps[panel.colours].with_extremes(bad="0.93")
    known, fewer = np.isfinite(panel.values), np.broadcast_to(panel.fewer, panel.values.shape)
    texts = np.where(known, np.where(fewer, FEWER, ""), NOTHING)
    image = heat_map(axes, panel.values, texts, cmap=colours, norm=BoundaryNorm(panel.levels, colours.N))
    for edge in range(1, len(known)):
        axes.axhline(edge - 0.5, color="white", linewidth=0.6)
    axes.set_title(panel.title, fontsize=10)
    velocity_columns(axes, shown.velocity.values)
    return image


def _colour_bar(figure: "Figure", axes: Any, image: "AxesImage", label: str, **options: Any) -> "Colorbar":
    """Draw the scale of a heat map below its panels."""
    height = BAR_HEIGHT / figure.get_figheight()
    bar = figure.colorbar(image, ax=axes, location="bottom", format="%g", fraction=height, **options)
    bar.ax.tick_params(labelsize=7)
    bar.set_label(label, fontsize=9)
    return bar


def _dots(axes: "Axes", shown: "xr.Dataset") -> None:
    """Draw J_N and the FLSS of accelerating walks with their intervals."""
    for name, (colour, marker, beside) in POINTS.items():
        middle, ends = interval(shown, name)
        style: dict[str, Any] = {"color": colour, "fmt": marker, "markersize": 4, "capsize": 2.0}
        axes.errorbar(middle, np.arange(len(middle)) + beside, xerr=ends, **style)
    for row in range(shown.sizes["entrant"]):
        axes.axhline(row, color="0.93", linewidth=0.8, zorder=0)
    axes.set(xlim=(-0.03, 1.03))
    axes.set_title("kinematic, over all velocities\nwith 95 % intervals", fontsize=10)
    axes.set_xlabel("FLSS\n\N{BLACK CIRCLE} $J_N$, V drawn from 0.1 to 0.5\n\N{BLACK DIAMOND} accelerated to 0.9",
                    fontsize=9)  # fmt: skip
    axes.tick_params(labelsize=8, left=False)
    axes.spines[["top", "right", "left"]].set_visible(False)
