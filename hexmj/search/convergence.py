"""The course of a search as a figure."""

from typing import TYPE_CHECKING

from hexmj.plotting import in_figure, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FREQUENCY = "FLSS"
"""What a cost is, unless something else is minimised."""

STAGE_COLOURS = {"population": "#1b6ca8", "simplex": "#b3261e"}


def convergence_figure(history: "xr.Dataset") -> "Figure":
    """Every candidate's cost and the least so far against the number of evaluations, from `history.history`."""
    from hexmj.plotting import head, picture

    figure = picture(6.8, 4.2)
    axes = figure.subplots()
    history = history.sortby("evaluation")
    evaluation = history.evaluation.values + 1
    for number, (stage, colour) in enumerate(STAGE_COLOURS.items()):
        here = history.stage.values == number
        if here.any():
            axes.plot(evaluation[here], history.cost.values[here], ".", color=colour, markersize=2.5, alpha=0.35)
            mark = "o" if here.sum() == 1 else None  # a line through one point is none
            axes.plot(
                evaluation[here], history.best.values[here], color=colour, linewidth=1.8, marker=mark, label=stage
            )
    cost = history.cost.attrs["long_name"]
    of = "cost" if cost != FREQUENCY else cost
    axes.set(xlabel="evaluations of the cost function", ylabel=f"{of} on the starts of the stage", ylim=(-0.02, 1.02))
    head(figure, in_figure(history.attrs["title"]))
    tidy(axes)
    title = "lines: least so far, dots: candidates" + (f"\ncost: {cost}" if cost != FREQUENCY else "")
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9, title=title, title_fontsize=8)
    return figure
