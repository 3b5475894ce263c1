"""`hexmj converge`."""

from typing import TYPE_CHECKING

from hexmj.commands.printing import conditions_line, interval, new_table, print_json, save_figure, show
from hexmj.errors import InputError
from hexmj.physics.body import Body
from hexmj.presets import load_model
from hexmj.progress import progress_bar
from hexmj.results import results_folder, save_dataset, save_manifest

if TYPE_CHECKING:
    from hexmj.cli import Converge


def run_converge(options: "Converge") -> None:
    """`hexmj converge`: measured polygon and falls against the plan, as V_p goes to zero."""
    from hexmj.comparison import MEASURES
    from hexmj.trust.static_limit import DISTANCES, REPORTED, VARIED, converge
    from hexmj.trust.static_limit_figure import static_limit_figure

    _check_body(options)
    model, conditions = load_model(options.model), options.conditions
    out = results_folder(options.out, ("converge.nc", "converge.png", "manifest.json"))
    with progress_bar("walking slower and slower") as progress:
        result = converge(
            model,
            out / "walks",
            velocity=options.velocity,
            vps=options.vps,
            leg_masses=options.leg_masses,
            starts=options.starts,
            window=conditions.time,
            seed=conditions.seed,
            body=conditions.body,
            progress=progress,
            **conditions.options,
        )
    files = [
        save_dataset(result, out / "converge.nc"),
        save_figure(static_limit_figure(result), out / "converge.png"),
        save_manifest(result.attrs, out / "manifest.json"),
    ]
    means = result.drop_vars(MEASURES.values()).mean("start")
    if options.json:
        lists = {str(name): means[name].values.tolist() for name in means.variables}
        print_json(lists | {"settings": result.attrs, "files": files})
    else:
        frequencies = new_table("legs", "V_p", *MEASURES, "agreement")
        distances = new_table("legs", "V_p", *DISTANCES, *REPORTED)
        for mass in result.leg_mass.values:
            for vp in result.vp.values:
                one = means.sel(leg_mass=mass, vp=vp)
                intervals = (interval(one, measure) for measure in MEASURES)
                off = (f"{one[name].item():.3f}" for name in (*DISTANCES, *REPORTED))
                frequencies.add_row(f"{mass:g}", f"{vp:g}", *intervals, f"{one.agreement.item():.3f}")
                distances.add_row(f"{mass:g}", f"{vp:g}", *off)
        show(
            f"{options.model}, V = {options.velocity:g}, {options.starts} starts: FLSS, with 95 % intervals",
            frequencies,
            "Distances from the plan [mm] until it loses stability, the fraction of steps in which the same feet stand,"
            " slip [mm/s] and tracking [mm] to the end",
            distances,
            conditions_line(conditions, physical=True, varied=VARIED),
            *map(str, files),
        )


def _check_body(options: "Converge") -> None:
    """Refuse one V_p or mass where a list is wanted."""
    body = options.conditions.body
    for name, usual, wanted in (("vp", Body.vp, "--vps"), ("leg-mass", Body.leg_mass, "--leg-masses")):
        if (given := getattr(body, name.replace("-", "_"))) != usual:
            raise InputError(f"--{name} = {given:g}; expected {wanted}, which takes all of them")
