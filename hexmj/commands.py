"""What each command does: call the package, print a table or one JSON object, write the files."""

import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError, RenderingError
from hexmj.film.film import Film
from hexmj.loss_frequency import SAMPLE, draw_starts, flss, observation_time, settings
from hexmj.network import walk
from hexmj.parameters import HWS, LDVS, Model, Symmetric, load_model
from hexmj.physics.body import Body
from hexmj.progress import progress_bar
from hexmj.results import json_text, results_folder, save_dataset, save_manifest, write_whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from rich.table import Table

    from hexmj.cli import Compare, Conditions, Flss, Render, Reproduce, Search, Walk
    from hexmj.search.problems import Problem
    from hexmj.search.stages import Plan


TOLD = ("vp", "step_height", "standing_height", "lift_time", "friction", "contact_gap")
"""Conditions of a body that stand beside every physical measure; the others only if they are not the usual ones."""


def run_compare(options: "Compare") -> None:
    """`hexmj compare`: both FLSS, the measured polygon's, and the agreement per start."""
    from hexmj import figures
    from hexmj.comparison import AGREEMENT, MEASURES, compare

    models = {name: load_model(name) for name in options.models}
    if len(models) < max(1, len(options.models)):
        raise InputError(f"models = {list(options.models)}; expected at least one, and none of them twice")
    if clash := set(models) & {"velocity", "report", "settings", "files"}:
        raise InputError(f"a parameter file has the name {min(clash)!r}, which the results need; rename it")
    names = ("comparison.nc", "comparison.png", "manifest.json", "recording.nc", "gait.mp4")
    conditions, out = options.conditions, results_folder(options.out, names)
    with progress_bar("comparing") as progress:
        result = compare(
            models,
            options.velocities,
            starts=options.starts,
            window=conditions.time,
            seed=conditions.seed,
            body=conditions.body,
            progress=progress,
            **conditions.options,
        )
    files = [
        save_dataset(result, out / "comparison.nc"),
        _save_figure(figures.comparison_figure(result), out / "comparison.png"),
        save_manifest(result.attrs, out / "manifest.json"),
    ]
    no_video = None
    if not options.no_video:
        try:
            files.append(_typical_gait(models, result, conditions, out))
        except RenderingError as error:
            no_video = error
    report = _physical_report(result)
    if options.json:
        summary: dict[str, Any] = {"velocity": result.velocity.values.tolist()}
        for name in models:
            one = result.sel(model=name)
            keys = [m + end for m in MEASURES for end in ("", "_low", "_high")] + ["agreement", *AGREEMENT]
            summary[name] = {key: one[key].values.tolist() for key in keys}
        durations = {"duration": result.duration.values.tolist()}
        _print_json(summary | {"report": report, "settings": result.attrs | durations, "files": files})
    else:
        frequencies = _table("model", "V", "t", *MEASURES)
        answers = _table("model", "V", "agree", "both", "only kin.", "only phys.", "none", "speed")
        for name in models:
            for v in result.velocity.values:
                one = result.sel(model=name, velocity=v)
                intervals = (_interval(one, measure) for measure in MEASURES)
                frequencies.add_row(name, f"{v:g}", f"{one.duration.item():.0f}", *intervals)
                counts = [str(one[case].item()) for case in AGREEMENT]
                answers.add_row(name, f"{v:g}", f"{one.agreement.item():.2f}", *counts, _speeds(one))
        _print(
            "Frequency of the loss of static stability, with 95 % intervals",
            frequencies,
            "Starts by what happened: lost on paper (kin.), fell (phys.); speed over command",
            answers,
            _conditions_line(conditions, physical=True),
            _report_line(report),
            *map(str, files),
        )
    if no_video:
        print(f"hexmj: no video: {no_video}", file=sys.stderr)


