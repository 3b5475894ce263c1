"""A search, the FLSS of its result on fresh starts, and its files: found.toml, the history and a figure."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.controllers.cruse1998 import HWS, LDVS, network_toml
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import parameter_file, searched_on
from hexmj.errors import InputError
from hexmj.files import read_toml, write_text
from hexmj.io import save, save_figure
from hexmj.plotting import LEGEND, as_shipped, head, in_figure, picture, tidy
from hexmj.progress import shown
from hexmj.search.forms import FieldsForm, NetworkForm
from hexmj.search.problems import Problem, Sample
from hexmj.search.stages import STAGES, Effort, Found, search

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FOUND = "found.toml"  # name of the found controller's file

EVALUATIONS = "evaluations"
"""Name of the directory of cached evaluations, which is inside the results directory."""


@dataclass(frozen=True, eq=False)
class Result:
    """The controller that a search found, and its FLSS on fresh starts beside that of known controllers."""

    problem: Problem
    effort: Effort
    found: Found
    vectors: dict[str, np.ndarray]
    """Parameters, (parameter,), of the found controller and of the compared controllers, by name."""
    verdict: "xr.Dataset"
    """FLSS with its 95 % interval on fresh starts, over controller."""
    files: list[Path]

    @property
    def settings(self) -> dict[str, Any]:
        """Problem and effort as plain data, which can be written as JSON."""
        return json.loads(self.found.history.attrs["settings"])

    def summary(self) -> dict[str, Any]:
        """Return parameters, cost, verdict and settings as plain data, which can be written as JSON."""
        found = self.found
        return {
            "found": dict(zip(self.problem.form.names, found.vector.tolist(), strict=True)),
            "cost": found.cost,
            "evaluations": found.history.sizes["evaluation"],
            "minimised": self.problem.minimised,
            "starts": found.starts,
            "verdict": self.verdict.to_dataframe().to_dict("index"),
            "settings": self.settings,
        }


def run_search(
    problem: Problem,
    effort: Effort,
    out: Path | str,
    *,
    threads: int | None = None,
    progress: bool = False,
    fresh: bool = False,
    figure: str = "convergence.png",
) -> Result:
    """Search, compute the FLSS of the found controller on fresh starts, and write all files.

    The found controller is compared with HWS and LDVS, or with the default fields of the searched controller.

    Args:
        problem: the cost function.
        effort: algorithm, budgets and starts.
        out: directory for the found controller (TOML), the history (NetCDF), its figure and the cached evaluations. An
            interrupted search resumes if it is called with the same settings, and gives equal results.
        threads: number of threads, by default one per core; the result does not depend on it.
        progress: whether to show progress bars.
        fresh: whether to discard the cached evaluations.
        figure: file name of the figure.

    Raises:
        InputError: a setting is invalid, `verdict_seed` is the seed of an involved search, or a controller cannot walk.
        SimulationError: a simulation fails.
    """
    effort = effort.completed(physical=problem.physical)
    earlier = _earlier_seeds(problem, effort)
    if effort.verdict_seed in {effort.seed, *earlier}:
        used = f"{sorted({effort.seed, *earlier})}, the seeds of this search and of earlier ones"
        raise InputError(f"verdict_seed = {effort.verdict_seed}; expected a seed other than {used}")
    begins = [Path(name).resolve() for name in (effort.begin, problem.form.name) if isinstance(name, str)]
    if (Path(out) / FOUND).resolve() in begins:
        raise InputError(f"out = {out}: the search begins with its {FOUND}; expected another directory")
    problem.domain(effort.domain, effort.beginning)  # raises InputError before a directory is made
    controllers, vectors = _compared(problem)
    judges = Sample(problem, effort.verdict_starts or 0, effort.verdict_seed)
    out = Path(out)
    judges.settle(threads)  # raises SimulationError before the search
    found = search(problem, effort, folder=out / EVALUATIONS, threads=threads, progress=progress, fresh=fresh)
    history = found.history.assign_attrs(title=title(problem, effort))
    head = f"# hexmj search: {title(problem, effort)}\nsearched = {{ seeds = {sorted({*earlier, effort.seed})} }}\n"
    files = [save(history, out / "history.nc"), write_text(out / FOUND, head + _controller_toml(problem, found.vector))]
    with as_shipped():
        files.append(save_figure(convergence_figure(history), out / figure))
    with shown(progress, "judging") as advance:
        verdict = judges.verdict({"found": problem.controller(found.vector), **controllers}, threads, advance)
    return Result(problem, effort, found, {"found": found.vector} | vectors, verdict, files)


def title(problem: Problem, effort: Effort) -> str:
    """Return the title of a search: form, cost, velocities, observation time and algorithm."""
    at = f"V = {problem.low:g}" if problem.low == problem.high else f"V from {problem.low:g} to {problem.high:g}"
    at += f", {problem.over} of all variants" if problem.over != "usual" else ""
    at += ", later losses first among equals" if problem.ties == "later" else ""
    method = f"observation time {problem.observation_time}, {effort.algorithm}, seed {effort.seed}"
    return f"{problem.form.name}, {problem.measure} {problem.frequency} at {at}, {method}"


def _earlier_seeds(problem: Problem, effort: Effort) -> set[int]:
    """Return the seeds of the earlier searches that found the controllers with which this search begins."""
    begins = [problem.form.name] if isinstance(problem.form, FieldsForm) else []
    if effort.beginning is not None:
        begins.append(effort.begin if isinstance(effort.begin, str) else effort.beginning.name)
    return {seed for begin in begins for seeds in searched_on(begin).values() for seed in seeds}


def _compared(problem: Problem) -> tuple[Mapping[str, Controller], dict[str, np.ndarray]]:
    """Return the controllers that are compared with the found one, and their parameters, (parameter,), by name."""
    form = problem.form
    controllers: Mapping[str, Controller]
    if isinstance(form, FieldsForm):
        controllers, vectors = {"usual": form.usual}, {"usual": form.begin}
    else:
        sets, rules = {"hws": HWS, "ldvs": LDVS}, {"order": form.order, "model_variant": form.model_variant}
        controllers = {name: replace(network, **rules) for name, network in sets.items()}
        vectors = {name: form.parameters(network.weights) for name, network in sets.items()}
    if problem.feedback:
        controllers = {name: SensoryFeedback(inner) for name, inner in controllers.items()}
    return controllers, vectors


def _controller_toml(problem: Problem, vector: np.ndarray) -> str:
    """Return TOML text that `load_controller` reads back exactly: weights, or a controller and its fields."""
    import tomli_w

    form = problem.form
    if isinstance(form, NetworkForm):
        return network_toml(form.controller(vector))
    file = parameter_file(form.name)
    table: dict[str, Any] = read_toml(file) if file else {"controller": form.name}
    values = table.get("fields", {}) | dict(zip(form.names, vector.tolist(), strict=True))
    return tomli_w.dumps({"controller": table["controller"], "fields": values})


def convergence_figure(history: "xr.Dataset") -> "Figure":
    """Draw the costs of all candidates and the lowest cost so far over the evaluations, from `stages.history`."""
    figure, found = picture(8.0, 4.6), []
    axes = figure.subplots()
    for number, stage in enumerate(STAGES):
        part = history.isel(evaluation=history.stage.values == number).sortby("evaluation")
        if part.sizes["evaluation"]:
            evaluation, new = part.evaluation.values + 1, not found
            axes.plot(evaluation, part.cost, ".", color="0.6", markersize=3.5, label="candidate" if new else None)
            axes.plot(evaluation, part.best, color="0.1", linewidth=1.8, label="lowest so far" if new else None)
            axes.axvline(evaluation[0] - 0.5, color="0.4", linestyle=":", linewidth=1.0)
            axes.text(evaluation[0], 1.0, f" {stage}", va="top", fontsize=10)
            found.append(f"{part.best.values[0]:.2f} to {part.best.values[-1]:.2f} in the {stage}")
    cost = history.cost.attrs["long_name"]
    axes.set(xlabel="evaluations of the cost function", ylabel="cost on the starts of the stage", ylim=(-0.02, 1.02))
    head(figure, f"lowest cost so far: {', '.join(found)}", in_figure(history.attrs["title"]), f"cost: {cost}")
    tidy(axes)
    figure.legend(loc="outside lower center", ncols=2, **LEGEND)
    return figure
