"""`hexmj ablate`."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes, arg

from hexmj.cli.options import AS_THEY_ARE, STEADY, Accelerating, Controlled, Walks, hiding
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import tables_that_fit
from hexmj.io import settings
from hexmj.measures.figures import not_printed, starts_in_words
from hexmj.measures.tables import FRESH
from hexmj.studies import ablation as study
from hexmj.studies.ablation import ablation_figure
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


@dataclass(frozen=True)
class Ablate(StudyCommand):
    """Options of `hexmj ablate`, which `commands.COMMANDS` describes."""

    models: Annotated[tuple[str, ...], arg(help="Sets of the 1998 network by name, or walknet, walknet-reacog.")] = (
        "ldvs",
        "walknet",
    )
    velocities: Sequence[float] = study.Ablation.velocities
    """Velocities V_r as fractions of V_p, 0 < V < 1."""
    starts: int = study.Ablation.n_starts
    """Number of random starts on paper, the same for all."""
    physical_starts: int = study.Ablation.physical_starts
    """Of these, number of starts that walk in physics; 100 unless given, at most all."""
    out: Path = Path("results/ablate")
    """Folder for figure, NetCDF, manifest and finished walks."""
    walks: OmitArgPrefixes[Walks] = hiding(
        Walks(seed=FRESH), ["observation_time"], "Windows are those of the measures."
    )
    accelerating: OmitArgPrefixes[Accelerating] = STEADY
    controlled: OmitArgPrefixes[Controlled] = AS_THEY_ARE
    outputs = Outputs("walking without parts", "ablation.nc", {"ablation.png": ablation_figure})

    def study(self) -> study.Ablation:
        distinct("models", self.models)
        models = study.wholes(self.models)
        self.refuse_contact_gap(*(one for several in models.values() for one in several.values()))
        return study.Ablation(
            models,
            self.velocities,
            self.physical_starts,
            n_starts=self.starts,
            **self.steady,
        )

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """A table for each measure, and the conditions."""
        for measure, title in study.MEASURES.items():
            one = result.sel(measure=measure)
            starts = starts_in_words(one.frequency_starts.max().item())
            yield f"{measure}: {title}; frequency in {starts}, and how far it is above the whole's (* for sure)"
            yield from _tables(one)
        rules = not_printed(settings(result)["controllers"])
        yield from (f"{words}: {', '.join(names)}" for words, names in rules.items())
        yield self.conditions_line()


def _tables(one: "xr.Dataset") -> "Iterator[Table]":
    """A row for each controller, a column for each velocity."""
    velocities = one.velocity.values
    rows = [
        (name, *(_cell(one.sel(controller=name, velocity=v)) for v in velocities)) for name in one.controller.values
    ]
    return tables_that_fit(("controller", *(f"V = {v:g}" for v in velocities)), rows)


def _cell(one: "xr.Dataset") -> str:
    left, physical = one.frequency_starts.item(), one.measure.item() == "physical"
    frequency = "-" if not left else f"{one.frequency.item():.3f}"
    frequency += f" of {left}" if physical and 0 < left < one.attrs["physical_starts"] else ""
    if one.controller.item() == one.whole.item() or np.isnan(one.more):
        return frequency
    sure = "*" if one.more_low.item() > 0 or one.more_high.item() < 0 else ""
    return f"{frequency} ({one.more.item():+.3f}{sure})"
