"""Figures of results, and the styles and axes that they share. Figures are made without pyplot."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BytesIO
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES: dict[str, dict[str, str]] = {
    "flss": {"flss": "measures.figures:flss_figure"},
    "compare": {"comparison": "measures.figures:comparison_figure"},
    "biology": {"biology": "studies.biology:biology_figure"},
    "tasks": {"matrix": "tasks.league:matrix_figure", "cost": "tasks.league:cost_figure"},
    "search": {"convergence": "search.results:convergence_figure"},
    "recording": {"walk": "replay.take:walk_figure"},
}
"""Attribute `study` of a result -> its figures: name -> 'module:function' that draws it, modules relative to hexmj."""

CURVE: dict[str, Any] = {"marker": "o", "markersize": 5, "linewidth": 1.8, "capsize": 2.5}
"""Style of points with error bars."""

BESIDE = 0.024
"""Width in V_r / V_p over which points of the same velocity are spread, so that they do not overlap."""

MEASURE_STYLES: dict[str, dict[str, Any]] = {
    "kinematic": {"color": "#1b6ca8", "marker": "o", "linestyle": "-", "label": "kinematic FLSS: planned feet"},
    "dynamic": {"color": "#2b2b2b", "marker": "v", "linestyle": (0, (5, 1)), "label": "FLDS: tipping pendulum"},
    "grounded": {"color": "#c8740a", "marker": "s", "linestyle": "--", "label": "grounded FLSS: feet at the ground"},
    "carried": {"color": "#2a9d5c", "marker": "D", "linestyle": ":", "label": "carried FLSS: feet that carry load"},
    "physical": {"color": "#b3261e", "marker": "^", "linestyle": "-.", "label": "frequency of falls: trunk on ground"},
}
"""Measure -> style and label of its curve; markers and lines differ too, for readers without colours."""

SERIES: tuple[dict[str, Any], ...] = (
    {"color": "#17807e", "marker": "o", "linestyle": "-"},
    {"color": "#c2487f", "marker": "s", "linestyle": "--"},
    {"color": "#8a6d3b", "marker": "^", "linestyle": "-."},
    {"color": "#556270", "marker": "D", "linestyle": ":"},
    {"color": "#9aa51b", "marker": "v", "linestyle": (0, (5, 1))},
)
"""Styles, in this order, of curves for something else than a measure of stability: a strategy, or a velocity."""

VELOCITY = "velocity $V_r / V_p$"
"""Label of a velocity axis."""

LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9}
"""Default options of legends."""


def plot(result: "xr.Dataset", which: str | None = None) -> "Figure":
    """Draw the figure of a result. Notebooks show it, and its method `savefig` writes PNG, PDF or SVG.

    Args:
        result: dataset of `compare`, `flss`, `physical_flss`, `record` or a study, as computed or as `load` reads it.
        which: name of the figure, if the result has several; by default the first.

    Raises:
        InputError: the dataset has no figure, or no figure with this name.
    """
    study = "recording" if "planned_stance" in result else str(result.attrs.get("study", ""))
    if study not in FIGURES:
        raise InputError(f"study = {study or 'none'}; datasets of these studies have a figure: {', '.join(FIGURES)}")
    figures = FIGURES[study]
    module, function = figures[choice("which", which or next(iter(figures)), figures)].split(":")
    draw: Callable[[xr.Dataset], Figure] = getattr(import_module(f"hexmj.{module}"), function)
    return draw(result.compute())


@contextmanager
def as_shipped() -> Iterator[None]:
    """Use matplotlib's built-in defaults inside the context, so that commands draw the same on every machine."""
    from matplotlib import rc_context, rcdefaults

    with rc_context():
        rcdefaults()
        yield


def picture(width: float, height: float) -> "Figure":
    """Return an empty figure with matplotlib's constrained layout, which notebooks can show.

    It is `width` [inches] wide, but at most 10, so that texts of 9 points stay legible on a slide of this width.
    """
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(min(width, 10.0), height), layout="constrained")

    def png() -> bytes:
        drawn = BytesIO()
        figure.savefig(drawn, format="png", dpi=100)
        return drawn.getvalue()

    figure._repr_png_ = png
    return figure


def head(figure: "Figure", finding: str, *conditions: str) -> None:
    """Write a finding in bold above a figure and its conditions below the finding. Empty texts are left out."""
    (width, height), top = 72.0 * figure.get_size_inches(), 7.0
    title, hard = finding[:1].upper() + finding[1:], "\N{NO-BREAK SPACE}"
    words = "; ".join(filter(None, conditions)).replace(" ", hard).replace(f";{hard}", "; ").replace(f",{hard}", ", ")
    for text, size, letter, weight, colour in ((title, 11.0, 0.62, "bold", "0.0"), (words, 9.0, 0.53, "normal", "0.3")):
        style: Any = {"ha": "center", "va": "top", "fontweight": weight, "fontsize": size, "color": colour}
        lines = wrap(text, int(width / (letter * size)))
        figure.text(0.5, 1.0 - top / height, "\n".join(lines), **style)
        top += 1.35 * size * len(lines) + 2.0
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - top / height))


def in_figure(text: str) -> str:
    """Escape the dollar signs of a text, since matplotlib would read them as the begin of a formula."""
    return text.replace("$", r"\$")


def tidy(axes: "Axes") -> None:
    """Draw a grid, and hide the upper and the right line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.8)


def flss_axes(axes: "Axes", velocities: np.ndarray, label: str = "share of the starts") -> None:
    """Set labels, limits and ticks of axes that show frequencies against velocities, (velocity,)."""
    low, high = max(-BESIDE, velocities.min() - 0.1), min(1.0 + BESIDE, velocities.max() + 0.1)
    axes.set(xlabel=VELOCITY, xlim=(low, high), ylabel=label, ylim=(-0.02, 1.02))
    if len(velocities) <= 9:  # else matplotlib chooses the ticks
        axes.set_xticks(velocities, [f"{v:g}" for v in velocities])
    tidy(axes)


def frequency_curve(axes: "Axes", x: "np.ndarray | xr.DataArray", data: "xr.Dataset", name: str, **style: Any) -> None:
    """Draw the frequency `name`, (n,), against x, (n,), with its interval from `name_low` to `name_high` as bars."""
    axes.errorbar(x, *interval(data, name), **CURVE | style)


def interval(data: "xr.Dataset", name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequency `name`, (n,), and the lengths of its error bars below and above, (2, n)."""
    low, middle, high = (data[name + end].values for end in ("_low", "", "_high"))
    return middle, np.stack([middle - low, high - middle])
