"""`hexmj flss`."""

from typing import TYPE_CHECKING

from hexmj.commands.printing import (
    conditions_line,
    new_table,
    physical_report,
    print_json,
    report_line,
    save_figure,
    show,
)
from hexmj.loss_frequency import SAMPLE, flss
from hexmj.presets import load_model, model_title
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    from hexmj.cli import Flss


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

        title = f"{model_title(options.model)}, {kind} FLSS, {starts} starts, window {conditions.window}"
        files = [
            save_dataset(table, options.out / "flss.nc"),
            save_figure(figures.flss_figure(table, title), options.out / "flss.png"),
            save_manifest(table.attrs, options.out / "manifest.json"),
        ]
    columns = [str(name) for name, values in table.items() if values.dims == ("velocity",)]
    report = physical_report(table) if options.physical else {}
    if options.json:
        lists = {"velocity": table.velocity.values.tolist()} | {c: table[c].values.tolist() for c in columns}
        print_json(lists | ({"report": report} if report else {}) | {"settings": table.attrs, "files": files})
    else:
        rows = new_table("V", *columns)
        for v in table.velocity.values:
            one = table.sel(velocity=v)
            rows.add_row(f"{v:g}", *(f"{one[c].item():.4g}" for c in columns))
        lines = [conditions_line(conditions, options.physical), *([report_line(report)] if report else [])]
        show(f"{kind} FLSS of {options.model}, {starts} starts", rows, *lines, *map(str, files))
