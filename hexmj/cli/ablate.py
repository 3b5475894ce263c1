"""`hexmj ablate`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes, arg

from hexmj.cli.options import STEADY, Accelerating, Controlled, Walks, hiding
from hexmj.cli.study import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import new_table
from hexmj.errors import check_distinct
from hexmj.studies.ablation import study
from hexmj.studies.league.study import FRESH

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


@dataclass(frozen=True)
class _Walks(Walks):
    """Windows are those of the measures."""


@dataclass(frozen=True)
class Ablate(StudyCommand):
    """Options of `hexmj ablate`, which `main.COMMANDS` describes."""

    models: Annotated[tuple[str, ...], arg(help="Sets of the 1998 network by name, or walknet, walknet-reacog.")] = (
        "ldvs",
        "walknet",
    )
    velocities: Sequence[float] = study.Ablation.velocities
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    starts: int = study.Ablation.n_starts
    """Number of random starts on paper, the same for all."""
    physical_starts: int = study.Ablation.n_physical
    """Of these, number of starts that walk in physics."""
    out: Path = Path("results/ablate")
    """Folder for figure, NetCDF, manifest and finished walks."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=lambda: hiding(_Walks(seed=FRESH), ["window"]))
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    controlled: OmitArgPrefixes[Controlled] = field(
        default_factory=lambda: hiding(Controlled(), ["order", "reading", "feedback"])
    )

    def study(self) -> study.Ablation:
        """See `StudyCommand.study`."""
        check_distinct("models", self.models)
        models = {name: study.switched(name) for name in self.models}
        self.refuse_contact_gap(*(one for several in models.values() for one in several.values()))
        return study.Ablation(
            models,
            self.velocities,
            self.starts,
            self.physical_starts,
            seed=self.walks.seed,
            conditions=self.conditions,
            stride=self.walks.stride,
        )

    def outputs(self) -> Outputs:
        """See `StudyCommand.outputs`."""
        from hexmj.studies.ablation.figure import ablation_figure

        return Outputs("walking without parts", "ablation.nc", {"ablation.png": ablation_figure})

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """All frequencies and differences."""
        return lists_of(result)

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """A table for each measure, and the conditions."""
        for measure, title in study.MEASURES.items():
            yield f"{measure}: {title}; frequency, and how far it is above the whole's (* for sure)"
            yield _table(result.sel(measure=measure))
        yield self.conditions_line()


def _table(one: "xr.Dataset") -> "Table":
    """A row for each controller, a column for each velocity."""
    table = new_table("controller", *(f"V = {v:g}" for v in one.velocity.values))
    for name in one.controller.values:
        table.add_row(name, *(_cell(one.sel(controller=name, velocity=v)) for v in one.velocity.values))
    return table


def _cell(one: "xr.Dataset") -> str:
    left, physical = one.frequency_starts.item(), one.measure.item() == "physical"
    frequency = "-" if not left else f"{one.frequency.item():.3f}"
    frequency += f" of {left}" if physical and 0 < left < one.attrs["n_physical"] else ""
    if one.controller.item() == one.whole.item() or np.isnan(one.more):
        return frequency
    sure = "*" if one.more_low.item() > 0 or one.more_high.item() < 0 else ""
    return f"{frequency} ({one.more.item():+.3f}{sure})"