def run_flss(options: "Flss") -> None:
    """`hexmj flss`: one FLSS over velocities."""
    model, conditions = load_model(options.model), options.conditions
    if options.out:
        results_folder(options.out, ("flss.nc", "flss.png", "manifest.json"))
    starts = options.starts if options.starts is not None else 200 if options.physical else 7 * SAMPLE
    kind, measure, extra = "kinematic", flss, {}
    if options.physical:
        from hexmj.comparison import physical_flss

        kind, measure, extra = "physical", physical_flss, {"body": conditions.body}
    with progress_bar(f"{kind} FLSS") as progress:
        table = measure(
            model,
            options.velocities,
            starts=starts,
            window=conditions.time,
            seed=conditions.seed,
            progress=progress,
            **extra,
            **conditions.options,
        )
    table.attrs = {"model": options.model, "physical": options.physical} | table.attrs
    files = []
    if options.out:
        from hexmj import figures

        title = f"{Path(options.model).stem}, {kind} FLSS, {starts} starts, window {conditions.window}"
        files = [
            save_dataset(table, options.out / "flss.nc"),
            _save_figure(figures.flss_figure(table, title), options.out / "flss.png"),
            save_manifest(table.attrs, options.out / "manifest.json"),
        ]
    columns = [str(name) for name, values in table.items() if values.dims == ("velocity",)]
    report = _physical_report(table) if options.physical else {}
    if options.json:
        lists = {"velocity": table.velocity.values.tolist()} | {c: table[c].values.tolist() for c in columns}
        _print_json(lists | ({"report": report} if report else {}) | {"settings": table.attrs, "files": files})
    else:
        rows = _table("V", *columns)
        for v in table.velocity.values:
            one = table.sel(velocity=v)
            rows.add_row(f"{v:g}", *(f"{one[c].item():.4g}" for c in columns))
        lines = [_conditions_line(conditions, options.physical), *([_report_line(report)] if report else [])]
        _print(f"{kind} FLSS of {options.model}, {starts} starts", rows, *lines, *map(str, files))


def run_walk(options: "Walk") -> None:
    """`hexmj walk`: one walk with its footfall diagram and stability margin."""
    from hexmj import figures, recording

    model, conditions = load_model(options.model), options.conditions
    out = results_folder(options.out, ("recording.nc", "walk.png", "manifest.json"))
    title = f"{Path(options.model).stem}, V = {options.velocity:g}"
    walked = _recorded(model, options.velocity, options.start, conditions, title, options.physical)
    told = {"velocity": options.velocity, "start": options.start, "physical": options.physical}
    acceleration, body = conditions.options["acceleration"], conditions.body
    told |= settings({options.model: model}, conditions.time, options.start + 1, conditions.seed, conditions.network,
                     acceleration, body)  # fmt: skip
    files = [
        recording.save_recording(walked, out / "recording.nc"),
        _save_figure(figures.walk_figure(walked), out / "walk.png"),
        save_manifest(told, out / "manifest.json"),
    ]
    summary = _summary(walked)
    if options.json:
        _print_json(summary | {"settings": told, "files": files})
    else:
        lines = [f"{key}: {_short(value)}" for key, value in summary.items()]
        _print(title, *lines, _conditions_line(conditions, options.physical), *map(str, files))


def run_render(options: "Render") -> None:
    """`hexmj render`: record if there is nothing to render yet, then render from the recordings."""
    from hexmj import recording
    from hexmj.film import gl
    from hexmj.film.video import render

    if len(options.recordings) > 2:
        raise InputError(f"{len(options.recordings)} recordings were given; expected one, or two for side by side")
    if options.recordings and options.beside:
        raise InputError("--beside was given with recordings; expected a second recording instead, or no recording")
    names = [name for name in (options.model, options.beside) if name and name != "planned"]
    models = [load_model(name) for name in names]
    shown = [recording.load_recording(path) for path in options.recordings]
    out = results_folder(options.out, ("gait.mp4", "recording-1.nc", "recording-2.nc"))
    if sentence := gl.missing():
        raise RenderingError(sentence)
    files = []
    if not shown:
        titles = [Path(name).stem for name in names]
        how = [(model, title, True) for model, title in zip(models, titles, strict=True)]
        if options.beside == "planned":
            how.insert(0, (models[0], f"{titles[0]}, planned", False))
        for i, (model, title, physical) in enumerate(how):
            one = _recorded(model, options.velocity, options.start, options.conditions, title, physical)
            files.append(recording.save_recording(one, out / f"recording-{i + 1}.nc"))
            shown.append(one)
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar("rendering") as progress:
        frames = render(shown, out / "gait.mp4", options.film, progress)
    files.append(out / "gait.mp4")
    summary = {"frames": frames, "film": asdict(options.film), "files": files}
    if options.json:
        _print_json(summary | {"recordings": [_summary(one) for one in shown]})
    else:
        _print(f"{frames} frames at {options.film.fps:g} per second", *map(str, files))
    for one in shown:
        one.close()


