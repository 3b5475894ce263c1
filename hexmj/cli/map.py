"""`hexmj map`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Fixed, OmitArgPrefixes, Suppress

from hexmj.cli.options import Accelerating, Controlled, ControllerName, Sweepers, Walks
from hexmj.cli.sweep import lists_of, run_study
from hexmj.cli.tables import conditions_line, interval, new_table, print_json, show
from hexmj.conditions import Conditions
from hexmj.measures.compare import MEASURES
from hexmj.studies.stability_map.study import Over, StabilityMap

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

DIFFERENCES = ("dynamics", "change")
"""Paired differences of a map."""


@dataclass(frozen=True)
class _Controlled(Controlled):
    """A map refuses controllers that read the legs."""

    feedback: Annotated[bool, Fixed, Suppress] = False


@dataclass(frozen=True)
class Map:
    """Physical FLSS over the velocity and one condition, and why starts fall or do not.

    Repeat the command to go on with a run that was stopped.
    """

    over: Over = StabilityMap.over
    """The condition that is varied."""
    values: Sequence[float] = ()
    """Its values, in its own unit; five usual ones unless given."""
    velocities: Sequence[float] = StabilityMap.velocities
    """Velocities V_r as fractions of V_p, 0 <= V < 1."""
    model: ControllerName = "ldvs"
    starts: int = StabilityMap.n_starts
    """Number of random starts, the same for every value and velocity."""
    out: Path = Path("results/map")
    """Folder for figures, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    accelerating: OmitArgPrefixes[Accelerating] = field(default_factory=Accelerating)
    controlled: OmitArgPrefixes[_Controlled] = field(default_factory=_Controlled)
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)

    def run(self) -> None:
        """Walk over all values, write the results, and print."""
        from hexmj.studies.stability_map.figure import map_figure, mechanisms_figure

        study = StabilityMap(
            self.controlled.controller(self.model),
            self.over,
            self.values,
            self.velocities,
            self.starts,
            self.walks.time,
            self.walks.seed,
            self.conditions,
            self.walks.stride,
            self.accelerating.procedure,
        )
        result, files = run_study(
            study, f"walking over {self.over}", self.out, self.sweepers,
            data=f"{self.over}.nc",
            figures={f"{self.over}.png": map_figure, f"{self.over}-mechanisms.png": mechanisms_figure},
            manifest=f"{self.over}-manifest.json",
        )  # fmt: skip
        if self.json:
            lists = lists_of(result.drop_dims("start")) | {"starts": result.sizes["start"]}
            print_json(lists | {"settings": result.attrs, "files": files})
            return
        measures, differences = _tables(result)
        stand = ", ".join(
            f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True)
        )
        show(
            f"{study.controller.name} over {self.over}: FLSS, with 95 % intervals",
            measures,
            "Saved: of the starts that are statically lost, those that do not fall; dynamics: physical less static"
            f" FLSS; change: physical FLSS less that at {self.over} = {result.attrs['reference']:g}",
            differences,
            f"Why they fall or do not, numbers of starts at each {self.over}",
            _reasons(result),
            f"{result.sizes['start']} of {self.starts} starts, which stand on six feet at every value ({stand})",
            conditions_line(
                self.walks, self.controlled, self.accelerating.procedure, self.conditions, varied=(self.over,)
            ),
            *map(str, files),
        )


def _tables(result: "xr.Dataset") -> "tuple[Table, Table]":
    """A row for each value and velocity: the measures, and what differs between them."""
    measures = new_table("value", "V", "Froude", *MEASURES)
    differences = new_table("value", "V", "static", "saved", *DIFFERENCES)
    for value in result.value.values:
        for v in result.velocity.values:
            one, at = result.sel(value=value, velocity=v), (f"{value:g}", f"{v:g}")
            measures.add_row(*at, f"{one.froude.item():.2g}", *(interval(one, name) for name in MEASURES))
            changes = (_difference(one, name) for name in DIFFERENCES)
            saved = interval(one, "saved") if one.static.item() else "none lost"
            differences.add_row(*at, f"{one.static.item():.3f}", saved, *changes)
    return measures, differences


def _reasons(result: "xr.Dataset") -> "Table":
    """A row for each velocity and mechanism, a column for each value."""
    table = new_table("V", "starts that", *(f"{value:g}" for value in result.value.values))
    for v in result.velocity.values:
        for name in result.mechanism_name.values:
            counts = result["count"].sel(velocity=v, mechanism_name=name).values
            table.add_row(f"{v:g}", name.replace("_", " "), *map(str, counts))
    return table


def _difference(one: "xr.Dataset", name: str) -> str:
    middle, low, high = (one[name + end].item() for end in ("", "_low", "_high"))
    return f"{middle:+.2f} ({low:+.2f} to {high:+.2f})".replace("0.", ".")
