"""Sets under every variant as a figure: what each loses as usual, in the mean and at worst."""

from typing import TYPE_CHECKING, Any

from hexmj.io import settings
from hexmj.measures.captions import caption, starts_in_words
from hexmj.measures.drawable_parts import check_starts
from hexmj.measures.figures import tidy
from hexmj.pictures import in_figure
from hexmj.studies.variants.study import notes

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from hexmj.pictures import Picture

STYLES: dict[str, dict[str, Any]] = {
    "centred": {"color": "#6a4c93", "marker": "s"},
    "PEP_min": {"color": "#b3261e", "marker": "v"},
    "AEP0": {"color": "#e08e1b", "marker": "o"},
    "PEP0": {"color": "#d4b106", "marker": "^"},
    "dt": {"color": "#8a8a8a", "marker": "X"},
    "undelayed": {"color": "#2a9d8f", "marker": "<"},
    "sequential": {"color": "#14663a", "marker": ">"},
    "lasting": {"color": "#1b6ca8", "marker": "P"},
}
"""Of the variants whose names begin so."""


def variants_figure(result: "xr.Dataset") -> "Picture":
    """A panel for each velocity, a row for each set, a dot for each variant, from `Variants`."""
    from matplotlib.lines import Line2D

    from hexmj.pictures import head, picture

    check_starts(result)
    columns = min(2, result.sizes["velocity"])
    rows = -(-result.sizes["velocity"] // columns)
    figure = picture(1.4 + 4.6 * columns, 1.5 + rows * (0.9 + 0.36 * result.sizes["network"]))
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for panel, velocity in zip(panels, result.velocity.values, strict=False):
        _panel(panel, result.sel(velocity=velocity))
        panel.set_title(f"V = {velocity:g}", fontsize=11)
    for panel in panels[result.sizes["velocity"] :]:
        panel.set_visible(False)
    dots: dict[str, Any] = {"linestyle": "none", "markersize": 6, "color": "0.1"}
    marks = {
        "usual": {"marker": "D", "markerfacecolor": "white"},
        "mean of those shown": {"marker": "|", "markersize": 13},
    }
    handles = [Line2D([], [], label=name, **dots | mark) for name, mark in (marks | STYLES).items()]
    figure.legend(handles=handles, frameon=False, fontsize=9, loc="outside right center")
    told = f"{starts_in_words(result.attrs['n_starts'])}; {caption(result)}"
    head(figure, f"{_measure(result)} with one constant or rule changed at a time", told)
    figure.supxlabel("\n".join(map(in_figure, notes(result))), fontsize=9)
    return figure


def _measure(result: "xr.Dataset") -> str:
    """What was counted, as far as the result's settings, which joining may drop, tell of it."""
    told = settings(result)
    if "conditions" not in told:
        return "FLSS"
    return "Kinematic FLSS" if told["conditions"] is None else "Physical FLSS"


def _panel(axes: "Axes", one: "xr.Dataset") -> None:
    """All sets at one velocity, the first at the top."""
    names = one.network.values.tolist()
    for row, name in enumerate(names):
        here = one.sel(network=name)
        axes.plot([here.flss.min(), here.flss.max()], [row, row], color="0.85", linewidth=5, solid_capstyle="round")
        for variant in here.variant.values[::-1]:
            style = {"marker": "D", "color": "white", "markeredgecolor": "0.1", "markersize": 6.5, "zorder": 4}
            if variant != "usual":
                own = next(STYLES[begin] for begin in STYLES if variant.startswith(begin))
                style = {"markeredgecolor": "white", "markersize": 7.5, "alpha": 0.9} | own
            axes.plot(here.flss.sel(variant=variant), row, **style)
        axes.plot(here.flss.mean(), row, marker="|", color="0.1", markersize=17, markeredgewidth=2.2, zorder=5)
    tidy(axes)
    axes.grid(visible=False, axis="y")
    most = one.flss.max().item()
    beyond = 0.04 * most + 1e-3
    axes.set(xlim=(-beyond, most + beyond), xlabel="FLSS")
    axes.set_yticks(range(len(names)), [in_figure(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