def run_search(options: "Search") -> None:
    """`hexmj search`: the best parameters for one velocity or a range, and a verdict on fresh starts."""
    from hexmj.search.convergence import convergence_figure
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
    models = {"found": Symmetric.from_vector(found.vector), "hws": HWS, "ldvs": LDVS}
    verdict = fresh.verdict(models)
    at = f"V = {problem.low:g}" if problem.low == problem.high else f"V from {problem.low:g} to {problem.high:g}"
    kind = "physical" if options.physical else "kinematic"
    title = f"{problem.form}, {kind} FLSS at {at}, window {problem.window}, {plan.algorithm}, seed {plan.seed}"
    told = {"problem": asdict(problem), "plan": asdict(plan), "found": asdict(models["found"])}
    told |= {"verdict_starts": size, "verdict_seed": options.verdict_seed}
    files = [
        out / "history.nc",
        _save_model(models["found"], f"hexmj search: {title}", out / "found.toml"),
        _save_figure(convergence_figure(found.history, title), out / "convergence.png"),
        save_manifest(told, out / "manifest.json"),
    ]
    evaluations, windows = found.history.sizes["evaluation"], verdict.window.values.tolist()
    if options.json:
        judged = {
            name: {w: {key: verdict[key].sel(model=name, window=w).item() for key in verdict} for w in windows}
            for name in models
        }
        counts = {"cost": found.cost, "evaluations": evaluations, "replayed": found.replayed}
        _print_json({"found": told["found"]} | counts | {"verdict": judged, "settings": told, "files": files})
    else:
        weights, judged = _table("parameter", *models), _table("model", *(f"window {w}" for w in windows))
        for key in asdict(HWS):
            weights.add_row(key.replace("_", " "), *(f"{getattr(model, key):.4g}" for model in models.values()))
        for name in models:
            judged.add_row(name, *(_interval(verdict.sel(model=name, window=w), "flss") for w in windows))
        _print(
            title,
            weights,
            f"{kind} FLSS on {size} fresh starts (seed {options.verdict_seed}), with 95 % intervals",
            judged,
            f"{evaluations} evaluations, {found.replayed} of them from an earlier run; least cost {found.cost:.4g}",
            _conditions_line(conditions, options.physical),
            *map(str, files),
        )


def run_reproduce(options: "Reproduce") -> None:
    """`hexmj reproduce`: the paper's claims, judged, and its figures."""
    from hexmj.paper.protocol import FULL, QUICK
    from hexmj.paper.reproduce import reproduce
    from hexmj.paper.table import HEADS, claims_json, summary

    protocol = replace(QUICK if options.quick else FULL, seed=options.seed)
    with progress_bar("reproducing") as progress:
        rows, files = reproduce(options.out, protocol, only=options.only, progress=progress)
    if options.json:
        _print_json(claims_json(rows, asdict(protocol)) | {"files": files})
    else:
        table = _table(*HEADS)
        for row in rows:
            table.add_row(*row.cells)
        _print("The claims of the 1998 paper", table, *summary(rows), *map(str, files))


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
        starts=options.starts if options.starts is not None else few,
        budget=options.budget,
        refine_starts=options.refine_starts if options.refine_starts is not None else many,
        refine_budget=options.refine_budget,
        seed=conditions.seed,
    )


def _recorded(
    model: Model, velocity: float, start: int, conditions: "Conditions", title: str, physical: bool
) -> "xr.Dataset":
    """A recording of one of the seed's starts."""
    from hexmj import recording
    from hexmj.physics.physical_walks import physical_walk

    if start < 0:
        raise InputError(f"start = {start}; expected at least 0")
    starts = draw_starts(start + 1, conditions.seed, conditions.network)[start:]
    acceleration = conditions.options["acceleration"]
    time = float(observation_time(conditions.time, np.array(velocity), conditions.network, acceleration))
    if not physical:
        plan = walk(starts, model, velocity, time, **conditions.options)
        return recording.record_plan(plan, conditions.body, conditions.network, title=title)
    with progress_bar("walking") as progress:
        walked = physical_walk(
            starts, model, velocity, time, body=conditions.body, progress=progress, **conditions.options
        )
    return recording.record(walked, title=title)


