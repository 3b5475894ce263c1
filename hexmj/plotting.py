"""Figures: those that belong to results, and what they share. Figures are made without pyplot."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

FIGURES: dict[str, dict[str, str]] = {
    "flss": {"flss": "measures.figures:flss_figure"},
    "compare": {"comparison": "measures.figures:comparison_figure"},
    "map": {"map": "studies.stability_map:map_figure", "mechanisms": "studies.stability_map:mechanisms_figure"},
    "converge": {"converge": "studies.static_limit:static_limit_figure"},
    "terrain": {"terrain": "studies.terrain:terrain_figure"},
    "disturb": {"disturb": "studies.disturbance:disturbed_figure"},
    "biology": {"biology": "studies.biology:biology_figure"},
    "league": {"league": "studies.league_figure:league_figure", "walks": "studies.league_figure:walks_figure"},
    "ablate": {"ablation": "studies.ablation:ablation_figure"},
    "search": {"convergence": "search.results:convergence_figure"},
    "recording": {"walk": "replay.take:walk_figure"},
}
"""Attribute `study` of a result -> its figures by name, each a module and a function of it."""

CURVE: dict[str, Any] = {"marker": "o", "markersize": 4, "linewidth": 1.6, "capsize": 2.5}
"""Style of points with intervals."""

BESIDE = 0.024
"""Width in V_r / V_p over which the points of one velocity stand beside each other."""

MOST_TICKS = 9
"""Most velocities that are written at an axis; for more, matplotlib chooses round numbers."""

MEASURE_STYLES: dict[str, dict[str, Any]] = {
    "kinematic": {"color": "#1b6ca8", "marker": "o", "linestyle": "-"},
    "measured": {"color": "#e08e1b", "marker": "s", "linestyle": "--"},
    "physical": {"color": "#b3261e", "marker": "^", "linestyle": "-."},
    "toppled": {"color": "#6a4c93", "marker": "x", "linestyle": ":"},
}
"""Styles of the measures, which differ without colours too."""

SERIES: tuple[dict[str, Any], ...] = (
    {"color": "#1b6ca8", "marker": "o", "linestyle": "-"},
    {"color": "#2a9d5c", "marker": "s", "linestyle": "--"},
    {"color": "#e08e1b", "marker": "^", "linestyle": "-."},
    {"color": "#b3261e", "marker": "D", "linestyle": ":"},
    {"color": "#6a4c93", "marker": "v", "linestyle": (0, (5, 1))},
)
"""Styles of other curves in turn."""

VELOCITY = "velocity $V_r / V_p$"
"""Label of an axis of velocities."""

FEWER, NOTHING = "\N{BULLET}", "\N{EN DASH}"
"""Marks of a cell of a heat map with missing walks, and of one without a number."""

LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9}
"""Options of a legend."""


def plot(result: "xr.Dataset", which: str | None = None) -> "Figure":
    """Draw a result. A notebook shows the figure, and its method `savefig` writes PNG, PDF or SVG.

    Args:
        result: of `compare`, `flss`, `physical_flss`, `record` or a study, fresh or as `load` reads it.
        which: name of the figure, if there are several; by default the first.

    Raises:
        InputError: no figure belongs to the dataset, or none has this name.
    """
    study = "recording" if "planned_stance" in result else str(result.attrs.get("study", ""))
    if study not in FIGURES:
        raise InputError(f"A dataset of {study or 'no study'} has no figure; results of {', '.join(FIGURES)} have one")
    figures = FIGURES[study]
    module, function = figures[choice("which", which or next(iter(figures)), figures)].split(":")
    draw: Callable[[xr.Dataset], Figure] = getattr(import_module(f"hexmj.{module}"), function)
    return draw(result.compute())


@contextmanager
def as_shipped() -> Iterator[None]:
    """Use matplotlib's own defaults inside the context, so that commands draw the same everywhere."""
    from matplotlib import rc_context, rcdefaults

    with rc_context():
        rcdefaults()
        yield


def picture(width: float, height: float) -> "Figure":
    """Return an empty figure of a size in inches, which notebooks show, and whose parts make room for each other."""
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(width, height), layout="constrained")

    def png() -> bytes:
        drawn = BytesIO()
        figure.savefig(drawn, format="png", dpi=100)
        return drawn.getvalue()

    figure._repr_png_ = png
    return figure


def head(figure: "Figure", *lines: str) -> None:
    """Set the title of a figure. Empty lines are left out, and long ones are wrapped."""
    figure.suptitle("\n".join(filter(None, lines)), fontsize=10, wrap=True)


def in_figure(text: str) -> str:
    """Return a text in which dollars do not begin a formula."""
    return text.replace("$", r"\$")


def tidy(axes: "Axes") -> None:
    """Draw a grid, and no frame above and on the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)


def flss_axes(axes: "Axes", velocities: np.ndarray) -> None:
    """Set up axes of FLSS against velocity."""
    low, high = max(-BESIDE, velocities.min() - 0.1), min(1.0 + BESIDE, velocities.max() + 0.1)
    axes.set(xlabel=VELOCITY, xlim=(low, high), ylabel="FLSS", ylim=(-0.02, 1.02))
    if len(velocities) <= MOST_TICKS:
        axes.set_xticks(velocities, [f"{v:g}" for v in velocities])
    tidy(axes)


def frequency_curve(axes: "Axes", x: "np.ndarray | xr.DataArray", data: "xr.Dataset", name: str, **style: Any) -> None:
    """Draw a frequency and its interval, `name`, `name_low` and `name_high`, against x, all (n,)."""
    axes.errorbar(x, *interval(data, name), **CURVE | style)


def interval(data: "xr.Dataset", name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a frequency, (n,), and how far its interval reaches below and above it, (2, n)."""
    low, middle, high = (data[name + end].values for end in ("_low", "", "_high"))
    return middle, np.stack([middle - low, high - middle])


def heat_map(axes: "Axes", values: np.ndarray, texts: np.ndarray, **style: Any) -> "AxesImage":
    """Draw numbers as colours, without a frame, and a text in every cell.

    Args:
        axes: to draw in.
        values: (row, column); NaN has no colour.
        texts: (row, column).
        style: options of `Axes.imshow`.
    """
    image = axes.imshow(values, aspect="auto", **style)
    shade = image.to_rgba(values)[..., :3] @ [0.3, 0.59, 0.11]
    for row, column in np.argwhere(texts != ""):
        colour = "white" if shade[row, column] < 0.5 and np.isfinite(values[row, column]) else "0.1"
        axes.text(column, row, str(texts[row, column]), color=colour, ha="center", va="center", fontsize=8)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    return image


def velocity_columns(axes: "Axes", velocities: np.ndarray) -> None:
    """Label the columns of a heat map with velocities."""
    axes.set_xticks(range(len(velocities)), [f"{v:g}" for v in velocities], fontsize=8)
    axes.set_xlabel(VELOCITY, fontsize=9)
