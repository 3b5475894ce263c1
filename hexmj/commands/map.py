"""`hexmj map`."""

from typing import TYPE_CHECKING

from hexmj.commands.printing import conditions_line, interval, new_table, print_json, save_figure, show
from hexmj.errors import InputError
from hexmj.physics.body import Body
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.cli import Map

DIFFERENCES = ("dynamics", "change")
"""Paired differences of a map."""


def run_map(options: "Map") -> None:
    """`hexmj map`: physical FLSS over the velocity and one condition of the body, and why the starts fall or do not."""
    from hexmj.comparison import MEASURES
    from hexmj.experiments.mechanisms import MECHANISMS
    from hexmj.experiments.stability_map import stability_map
    from hexmj.experiments.stability_map_figures import map_figure, mechanisms_figure

    model, conditions, over = load_model(options.model), options.conditions, options.over
    usual = getattr(Body, over)
    if (given := getattr(conditions.body, over)) != usual:
        raise InputError(f"--{over.replace('_', '-')} = {given:g}; expected --values, which takes all of them")
    names = [f"{over}.{end}" for end in ("nc", "png")] + [f"{over}-mechanisms.png", f"{over}-manifest.json"]
    out = results_folder(options.out, names)
    with progress_bar(f"walking over {over}") as progress:
        result = stability_map(
            model,
            over,
            out / "cells",
            values=options.values,
            velocities=options.velocities,
            starts=options.starts,
            window=conditions.time,
            seed=conditions.seed,
            body=conditions.body,
            progress=progress,
            **conditions.options,
        )
    files = [
        save_dataset(result, out / f"{over}.nc"),
        save_figure(map_figure(result), out / f"{over}.png"),
        save_figure(mechanisms_figure(result), out / f"{over}-mechanisms.png"),
        save_manifest(result.attrs, out / f"{over}-manifest.json"),
    ]
    if options.json:
        told = result.drop_dims("start")
        lists = {str(name): told[name].values.tolist() for name in told.variables}
        print_json(lists | {"starts": result.sizes["start"], "settings": result.attrs, "files": files})
        return
    measures = new_table("value", "V", "Froude", *MEASURES)
    differences = new_table("value", "V", "static", "saved", *DIFFERENCES)
    reasons = new_table("V", "starts that", *(f"{value:g}" for value in result.value.values))
    for value in result.value.values:
        for v in result.velocity.values:
            one, at = result.sel(value=value, velocity=v), (f"{value:g}", f"{v:g}")
            measures.add_row(*at, f"{one.froude.item():.2g}", *(interval(one, name) for name in MEASURES))
            changes = (_difference(one, name) for name in DIFFERENCES)
            saved = interval(one, "saved") if one.static.item() else "none lost"
            differences.add_row(*at, f"{one.static.item():.3f}", saved, *changes)
    for v in result.velocity.values:
        for name in MECHANISMS:
            counts = result["count"].sel(velocity=v, mechanism_name=name).values
            reasons.add_row(f"{v:g}", name.replace("_", " "), *map(str, counts))
    stand = ", ".join(f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True))
    show(
        f"{options.model} over {over}: FLSS, with 95 % intervals",
        measures,
        "Saved: of the starts that are statically lost, those that do not fall; dynamics: physical less static FLSS;"
        f" change: physical FLSS less that at {over} = {result.attrs['reference']:g}",
        differences,
        f"Why they fall or do not, numbers of starts at each {over}",
        reasons,
        f"{result.sizes['start']} of {options.starts} starts, which stand on six feet at every value ({stand})",
        conditions_line(conditions, physical=True, varied=(over,)),
        *map(str, files),
    )


def _difference(one: "xr.Dataset", name: str) -> str:
    middle, low, high = (one[name + end].item() for end in ("", "_low", "_high"))
    return f"{middle:+.2f} ({low:+.2f} to {high:+.2f})".replace("0.", ".")
