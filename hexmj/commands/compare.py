"""`hexmj compare`."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.commands.printing import (
    conditions_line,
    interval,
    new_table,
    physical_report,
    print_json,
    report_line,
    save_figure,
    show,
)
from hexmj.commands.recorded import recorded
from hexmj.errors import InputError, RenderingError, check_distinct
from hexmj.film.film import Film
from hexmj.parameters import Model
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.cli import Compare, Conditions


def run_compare(options: "Compare") -> None:
    """`hexmj compare`: both FLSS, the measured polygon's, and the agreement per start."""
    from hexmj import figures
    from hexmj.comparison import AGREEMENT, MEASURES, compare

    check_distinct("models", options.models)
    models = {name: load_model(name) for name in options.models}
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
        save_figure(figures.comparison_figure(result), out / "comparison.png"),
        save_manifest(result.attrs, out / "manifest.json"),
    ]
    no_video = None
    if not options.no_video:
        try:
            files.append(_typical_gait(models, result, conditions, out))
        except RenderingError as error:
            no_video = error
    report = physical_report(result)
    if options.json:
        summary: dict[str, Any] = {"velocity": result.velocity.values.tolist()}
        for name in models:
            one = result.sel(model=name)
            keys = [m + end for m in MEASURES for end in ("", "_low", "_high")] + ["agreement", *AGREEMENT]
            summary[name] = {key: one[key].values.tolist() for key in keys}
        durations = {"duration": result.duration.values.tolist()}
        print_json(summary | {"report": report, "settings": result.attrs | durations, "files": files})
    else:
        frequencies = new_table("model", "V", "t", *MEASURES)
        answers = new_table("model", "V", "agree", "both", "only kin.", "only phys.", "none", "speed")
        for name in models:
            for v in result.velocity.values:
                one = result.sel(model=name, velocity=v)
                intervals = (interval(one, measure) for measure in MEASURES)
                frequencies.add_row(name, f"{v:g}", f"{one.duration.item():.0f}", *intervals)
                counts = [str(one[case].item()) for case in AGREEMENT]
                answers.add_row(name, f"{v:g}", f"{one.agreement.item():.2f}", *counts, _speeds(one))
        show(
            "Frequency of the loss of static stability, with 95 % intervals",
            frequencies,
            "Starts by what happened: lost on paper (kin.), fell (phys.); speed over command",
            answers,
            conditions_line(conditions, physical=True),
            report_line(report),
            *map(str, files),
        )
    if no_video:
        print(f"hexmj: no video: {no_video}", file=sys.stderr)


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
    walked = recorded(model, v, start, conditions, name, physical=True)
    recording.save_recording(walked, out / "recording.nc")
    with progress_bar("rendering") as progress:
        render([walked], out / "gait.mp4", Film(), progress)
    return out / "gait.mp4"


def _speeds(one: "xr.Dataset") -> str:
    """Least and greatest speed of the starts that did not fall, over the commanded one."""
    speed = one.speed.values[np.isinf(one.fall.values)]
    return f"{speed.min():.2f}-{speed.max():.2f}" if np.isfinite(speed).any() else "-"