def _typical_gait(models: dict[str, Model], result: "xr.Dataset", conditions: "Conditions", out: Path) -> Path:
    """A video of the first model near V = 0.3, of the first start that neither fell nor lost stability, if any."""
    from hexmj import recording
    from hexmj.film import gl
    from hexmj.film.video import render

    if sentence := gl.missing():
        raise RenderingError(sentence)
    name, model = next(iter(models.items()))
    velocities = result.velocity.values
    v = float(velocities[np.abs(velocities - 0.3).argmin()])
    one = result.sel(model=name, velocity=v)
    start = int(np.argmax((np.isinf(one.planned_loss) & np.isinf(one.fall)).values))
    walked = _recorded(model, v, start, conditions, name, physical=True)
    recording.save_recording(walked, out / "recording.nc")
    with progress_bar("rendering") as progress:
        render([walked], out / "gait.mp4", Film(), progress)
    return out / "gait.mp4"


def _summary(walked: "xr.Dataset") -> dict[str, Any]:
    """When a recorded walk lost stability or fell [time units], and its least margins [mm]."""
    from hexmj.comparison import REPORTED
    from hexmj.physics.insect import TRUNK

    summary: dict[str, Any] = {
        "time units": float(walked.time[-1]),
        "planned loss": float(walked.planned_loss_time),
        "least planned margin [mm]": float(walked.planned_margin.min()),
    }
    if "measured_margin" in walked:
        part = int(walked.fall_part)
        summary |= {
            "measured loss": float(walked.measured_loss_time),
            "least measured margin [mm]": float(walked.measured_margin.min()),
            "fall": float(walked.fall_time),
            "fell on": TRUNK[part] if part >= 0 else None,
        }
        summary |= {_named(walked[name]): walked[name].item() for name in REPORTED}
    return summary


def _physical_report(result: "xr.Dataset") -> dict[str, float]:
    """How far the bodies did what they were told, over all walks of a comparison or a physical FLSS."""
    return {
        "mean slip [mm/s]": result.slip.mean().item(),
        "joints at their torque limit": result.saturation.mean().item(),
        "tip targets out of reach": result.unreachable.sum().item(),
        "least clearance [mm]": result.clearance.min().item(),
        "greatest tilt [rad]": result.tilt.max().item(),
    }


def _report_line(report: dict[str, float]) -> str:
    return "; ".join(f"{key}: {value:.3g}" for key, value in report.items())


def _named(value: "xr.DataArray") -> str:
    """Name and unit of one of a recording's numbers."""
    unit = value.attrs["units"]
    return f"{value.name} [{unit}]" if unit != "1" else str(value.name)


def _speeds(one: "xr.Dataset") -> str:
    """Least and greatest speed of the starts that did not fall, over the commanded one."""
    speed = one.speed.values[np.isinf(one.fall.values)]
    return f"{speed.min():.2f}-{speed.max():.2f}" if np.isfinite(speed).any() else "-"


def _conditions_line(conditions: "Conditions", physical: bool) -> str:
    """The conditions that stand beside every measure."""
    line = f"window {conditions.window} (t in time units); seed {conditions.seed}"
    if conditions.acceleration is not None:
        line += f"; a = {conditions.acceleration:g} from V = {conditions.initial_velocity:g}"
    if physical:
        told, usual = asdict(conditions.body), asdict(Body())
        line += "; " + ", ".join(f"{key} {told[key]}" for key in told if key in TOLD or told[key] != usual[key])
    return line


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _interval(one: "xr.Dataset", measure: str) -> str:
    flss, low, high = (one[measure + end].item() for end in ("", "_low", "_high"))
    return f"{flss:.3f} ({low:.2f}-{high:.2f})".replace("(0", "(").replace("-0", "-")


def _save_figure(figure: "Figure", path: Path) -> Path:
    return write_whole(path, lambda part: figure.savefig(part, dpi=150))


def _save_model(model: Symmetric, comment: str, path: Path) -> Path:
    """A TOML file that `load_model` reads to the same bits."""
    lines = [f"# {comment}", "[symmetric]", *(f"{key} = {value!r}" for key, value in asdict(model).items())]
    return write_whole(path, lambda part: part.write_text("\n".join(lines) + "\n", encoding="utf-8"))


def _table(*columns: str) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in columns:
        table.add_column(column.replace("_", " "), overflow="fold")
    return table


def _print(*parts: Any) -> None:
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    for part in parts:
        console.print(part, markup=False) if isinstance(part, str) else console.print(part)


def _print_json(value: dict[str, Any]) -> None:
    print(json_text(value))
