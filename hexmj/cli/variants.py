"""`hexmj variants`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import OmitArgPrefixes, arg

from hexmj.cli.options import NETWORK, Controlled, hiding
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import interval, table
from hexmj.controllers.cruse1998 import Cruse1998
from hexmj.errors import InputError
from hexmj.measures.captions import starts_in_words
from hexmj.starts import checked_list
from hexmj.studies.short_names import short_names
from hexmj.studies.variants import study
from hexmj.studies.variants.figure import variants_figure
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

OF_EACH = "-V"
"""What a model's name ends with where each velocity has a set of its own."""


@dataclass(frozen=True)
class Variants(StudyCommand):
    """Options of `hexmj variants`, which `commands.COMMANDS` describes."""

    models: Annotated[
        tuple[str, ...],
        arg(help=f"Sets of the 1998 network, each {NETWORK}; own-V stands for own-0.1 at V = 0.1, and so on."),
    ] = ("hws", "ldvs", "own", "own-V")
    velocities: Sequence[float] = study.Variants.velocities
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    physical: bool = False
    """Count falls of the insect in MuJoCo instead of losses of the planned polygon, without the variant AEP0 11."""
    starts: int | None = None
    """Number of random starts, the same for every set, variant and velocity; 2000 unless given, 50 if physical."""
    out: Path = Path("results/variants")
    """Folder for figure, NetCDF, manifest and finished walks."""
    controlled: OmitArgPrefixes[Controlled] = hiding(
        Controlled(), ["feedback"], "Order and reading are varied from what is given here; a variant has no feedback."
    )
    outputs = Outputs("walking every variant", "variants.nc", {"variants.png": variants_figure})

    def study(self) -> study.Variants:
        if not self.physical:
            self.refuse_physical("without --physical")
        distinct("models", self.models)
        checked_list(self.velocities)
        networks = {name: tuple(self._network(name, v) for v in self.velocities) for name in self.models}
        for several in networks.values():
            self.refuse_contact_gap(several[0])
        short = short_names({name: one for name, (one, *_) in networks.items() if not name.endswith(OF_EACH)})
        shown = {short.get(name, name): several for name, several in networks.items()}
        return study.Variants(
            shown if len(shown) == len(networks) else networks,
            self.velocities,
            self.starts if self.starts is not None else 50 if self.physical else study.Variants.n_starts,
            **self.walked,
            conditions=self.conditions if self.physical else None,
        )

    @property
    def names(self) -> Sequence[str]:
        return list(dict.fromkeys(_own(name, v) for name in self.models for v in self.velocities))

    def _network(self, name: str, velocity: float) -> Cruse1998:
        """A set, or that of this velocity."""
        try:
            found = self.controlled.controller(_own(name, velocity))
        except InputError as error:
            at = f"{name} at V = {velocity:g}: " if name.endswith(OF_EACH) else ""
            raise InputError(f"{at}{error}") from None
        if not isinstance(found, Cruse1998):
            raise InputError(f"{name}; expected sets of the 1998 network, whose constants and rules vary")
        return found

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """A table for each velocity, what it comes to, and the conditions."""
        kind = "physical" if self.physical else "kinematic"
        yield f"{kind} FLSS of {starts_in_words(result.sizes['start'])}, one constant or rule changed at a time"
        for velocity in result.velocity.values:
            yield f"V = {velocity:g}"
            yield _table(result.sel(velocity=velocity))
        yield "Over all variants, with 95 % intervals"
        yield _together(result)
        yield from study.notes(result)
        yield self.conditions_line(self.physical)


def _own(name: str, velocity: float) -> str:
    """A set's name, that of this velocity's where each has its own."""
    return f"{name.removesuffix('V')}{velocity:g}" if name.endswith(OF_EACH) else name


def _table(one: "xr.Dataset") -> "Table":
    """A row for each variant, a column for each set; an asterisk where a set has the variant anyway."""
    rows = []
    for variant in one.variant.values:
        cells = zip(one.flss.sel(variant=variant).values, one.instead.sel(variant=variant), strict=True)
        rows.append((variant, *(f"{flss:.4f}{_mark(note)}" for flss, note in cells)))
    return table(("variant", *one.network.values), rows)


def _together(result: "xr.Dataset") -> "Table":
    """A row for each set and velocity."""
    rows = []
    for name in result.network.values:
        for velocity in result.velocity.values:
            one = result.sel(network=name, velocity=velocity)
            which = one.worst_variant.item()
            which += _mark(one.instead.sel(variant=which))
            rows.append((name, f"{velocity:g}", interval(one, "mean"), interval(one, "worst"), which))
    return table(("set", "V", "mean", "worst", "which"), rows)


def _mark(note: "xr.DataArray") -> str:
    return "*" if note.item() else ""
