"""`hexmj search`."""

from dataclasses import asdict
from typing import TYPE_CHECKING

from hexmj.commands.printing import conditions_line, interval, new_table, print_json, save_figure, save_model, show
from hexmj.errors import InputError
from hexmj.loss_frequency import SAMPLE
from hexmj.parameters import HWS, LDVS
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_manifest

if TYPE_CHECKING:
    from hexmj.cli import Search
    from hexmj.search.problems import Problem
    from hexmj.search.stages import Plan


def run_search(options: "Search") -> None:
    """`hexmj search`: the best parameters for one velocity or a range, and a verdict on fresh starts."""
    from hexmj.search.convergence import convergence_figure
    from hexmj.search.forms import FORMS
    from hexmj.search.problems import Sample
    from hexmj.search.stages import search

    conditions = options.conditions
    if options.verdict_seed == conditions.seed:
        raise InputError(f"--verdict-seed = {options.verdict_seed} is also --seed; expected another, for fresh starts")
    problem, plan = _search_settings(options)
    size = options.verdict_starts if options.verdict_starts is not None else 200 if options.physical else 7 * SAMPLE
    fresh = Sample.draw(problem, size, options.verdict_seed, conditions.threads)
    out = results_folder(options.out, ("history.nc", "found.toml", "convergence.png", "manifest.json"))
    with progress_bar("searching") as progress:
        found = search(problem, plan, path=out / "history.nc", threads=conditions.threads, progress=progress)
    form = FORMS[problem.form]
    models = {"found": form.model(found.vector), "hws": HWS, "ldvs": LDVS}
    verdict = fresh.verdict(models)
    at = f"V = {problem.low:g}" if problem.low == problem.high else f"V from {problem.low:g} to {problem.high:g}"
    kind = "physical" if options.physical else "kinematic"
    title = f"{problem.form}, {kind} FLSS at {at}, window {problem.window}, {plan.algorithm}, seed {plan.seed}"
    told = {
        "problem": asdict(problem),
        "plan": asdict(plan),
        "found": dict(zip(form.names, found.vector.tolist(), strict=True)),
    }
    told |= {"verdict_starts": size, "verdict_seed": options.verdict_seed}
    files = [
        out / "history.nc",
        save_model(models["found"], f"hexmj search: {title}", out / "found.toml"),
        save_figure(convergence_figure(found.history, title), out / "convergence.png"),
        save_manifest(told, out / "manifest.json"),
    ]
    evaluations, windows = found.history.sizes["evaluation"], verdict.window.values.tolist()
    if options.json:
        judged = {
            name: {w: {key: verdict[key].sel(model=name, window=w).item() for key in verdict} for w in windows}
            for name in models
        }
        counts = {"cost": found.cost, "evaluations": evaluations, "replayed": found.replayed}
        print_json({"found": told["found"]} | counts | {"verdict": judged, "settings": told, "files": files})
    else:
        weights, judged = new_table("parameter", *models), new_table("model", *(f"window {w}" for w in windows))
        for row in zip(form.names, *(form.vector(model) for model in models.values()), strict=True):
            weights.add_row(row[0].replace("_", " "), *(f"{value:.4g}" for value in row[1:]))
        for name in models:
            judged.add_row(name, *(interval(verdict.sel(model=name, window=w), "flss") for w in windows))
        show(
            title,
            weights,
            f"{kind} FLSS on {size} fresh starts (seed {options.verdict_seed}), with 95 % intervals",
            judged,
            f"{evaluations} evaluations, {found.replayed} of them from an earlier run; least cost {found.cost:.4g}",
            conditions_line(conditions, options.physical),
            *map(str, files),
        )


def _search_settings(options: "Search") -> "tuple[Problem, Plan]":
    """What to minimise and how, with fewer starts for physical walks."""
    from hexmj.search.problems import Problem
    from hexmj.search.stages import Plan

    if options.velocity is not None and options.velocities is not None:
        raise InputError("--velocity and --velocities were both given; expected one velocity or one range")
    v = options.velocity if options.velocity is not None else 0.3
    low, high = options.velocities or (v, v)
    conditions = options.conditions
    body = conditions.body if options.physical else None
    acceleration = conditions.options["acceleration"]
    problem = Problem(options.form, low, high, conditions.time, conditions.network, acceleration, body)
    few, many = (50, 100) if options.physical else (500, 7 * SAMPLE)
    return problem, Plan(
        algorithm=options.algorithm,
        population=options.population,
        domain=options.domain,
        begin=load_model(options.begin) if options.begin else None,
        starts=options.starts if options.starts is not None else few,
        budget=options.budget,
        refine_starts=options.refine_starts if options.refine_starts is not None else many,
        refine_budget=options.refine_budget,
        seed=conditions.seed,
    )
