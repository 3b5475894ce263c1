"""`hexmj converge`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import ControllerName, hiding
from hexmj.cli.study_command import Outputs, StudyCommand, lists_of
from hexmj.cli.tables import interval, table
from hexmj.conditions import Conditions
from hexmj.measures.figures import starts_in_words
from hexmj.studies.static_limit import FINE, StaticLimit, static_limit_figure

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

SAME = {
    "measured": "agreement_measured",
    "grounded": "agreement_grounded",
    "physical": "agreement",
    "same feet": "same_feet",
    "at the ground": "same_feet_grounded",
}
"""Heading -> the fraction of starts whose answer is the kinematic one, or of steps with the planned feet."""

OFF = {
    "margin": "margin",
    "grounded": "margin_grounded",
    "pressure": "margin_pressure",
    "same feet": "margin_same_feet",
    "drift": "drift",
    "slip": "slip",
    "tracking": "tracking",
}
"""Heading -> how far the walk is from its plan."""


@dataclass(frozen=True)
class Converge(StudyCommand):
    """Options of `hexmj converge`, which `commands.COMMANDS` describes."""

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
    conditions: OmitArgPrefixes[Conditions] = hiding(FINE, StaticLimit.hidden)
    outputs = Outputs("walking slower and slower", "converge.nc", {"converge.png": static_limit_figure})

    def study(self) -> StaticLimit:
        return StaticLimit(
            self.controlled.controller(self.model),
            self.velocity,
            self.vps,
            self.leg_masses,
            n_starts=self.starts,
            conditions=self.conditions,
            **self.walked,
        )

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """Frequencies and distances, over masses and V_p."""
        return lists_of(_means(result))

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The frequencies, the distances from the plan, and the conditions."""
        from hexmj.studies.static_limit import LOSSES

        name, means = self.controlled.controller(self.model).name, _means(result)
        yield f"{name}, V = {self.velocity:g}, {starts_in_words(self.starts)}: FLSS, with 95 % intervals"
        yield _table(means, {measure: partial(interval, measure=measure) for measure in LOSSES})
        yield "Starts whose answer is the kinematic one; steps in which the planned feet stand, or are at the ground"
        yield _table(means, {heading: partial(_number, name=one) for heading, one in SAME.items()})
        yield (
            "Distances from the planned margin until the plan loses stability: of the measured one, of that with all"
            " feet at the ground, of the centre of pressure's, of the measured one where the same feet stand; of the"
            " centre of mass from O [mm]; slip [mm/s] and tracking [mm] to the end"
        )
        yield _table(means, {heading: partial(_number, name=one) for heading, one in OFF.items()})
        yield self.conditions_line(varied=StaticLimit.hidden)


def _means(result: "xr.Dataset") -> "xr.Dataset":
    """Over the starts."""
    from hexmj.studies.static_limit import LOSSES

    return result.drop_vars(LOSSES.values()).mean("start", keep_attrs=True)


def _table(means: "xr.Dataset", columns: Mapping[str, "Callable[[xr.Dataset], str]"]) -> "Table":
    """A row for each mass of the legs and V_p."""
    rows = [
        (f"{mass:g}", f"{vp:g}", *(column(means.sel(leg_mass=mass, vp=vp)) for column in columns.values()))
        for mass in means.leg_mass.values
        for vp in means.vp.values
    ]
    return table(("legs", "V_p", *columns), rows)


def _number(one: "xr.Dataset", name: str) -> str:
    return f"{one[name].item():.3f}"
