"""The league: controllers against tasks, as tables and figures."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import VARIED, known_names, load_controller
from hexmj.io import markdown_table, settings
from hexmj.measures.figures import network_rules, starts_in_words
from hexmj.plotting import SERIES, head, in_figure, picture, tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FEWER = "\N{BULLET}"
"""Mark of a cell from which refused starts are left out."""

OWN = ("own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
NETWORK = ("uncoordinated", "hws", "ldvs", "ldvs-tripod", *OWN)
"""Weight sets of the 1998 network that take part in the league."""

EVERYONE = (*NETWORK, "ldvs-replans", "ldvs-reflexes", *BASELINES)
"""Names of all controllers of the league."""

FOUR = ("ldvs", "graham", "walknet", "free")
"""Names of the controllers of a quick league."""

TASKS = (
    "slow", "fast", "curve", "sideways", "turn", "stop-and-go", "push", "front-leg-lost", "step", "gap", "stairs",
    "slope", "soft", "noise",
)  # fmt: skip
"""Names of the tasks of the league."""

MEANS = {
    "lost": "lost",
    "path_distance": "off path",
    "heading_error": "heading",
    "progress": "progress",
    "margin": "margin",
    "cost": "cost",
    "recovery": "recovery",
}
"""Variable of a result of `runner.run_task` -> its heading in the table of a task."""

ABOUT = (
    "walks: number of walks that count; with events, those that do not fall before the first event;"
    " fell, lost: frequencies of falls and of losses of static stability of the plan, with 95 % intervals; off path:"
    " RMS distance to the commanded path [mm]; heading: its error at the end [rad]; progress: distance along the path"
    " over the commanded one; margin: static margin over the length of the shortest leg; cost: cost of transport;"
    " recovery: median time after a push [time units]. Means over walks without a fall; -: none"
)
"""Explanation of the columns of a task's table."""


def entrants(names: Sequence[str]) -> dict[str, Controller]:
    """Load controllers and return them by distinct names for tables: hexmj's own names, else the controller's `name`.

    Raises:
        InputError: there is no controller of this name.
    """
    found, known, short = {name: load_controller(name) for name in names}, {*known_names()}, {}
    for name, controller in found.items():
        varied = VARIED.fullmatch(name)
        short[name] = name if (varied["name"] if varied else name) in known else controller.name
    often = Counter(short.values())
    return {name if often[short[name]] > 1 else short[name]: controller for name, controller in found.items()}


def task_rows(result: "xr.Dataset", task: str) -> list[tuple[str, ...]]:
    """Return a row of texts for each controller in a task: name, number of walks that count, frequency of falls,
    `MEANS`, and refused starts."""
    rows = []
    for name in result.controller.values.tolist():
        cell = result.sel(task=task, controller=name)
        means = (frequency(cell, key) if key == "lost" else two_digits(cell[key].item()) for key in MEANS)
        counts = str(cell.fell_starts.item()), frequency(cell, "fell")
        rows.append((name, *counts, *means, str(cell.n_refused.item())))
    return rows


def matrix_rows(result: "xr.Dataset") -> list[tuple[str, ...]]:
    """Return a row of texts for each controller: its name and the frequency of falls in each task."""
    controllers = settings(result)["controllers"]
    rows = []
    for name in result.controller.values.tolist():
        rules = f" ({words})" if (words := network_rules(controllers[name])) else ""
        cells = (result.sel(task=task, controller=name) for task in result.task.values)
        rows.append((name + rules, *(frequency(cell, "fell") for cell in cells)))
    return rows


def league_markdown(result: "xr.Dataset") -> str:
    """Return all tables of a result as Markdown: falls in all tasks, then a table for each task."""
    tasks, recorded = result.task.values.tolist(), settings(result)
    starts = f"{starts_in_words(recorded['starts'])} in each cell, seed {recorded['seed']}"
    parts = [
        f"### Frequency of falls, 95 % intervals; {starts}",
        *markdown_table(("controller", *tasks), matrix_rows(result)),
    ]
    parts += ["", ABOUT + "."]
    for task in tasks:
        about = recorded["tasks"][task]["about"]
        columns = ("controller", "walks", "fell", *MEANS.values(), "refused")
        parts += ["", f"### {task}: {about}", *markdown_table(columns, task_rows(result, task))]
    return "\n".join(parts) + "\n"


