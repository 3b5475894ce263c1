"""A search with a verdict on fresh starts, and its files: found.toml, the history and its figure."""

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
from hexmj.io import results_folder, save, save_figure
from hexmj.plain import plain
from hexmj.plotting import as_shipped, head, in_figure, picture, tidy
from hexmj.progress import shown
from hexmj.search.forms import FieldsForm, NetworkForm
from hexmj.search.problems import Problem, Sample
from hexmj.search.stages import STAGES, Effort, Found, search

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FOUND = "found.toml"

EVALUATIONS = "evaluations"
"""Directory of the cached evaluations, beside the results."""

COLOURS = dict(zip(STAGES, ("#1b6ca8", "#b3261e"), strict=True))


@dataclass(frozen=True, eq=False)
class Result:
    """What a search found, and how it compares on fresh starts."""

    problem: Problem
    effort: Effort
    found: Found
    vectors: dict[str, np.ndarray]
    """Parameters, (parameter,), of the found controller and of those with which it is compared, by name."""
    verdict: "xr.Dataset"
    """FLSS with its 95 % interval on fresh starts, over the same controllers and the observation times."""
    files: list[Path]

    @property
    def settings(self) -> dict[str, Any]:
        """Problem and effort as plain data."""
        effort = plain(self.effort)
        fresh = {name: effort.pop(name) for name in ("verdict_starts", "verdict_seed")}
        return {"problem": self.problem.settings(), "effort": effort} | fresh

    def summary(self) -> dict[str, Any]:
        """Return parameters, cost, verdict and settings as plain data."""
        found, judged = self.found, self.verdict.to_dataframe()
        names, times = judged.index.levels
        return {
            "found": dict(zip(self.problem.form.names, found.vector.tolist(), strict=True)),
            "cost": found.cost,
            "evaluations": found.history.sizes["evaluation"],
            "replayed": found.replayed,
            "minimised": self.problem.minimised,
            "lost": found.lost,
            "starts": found.starts,
            "refused": len(found.refused),
            "verdict": {name: {time: judged.loc[name, time].to_dict() for time in times} for name in names},
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
    """Search, judge what was found on fresh starts, and write it.

    The found controller is compared with HWS and LDVS, or with the usual values of the controller that is searched.

    Args:
        problem: the cost function.
        effort: algorithm, budgets and starts.
        out: directory for the found controller (TOML), the history (NetCDF), its figure and the cached evaluations. If
            a search is killed, the next one with the same settings resumes with equal results.
        threads: one per core by default; the result does not depend on them.
        progress: show bars.
        fresh: discard cached evaluations.
        figure: name of the figure's file.

    Raises:
        InputError: settings that make no sense, verdict starts on which a search was made, or a controller that does
            not walk.
        SimulationError: a simulation fails.
    """
    effort = effort.completed(physical=problem.conditions is not None)
    earlier = _earlier_seeds(problem, effort)
    if effort.verdict_seed in {effort.seed, *earlier}:
        searches = "this search and those that found its beginning"
        raise InputError(f"verdict_seed = {effort.verdict_seed}; expected another seed than those of {searches}")
    begins = [Path(name).resolve() for name in (effort.begin, problem.form.name) if isinstance(name, str)]
    if (Path(out) / FOUND).resolve() in begins:
        raise InputError(f"out = {out}: the search begins with {FOUND} there; expected another directory")
    problem.domain(effort.domain, effort.beginning)  # raises before a directory is made
    controllers, vectors = _compared(problem)
    judges = Sample(problem, effort.verdict_starts or 0, effort.verdict_seed)
    out = results_folder(out)
    judges.settle(threads)  # before the work, if a start does not
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
    """Return form, cost, velocities and algorithm of a search in words."""
    at = f"V = {problem.low:g}" if problem.low == problem.high else f"V from {problem.low:g} to {problem.high:g}"
    at += f", {problem.over} of all variants" if problem.over != "usual" else ""
    at += ", later losses first among equals" if problem.ties == "later" else ""
    kind = "physical" if problem.conditions else "kinematic"
    method = f"observation time {problem.observation_time}, {effort.algorithm}, seed {effort.seed}"
    return f"{problem.form.name}, {kind} FLSS at {at}, {method}"


def _earlier_seeds(problem: Problem, effort: Effort) -> set[int]:
    """Return the seeds of the searches that found what this search begins with."""
    begins = [problem.form.name] if isinstance(problem.form, FieldsForm) else []
    if effort.beginning is not None:
        begins.append(effort.begin if isinstance(effort.begin, str) else effort.beginning.name)
    return {seed for begin in begins for seeds in searched_on(begin).values() for seed in seeds}


def _compared(problem: Problem) -> tuple[Mapping[str, Controller], dict[str, np.ndarray]]:
    """Return the controllers with which the found one is compared, by name, and their parameters, (parameter,)."""
    form = problem.form
    controllers: Mapping[str, Controller]
    if isinstance(form, FieldsForm):
        controllers, vectors = {"usual": form.usual}, {"usual": form.begin}
    else:
        sets, rules = {"hws": HWS, "ldvs": LDVS}, {"order": form.order, "model_variant": form.model_variant}
        controllers = {name: replace(one, **rules) for name, one in sets.items()}
        vectors = {name: form.parameters(one.weights) for name, one in sets.items()}
    if problem.feedback:
        controllers = {name: SensoryFeedback(one) for name, one in controllers.items()}
    return controllers, vectors


def _controller_toml(problem: Problem, vector: np.ndarray) -> str:
    """Return the text that `load_controller` reads to the same bits: weights, or a controller and its fields."""
    import tomli_w

    form = problem.form
    if isinstance(form, NetworkForm):
        return network_toml(form.controller(vector))
    file = parameter_file(form.name)
    table: dict[str, Any] = read_toml(file) if file else {"controller": form.name}
    values = table.get("fields", {}) | dict(zip(form.names, vector.tolist(), strict=True))
    return tomli_w.dumps({"controller": table["controller"], "fields": values})


def convergence_figure(history: "xr.Dataset") -> "Figure":
    """Draw all candidates' costs and the least so far against the number of evaluations, from `stages.history`."""
    figure = picture(6.8, 4.2)
    axes = figure.subplots()
    for number, (stage, colour) in enumerate(COLOURS.items()):
        one = history.isel(evaluation=history.stage.values == number).sortby("evaluation")
        if one.sizes["evaluation"]:
            evaluation = one.evaluation + 1
            axes.plot(evaluation, one.cost, ".", color=colour, markersize=2.5, alpha=0.35)
            axes.plot(evaluation, one.best, color=colour, linewidth=1.8, label=stage)
    cost = history.cost.attrs["long_name"]
    label = f"{'FLSS' if cost == 'FLSS' else 'cost'} on the starts of the stage"
    axes.set(xlabel="evaluations of the cost function", ylabel=label, ylim=(-0.02, 1.02))
    head(figure, in_figure(history.attrs["title"]))
    tidy(axes)
    below = "lines: least so far, dots: candidates" + ("" if cost == "FLSS" else f"\ncost: {cost}")
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9, title=below, title_fontsize=8)
    return figure
