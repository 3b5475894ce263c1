"""`hexmj map`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Controlled, ControllerName, hiding
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import difference, interval, table
from hexmj.errors import InputError
from hexmj.measures.compare import MEASURES
from hexmj.measures.figures import starts_in_words
from hexmj.studies.stability_map import Over, StabilityMap

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

DIFFERENCES = ("dynamics", "change")
"""Paired differences of a map."""


@dataclass(frozen=True)
class Map(StudyCommand):
    """Options of `hexmj map`, which `commands.COMMANDS` describes."""

    over: Over = StabilityMap.over
    """The condition that is varied."""
    values: Sequence[float] | None = None
    """Its values, in its own unit; five usual ones unless given."""
    velocities: Sequence[float] = StabilityMap.velocities
    """Velocities V_r as fractions of V_p, 0 <= V < 1."""
    model: ControllerName = "ldvs"
    starts: int = StabilityMap.n_starts
    """Number of random starts, the same for every value and velocity."""
    out: Path = Path("results/map")
    """Folder for figures, NetCDF, manifest and finished walks."""
    controlled: OmitArgPrefixes[Controlled] = hiding(
        Controlled(), ["feedback"], "A map refuses controllers that read the legs."
    )

    def study(self) -> StabilityMap:
        if self.values is not None and not self.values:
            raise InputError("--values without numbers; expected at least one, or no --values for the usual ones")
        return StabilityMap(
            self.controlled.controller(self.model),
            self.over,
            self.values or (),
            self.velocities,
            n_starts=self.starts,
            conditions=self.conditions,
            **self.walked,
        )

    @property
    def outputs(self) -> Outputs:  # pyright: ignore[reportIncompatibleVariableOverride]
        from hexmj.studies.stability_map import map_figure, mechanisms_figure

        figures = {f"{self.over}.png": map_figure, f"{self.over}-mechanisms.png": mechanisms_figure}
        return Outputs(f"walking over {self.over}", f"{self.over}.nc", figures, f"{self.over}-manifest.json")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Everything over values and velocities, and how many starts are left."""
        return super().summary(result) | {"starts": result.sizes["start"]}

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The measures, what differs between them, the mechanisms, and the conditions."""
        measures, differences = _tables(result)
        yield f"{self.controlled.controller(self.model).name} over {self.over}: FLSS, with 95 % intervals"
        yield measures
        yield (
            "Saved: of the starts that are statically lost, those that do not fall; dynamics: physical less static"
            f" FLSS; change: physical FLSS less that at {self.over} = {result.attrs['reference']:g}"
        )
        yield differences
        yield f"Why they fall or do not, and how many toppled, numbers of starts at each {self.over}"
        yield _reasons(result)
        stand = (f"{n} at {value:g}" for n, value in zip(result.stand.values, result.value.values, strict=True))
        starts = f"{result.sizes['start']} of {starts_in_words(self.starts)}"
        yield f"{starts}, which stand on six feet and reach nine of ten tips at every value ({', '.join(stand)})"
        yield self.conditions_line(varied=[self.over])


def _tables(result: "xr.Dataset") -> "tuple[Table, Table]":
    """A row for each value and velocity: the measures, and what differs between them."""
    measures, differences = [], []
    for value in result.value.values:
        for v in result.velocity.values:
            one, at = result.sel(value=value, velocity=v), (f"{value:g}", f"{v:g}")
            measures.append((*at, f"{one.froude.item():.2g}", *(interval(one, name) for name in MEASURES)))
            changes = (difference(one, name) for name in DIFFERENCES)
            saved = interval(one, "saved") if one.static.item() else "none lost"
            differences.append((*at, f"{one.static.item():.3f}", saved, *changes))
    heads = ("value", "V", "Froude", *MEASURES), ("value", "V", "static", "saved", *DIFFERENCES)
    return table(heads[0], measures), table(heads[1], differences)


def _reasons(result: "xr.Dataset") -> "Table":
    """A row for each velocity and mechanism, a column for each value."""
    rows = []
    for v in result.velocity.values:
        for name in result.mechanism_name.values:
            counts = result["count"].sel(velocity=v, mechanism_name=name).values
            rows.append((f"{v:g}", name.replace("_", " "), *map(str, counts)))
        toppled = (result.topple.sel(velocity=v) < float("inf")).sum("start")
        rows.append((f"{v:g}", "toppled, of all", *map(str, toppled.values)))
    return table(("V", "starts that", *(f"{value:g}" for value in result.value.values)), rows)
