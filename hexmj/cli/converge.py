"""`hexmj converge`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import ControllerName, hiding
from hexmj.cli.study import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import interval, new_table
from hexmj.conditions import Conditions
from hexmj.measures.compare import MEASURES
from hexmj.studies.static_limit.study import FINE, VARIED, StaticLimit

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


@dataclass(frozen=True)
class Converge(StudyCommand):
    """Options of `hexmj converge`, which `main.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    velocity: float = StaticLimit.velocity
    """Velocity V_r as a fraction of V_p, 0 <= V < 1."""
    vps: Sequence[float] = StaticLimit.vps
    """Velocities V_p of a protracting tip [mm/s]."""
    leg_masses: Sequence[float] = StaticLimit.leg_masses
    """Masses of the legs as fractions of the insect's own; the paper's legs have none."""
    starts: int = StaticLimit.n_starts
    """Number of random starts, the same for every V_p and mass."""
    out: Path = Path("results/converge")
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=lambda: hiding(FINE, VARIED))

    def study(self) -> StaticLimit:
        """See `StudyCommand.study`."""
        return StaticLimit(
            self.controlled.controller(self.model),
            self.velocity,
            self.vps,
            self.leg_masses,
            n_starts=self.starts,
            conditions=self.conditions,
            **self.walked,
        )

    def outputs(self) -> Outputs:
        """See `StudyCommand.outputs`."""
        from hexmj.studies.static_limit.figure import static_limit_figure

        return Outputs("walking slower and slower", "converge.nc", {"converge.png": static_limit_figure})

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Frequencies and distances, over masses and V_p."""
        return lists_of(_means(result))

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The frequencies, the distances from the plan, and the conditions."""
        name, (frequencies, distances) = self.controlled.controller(self.model).name, _tables(_means(result))
        yield f"{name}, V = {self.velocity:g}, {self.starts} starts: FLSS, with 95 % intervals"
        yield frequencies
        yield (
            "Distances from the plan [mm] until it loses stability, the fraction of steps in which the same feet stand,"
            " slip [mm/s] and tracking [mm] to the end"
        )
        yield distances
        yield self.conditions_line(varied=VARIED)


def _means(result: "xr.Dataset") -> "xr.Dataset":
    """Over the starts."""
    return result.drop_vars(MEASURES.values()).mean("start", keep_attrs=True)


def _tables(means: "xr.Dataset") -> "tuple[Table, Table]":
    """A row for each mass of the legs and V_p: the frequencies, and the distances from the plan."""
    from hexmj.studies.static_limit.distances import DISTANCES, REPORTED

    frequencies = new_table("legs", "V_p", *MEASURES, "agreement")
    distances = new_table("legs", "V_p", *DISTANCES, *REPORTED)
    for mass in means.leg_mass.values:
        for vp in means.vp.values:
            one = means.sel(leg_mass=mass, vp=vp)
            intervals = (interval(one, measure) for measure in MEASURES)
            off = (f"{one[name].item():.3f}" for name in (*DISTANCES, *REPORTED))
            frequencies.add_row(f"{mass:g}", f"{vp:g}", *intervals, f"{one.agreement.item():.3f}")
            distances.add_row(f"{mass:g}", f"{vp:g}", *off)
    return frequencies, distances
