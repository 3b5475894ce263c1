"""`hexmj disturb`."""

from typing import TYPE_CHECKING, get_args

from hexmj.commands.printing import conditions_line, interval, new_table, print_json, save_figure, show
from hexmj.errors import InputError
from hexmj.parameters import Acceleration
from hexmj.physics.body import Body
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

    from hexmj.cli import Conditions, Disturb


def run_disturb(options: "Disturb") -> None:
    """`hexmj disturb`: what a disturbance in mid-walk does on paper and in physics, and what three strategies buy."""
    from hexmj.experiments.disturbance import Kind
    from hexmj.experiments.disturbed_figure import disturbed_figure
    from hexmj.experiments.disturbed_frequencies import MEASURES
    from hexmj.experiments.disturbed_walks import PHYSICAL, Strategy, cases, disturb

    model, conditions, physical = load_model(options.model), options.conditions, not options.kinematic
    _check_conditions(conditions)
    without = () if physical else PHYSICAL
    disturbances = options.disturbances or tuple(kind for kind in get_args(Kind) if kind not in without)
    strategies = options.strategies or tuple(one for one in get_args(Strategy)[1:] if one not in without)
    walked = cases(disturbances, options.impulses, strategies, physical)
    out = results_folder(options.out, ("disturb.nc", "disturb.png", "manifest.json"))
    with progress_bar("disturbing walks") as progress:
        result = disturb(
            model,
            out / "walks",
            walked,
            velocities=options.velocities,
            starts=options.starts,
            window=conditions.time,
            seed=conditions.seed,
            recovery=Acceleration(options.recovery, conditions.initial_velocity),
            adhesion=options.adhesion,
            physical=physical,
            body=conditions.body,
            network=conditions.network,
            threads=conditions.threads,
            progress=progress,
        )
    files = [
        save_dataset(result, out / "disturb.nc"),
        save_figure(disturbed_figure(result), out / "disturb.png"),
        save_manifest(result.attrs, out / "manifest.json"),
    ]
    if options.json:
        told = result.drop_dims("start")
        lists = {str(name): told[name].values.tolist() for name in told.variables}
        print_json(lists | {"settings": result.attrs, "files": files})
        return
    found = ", ".join(f"{n} at V = {v:g}" for n, v in zip(result.drawn.values, result.velocity.values, strict=True))
    show(
        *(part for measure in MEASURES if measure in result for part in _tables(result, measure)),
        "takes off: how much lower than without a strategy, on the same starts",
        f"{options.model}; {options.starts} starts whose plan is stable until it is disturbed, the first of {found}",
        f"slow down to V = {conditions.initial_velocity:g}, then a = {options.recovery:g}; grasp {options.adhesion:g}",
        conditions_line(conditions, physical=physical),
        *map(str, files),
    )


def _tables(result: "xr.Dataset", measure: str) -> "list[str | Table]":
    """FLSS by one measure and what the strategies take off it, each under its heading."""
    strategy = result.strategy.values
    shown = [n for n, one in enumerate(strategy) if measure == "physical" or one != "grasp"]
    answered, slow = [n for n in shown if strategy[n] != "none"], [n for n in shown if strategy[n] == "slow_down"]
    least = result[f"{measure}_reached"].min().item()
    parts: list[str | Table] = [
        f"{measure} FLSS from the disturbance on, at least {least} starts, with 95 % intervals"
        + (", to the end of the window, which begins at full velocity again" if slow else ""),
        _table(result.sel(window="whole").isel(case=shown), measure),
    ]
    if slow:
        short = _table(result.sel(window="short").isel(case=slow), measure)
        parts += ["The same if the window begins with the disturbance", short]
    if answered:
        buys = _table(result.sel(window="whole").isel(case=answered), f"{measure}_buys")
        parts += [f"What a strategy takes off the {measure} FLSS", buys]
    return parts


def _table(result: "xr.Dataset", name: str) -> "Table":
    """A row for each case, a column for each velocity."""
    table = new_table("disturbance", "strategy", *(f"V = {v:g}" for v in result.velocity.values))
    for case in range(result.sizes["case"]):
        row = result.isel(case=case)
        cells = (interval(row.sel(velocity=v), name) for v in result.velocity.values)
        table.add_row(row.disturbance.item(), row.strategy.item().replace("_", " "), *cells)
    return table


def _check_conditions(conditions: "Conditions") -> None:
    """Refuse what the strategies give."""
    if (given := conditions.body.grasp) != Body.grasp:
        raise InputError(f"--grasp = {given:g}; expected --adhesion, which only the strategy 'grasp' has")
    if conditions.acceleration is not None:
        raise InputError(f"--acceleration = {conditions.acceleration:g}; expected --recovery, after slowing down")
