"""`hexmj terrain`."""

from dataclasses import replace
from typing import TYPE_CHECKING

from hexmj.commands.printing import conditions_line, interval, new_table, print_json, save_figure, show
from hexmj.errors import InputError
from hexmj.physics.body import Body
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.cli import Conditions, Terrain

TABLED = ("flss", "flss_low", "flss_high", "reached", "crossed")
"""What is printed as JSON of every obstacle, grasp and velocity."""


def run_terrain(options: "Terrain") -> None:
    """`hexmj terrain`: how often the insect falls at steps, gaps, hurdles and on rough ground."""
    from hexmj.experiments.terrain import VARIED, terrain
    from hexmj.experiments.terrain_figure import terrain_figure

    model, conditions = load_model(options.model), options.conditions
    _check_conditions(conditions)
    out = results_folder(options.out, ("terrain.nc", "terrain.png", "manifest.json"))
    with progress_bar("walking to obstacles") as progress:
        result = terrain(
            model,
            out / "walks",
            velocities=options.velocities,
            grounds=options.grounds,
            heights=options.heights,
            lengths=options.lengths,
            grasps=options.grasps,
            starts=options.starts,
            seed=conditions.seed,
            body=conditions.body,
            network=conditions.network,
            threads=conditions.threads,
            progress=progress,
        )
    files = [
        save_dataset(result, out / "terrain.nc"),
        save_figure(terrain_figure(result), out / "terrain.png"),
        save_manifest(result.attrs, out / "manifest.json"),
    ]
    if options.json:
        lists = {str(name): result[name].values.tolist() for name in (*result.coords, *TABLED)}
        print_json(lists | {"settings": result.attrs, "files": files})
    else:
        velocities = result.velocity.values
        table = new_table("obstacle", "grasp", *(f"V = {v:g}" for v in velocities), "crossed", "fell on")
        for name in result.obstacle.values:
            for grasp in result.grasp.values:
                one = result.sel(obstacle=name, grasp=grasp)
                frequencies = (interval(one.sel(velocity=v), "flss") for v in velocities)
                crossed = f"{one.crossed.sum().item()} of {one.reached.sum().item()}"
                table.add_row(name, f"{grasp:g}", *frequencies, crossed, _parts(one))
        told = replace(conditions, window=f"{result.attrs['distance']:g} / V")
        show(
            f"{options.model}, {options.starts} starts: FLSS once the obstacle has been reached, with 95 % intervals",
            table,
            conditions_line(told, physical=True, varied=tuple(VARIED)),
            *map(str, files),
        )


def _parts(one: "xr.Dataset") -> str:
    """Parts of the trunk that touched the ground first after an obstacle had been reached, most frequent first."""
    from hexmj.physics.insect import TRUNK

    parts = one.fall_part.values[one.after.values].astype(int)
    counts = {part: int((parts == i).sum()) for i, part in enumerate(TRUNK)}
    return ", ".join(f"{part} {n}" for part, n in sorted(counts.items(), key=lambda item: -item[1]) if n)


def _check_conditions(conditions: "Conditions") -> None:
    """Refuse what the lists give, and what would leave the distance walked open."""
    from hexmj.experiments.terrain import VARIED

    for name, option in VARIED.items():
        if (given := getattr(conditions.body, name)) != getattr(Body, name):
            raise InputError(f"--{name.replace('_', '-')} = {given}; expected {option}, which takes all of them")
    for name, usual in {"window": "walk", "acceleration": None}.items():
        if (given := getattr(conditions, name)) != usual:
            raise InputError(f"--{name} = {given}; expected none: each start walks a distance at a constant velocity")
