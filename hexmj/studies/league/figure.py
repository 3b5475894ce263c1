"""The league on one page: a row for each entrant, the same in every panel."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.literal import in_figure
from hexmj.measures.captions import caption
from hexmj.studies.league.table import by_rank

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

LOSSES, SHARES, COSTS, PHASES = "YlOrRd", "YlGn", "PuBu", "twilight"
"""Colours of what is bad, good, costly and periodic."""


def league_figure(result: "xr.Dataset") -> "Picture":
    """Heat maps of all measures, the best in physics at the top, from `League`."""
    from hexmj.pictures import head, picture

    shown = by_rank(result)
    velocities, rows = [f"{v:g}" for v in shown.velocity.values], shown.sizes["entrant"]
    width = 5.0 + 1.35 * len(velocities)
    figure = picture(max(13.0, width), 2.6 + 0.52 * rows)
    panels = figure.subplots(2, 4, sharey=True)
    n = {key: int(shown[f"{key}_starts"].max()) for key in ("kinematic", "physical", "fell")}
    over_v: dict[str, tuple[str, str, float]] = {
        f"kinematic FLSS, {n['kinematic']} starts": ("kinematic", LOSSES, 1.0),
        f"measured FLSS, {n['physical']} starts": ("measured", LOSSES, 1.0),
        f"physical FLSS (falls), {n['physical']} starts": ("physical", LOSSES, 1.0),
        "regimes that are statically stable": ("stable", SHARES, 1.0),
        "ipsilateral phase of the regimes": ("ipsilateral", PHASES, 1.0),
        "cost of transport": ("cost", COSTS, float(np.nanmax([shown.cost.max().item(), 1e-9]))),
    }
    first, rest = panels[0, 0], panels.ravel()
    for panel, (title, (name, colours, most)) in zip(rest, over_v.items(), strict=False):
        _heat(panel, shown[name].values, colours, most)
        panel.set_title(title, fontsize=10)
        panel.set_xticks(range(len(velocities)), velocities)
        panel.set_xlabel("velocity $V_r / V_p$", fontsize=9)
    _heat(rest[6], shown.fell.values, LOSSES, 1.0)
    rest[6].set_title(f"falls at V = {result.attrs['tried_at']:g}, {n['fell']} starts", fontsize=10)
    rest[6].set_xticks(range(shown.sizes["trial"]), shown.trial.values, rotation=45, ha="right", fontsize=8)
    _dots(rest[7], shown)
    first.set_yticks(range(rows), [in_figure(name) for name in shown.entrant.values])
    first.set_ylim(rows - 0.5, -0.5)
    head(figure, "The league, best in physics first", caption(result))
    return figure


def _heat(axes: "Axes", values: np.ndarray, colours: str, most: float) -> None:
    """Numbers as colours, and written; grey where there is none."""
    import matplotlib

    colour_of = matplotlib.colormaps[colours].with_extremes(bad="0.93")
    image = axes.imshow(values, cmap=colour_of, vmin=0.0, vmax=most, aspect="auto")
    size = 7.5 if values.shape[1] <= 9 else 6.5
    for row, column in np.argwhere(np.isfinite(values)):
        value = values[row, column]
        dark = np.dot(image.cmap(image.norm(value))[:3], [0.3, 0.59, 0.11]) < 0.5
        words = f"{value:.2f}".replace("0.", ".", 1) if value < 10 else f"{value:.0f}"
        axes.text(column, row, words, ha="center", va="center", fontsize=size, color="white" if dark else "0.1")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _dots(axes: "Axes", shown: "xr.Dataset") -> None:
    """J_N and the FLSS of accelerating walks with their intervals."""
    for name, label, colour, beside in (
        ("range", "$J_N$, V = 0.1 to 0.5", "#1b6ca8", -0.14),
        ("accelerated", "accelerated to 0.9", "#b3261e", 0.14),
    ):
        low, middle, high = (shown[name + end].values for end in ("_low", "", "_high"))
        style: dict[str, Any] = {"color": colour, "fmt": "o", "markersize": 4, "capsize": 2.5, "label": label}
        axes.errorbar(middle, np.arange(len(middle)) + beside, xerr=[middle - low, high - middle], **style)
    axes.set(xlim=(-0.02, 1.02), xlabel="FLSS on paper")
    axes.grid(axis="x", color="0.9", linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