def frequency(cell: "xr.Dataset", name: str) -> str:
    """Return the text of a scalar frequency with its interval, such as ".52 (.39-.64)"; "-" if it is NaN."""
    middle, low, high = (_short(cell[name + end].item()) for end in ("", "_low", "_high"))
    return "-" if middle == "nan" else f"{middle} ({low}-{high})"


def two_digits(value: float) -> str:
    """Return the text of a number with two digits after the point; "-" for NaN and "never" for inf."""
    return "-" if np.isnan(value) else "never" if np.isinf(value) else f"{value:.2f}"


def _short(value: float) -> str:
    """Return a number with two digits after the point and without a leading zero."""
    return f"{value:.2f}".replace("0.", ".", 1) if value < 1.0 else f"{value:.2g}"


def matrix_figure(result: "xr.Dataset") -> "Figure":
    """Draw the frequencies of falls: a row for each controller, a column for each task, with 95 % intervals."""
    shown = result.transpose("controller", "task", ...)
    names, tasks = shown.controller.values.tolist(), shown.task.values.tolist()
    figure = picture(max(5.0, 2.0 + 0.6 * len(tasks)), 2.6 + 0.36 * len(names))
    axes, fell = figure.subplots(), shown.fell.values
    image = axes.imshow(fell, aspect="auto", cmap="YlOrRd", vmin=0.0, vmax=1.0)
    dark = image.to_rgba(fell)[..., :3] @ [0.3, 0.59, 0.11] < 0.5
    for i, j in np.argwhere(np.isfinite(fell)):
        cell, style = shown.isel(controller=i, task=j), {"color": "white" if dark[i, j] else "0.1", "fontsize": 9}
        middle, low, high = (_short(cell[f"fell{end}"].item()) for end in ("", "_low", "_high"))
        mark = FEWER if cell.n_refused.item() else ""
        axes.text(j, i - 0.22, f"{middle}{mark}", ha="center", va="center", fontweight="bold", **style)
        axes.text(j, i + 0.22, f"{low}-{high}", ha="center", va="center", **style)
    axes.tick_params(which="both", length=0)
    axes.spines[:].set_visible(False)
    axes.xaxis.tick_top()
    axes.set_xticks(range(len(tasks)), tasks, fontsize=9, rotation=40, ha="left")
    axes.set_yticks(range(len(names)), [in_figure(name) for name in names], fontsize=9)
    known = np.nan_to_num(fell.mean(axis=0), nan=-1.0)
    finding = f"most falls in the task '{tasks[known.argmax()]}': {known.max():.2f} of the walks, on average"
    recorded = settings(result)
    starts = f"{starts_in_words(recorded['starts'])} in each cell, seed {recorded['seed']}"
    refused = f"{FEWER} refused starts are left out" if shown.n_refused.any() else ""
    head(figure, finding, starts, "frequency of falls and its 95 % interval", refused)
    return figure


def cost_figure(result: "xr.Dataset") -> "Figure":
    """Draw the static margin against the cost of transport in the first two tasks with a path, a point per controller.

    Walks with a fall do not count. Where points are close, only the one with the wider margin has a name.
    """
    tasks = [task for task in result.task.values if result.cost.sel(task=task).notnull().sum() > 1][:2]
    figure, best = picture(2.0 + 4.0 * len(tasks), 5.0), []
    panels = figure.subplots(1, max(1, len(tasks)), squeeze=False, sharey=True)[0]
    for axes, task in zip(panels, tasks, strict=False):
        data = result.sel(task=task)
        data = data.isel(controller=np.flatnonzero(data.cost.notnull())).sortby("margin", ascending=False)
        axes.plot(data.cost, data.margin, linestyle="none", marker="o", markersize=5, color=SERIES[0]["color"])
        axes.set(title=task, xlabel="cost of transport", ylabel="mean static margin / leg length")
        axes.label_outer()
        axes.margins(x=0.3)
        tidy(axes)
        width, named = np.ptp(axes.get_xlim()), []
        for name, x, y in zip(data.controller.values, data.cost.values, data.margin.values, strict=True):
            if all(abs(x - x0) > 0.3 * width or abs(y - y0) > 0.012 for x0, y0 in named):
                axes.annotate(in_figure(name), (x, y), xytext=(4, 2), textcoords="offset points", fontsize=9)
                named.append((x, y))
        best.append(f"{data.controller.values[0]} ({task})")
    starts = f"{starts_in_words(settings(result)['starts'])} of each controller"
    head(figure, f"widest margins: {', '.join(best)}", starts, "means over walks without a fall")
    return figure
