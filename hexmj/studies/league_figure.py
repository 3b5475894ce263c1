"""The league as two figures with a row for each entrant: losses and falls, and gaits, trials and costs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from hexmj.measures.figures import caption, starts_in_words
from hexmj.plotting import head, in_figure, picture
from hexmj.studies.standings import MEASURES, by_rank, from_one, place

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHARES = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
"""Between these shares a colour is the same."""

PHASES = (*np.arange(-1, 26, 2) / 24,)
"""The same for phases: twelfths of a cycle lie in the middle of a colour."""

FEWER, NOTHING = "\N{BULLET}", "\N{EN DASH}"
"""Marks of a cell with missing walks, and of one without a number."""

BAR: dict[str, Any] = {"location": "bottom", "format": "%g"}
"""Options of the colour bars below the panels."""

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
    images = [_heat(one, panel) for one, panel in zip(axes, panels, strict=False)]
    for one in axes[:3]:
        _velocities(one, shown)
    how: dict[str, Any] = BAR | {"fraction": BAR_HEIGHT / figure.get_figheight(), "aspect": 55, "shrink": 0.7}
    figure.colorbar(images[0], ax=axes[:3], **how).set_label("share of the starts", fontsize=9)
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
        how = {"fraction": BAR_HEIGHT / figure.get_figheight(), "aspect": 23}
        bar = figure.colorbar(_heat(one, panel), ax=one, **BAR, **how)
        bar.ax.tick_params(labelsize=7)
        if panel.colours == "twilight":
            bar.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0])
        bar.set_label(label, fontsize=9)
        _velocities(one, shown)
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
    others = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
    names = f"{', '.join(found[:NAMED])}{others}"
    return f"{FEWER} of fewer starts: walks are missing that diverged or were out of reach (in all {names})"


def _velocities(axes: "Axes", shown: "xr.Dataset") -> None:
    """Columns are velocities."""
    axes.set_xticks(range(shown.sizes["velocity"]), [f"{v:g}" for v in shown.velocity.values], fontsize=8)
    axes.set_xlabel("velocity $V_r / V_p$", fontsize=9)


def _heat(axes: "Axes", panel: Panel) -> Any:
    """Draw numbers as colours, with a dash for no number and a mark for missing walks."""
    import matplotlib
    from matplotlib.colors import BoundaryNorm

    colours = matplotlib.colormaps[panel.colours].with_extremes(bad="0.93")
    how: dict[str, Any] = {"cmap": colours, "norm": BoundaryNorm(panel.levels, colours.N), "aspect": "auto"}
    image = axes.imshow(panel.values, **how)
    for row, column in np.argwhere(~np.isfinite(panel.values) | panel.fewer):
        known = np.isfinite(panel.values[row, column])
        shade = image.cmap(image.norm(panel.values[row, column])) if known else (1.0, 1.0, 1.0, 1.0)
        dark = np.dot(shade[:3], [0.3, 0.59, 0.11]) < 0.5
        colour = "white" if dark else "0.1" if known else "0.6"
        axes.text(column, row, FEWER if known else NOTHING, ha="center", va="center", fontsize=8, color=colour)
    for edge in range(1, panel.values.shape[0]):
        axes.axhline(edge - 0.5, color="white", linewidth=0.6)
    axes.set_title(panel.title, fontsize=10)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return image


def _dots(axes: "Axes", shown: "xr.Dataset") -> None:
    """Draw J_N and the FLSS of accelerating walks with their intervals."""
    for name, (colour, marker, beside) in POINTS.items():
        low, middle, high = (shown[name + end].values for end in ("_low", "", "_high"))
        style: dict[str, Any] = {"color": colour, "fmt": marker, "markersize": 4, "capsize": 2.0}
        axes.errorbar(middle, np.arange(len(middle)) + beside, xerr=[middle - low, high - middle], **style)
    for row in range(shown.sizes["entrant"]):
        axes.axhline(row, color="0.93", linewidth=0.8, zorder=0)
    axes.set(xlim=(-0.03, 1.03))
    axes.set_title("kinematic, over all velocities\nwith 95 % intervals", fontsize=10)
    axes.set_xlabel("FLSS\n\N{BLACK CIRCLE} $J_N$, V drawn from 0.1 to 0.5\n\N{BLACK DIAMOND} accelerated to 0.9",
                    fontsize=9)  # fmt: skip
    axes.tick_params(labelsize=8, left=False)
    axes.spines[["top", "right", "left"]].set_visible(False)
