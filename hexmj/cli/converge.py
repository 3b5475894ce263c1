"""`hexmj converge`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Accelerating, Controlled, ControllerName, Hidden, Sweepers, Walks
from hexmj.cli.sweep import lists_of, run_study
from hexmj.cli.tables import conditions_line, interval, new_table, print_json, show
from hexmj.conditions import Conditions, Masses, Numerics, TimeScale
from hexmj.measures.compare import MEASURES
from hexmj.studies.static_limit.study import FINE, VARIED, StaticLimit

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


@dataclass(frozen=True)
class _Time(TimeScale):
    vp: Hidden = TimeScale.vp


@dataclass(frozen=True)
class _Masses(Masses):
    leg_mass: Hidden = Masses.leg_mass


@dataclass(frozen=True)
class _Conditions(Conditions):
    """All but those that are given as lists."""

    time: OmitArgPrefixes[_Time] = field(default_factory=_Time)
    masses: OmitArgPrefixes[_Masses] = field(default_factory=_Masses)
    numerics: OmitArgPrefixes[Numerics] = FINE.numerics


@dataclass(frozen=True)
class Converge:
    """The same starts at smaller and smaller V_p: does the insect tend to its plan and to the static criterion?

    Repeat the command to go on with a run that was stopped.
    """

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
    """Folder for figure, NetCDF, manifest and finished walks."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    accelerating: OmitArgPrefixes[Accelerating] = field(default_factory=Accelerating)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    conditions: OmitArgPrefixes[_Conditions] = field(default_factory=_Conditions)

    def run(self) -> None:
        """Walk slower and slower, write the results, and print."""
        from hexmj.studies.static_limit.figure import static_limit_figure

        study = StaticLimit(
            self.controlled.controller(self.model),
            self.velocity,
            self.vps,
            self.leg_masses,
            self.starts,
            self.walks.time,
            self.walks.seed,
            Conditions.of(**self.conditions.flat()),
            self.walks.stride,
            self.accelerating.procedure,
        )
        figures = {"converge.png": static_limit_figure}
        result, files = run_study(
            study, "walking slower and slower", self.out, self.sweepers, data="converge.nc", figures=figures
        )
        means = result.drop_vars(MEASURES.values()).mean("start")
        if self.json:
            print_json(lists_of(means) | {"settings": result.attrs, "files": files})
            return
        frequencies, distances = _tables(means)
        show(
            f"{study.controller.name}, V = {self.velocity:g}, {self.starts} starts: FLSS, with 95 % intervals",
            frequencies,
            "Distances from the plan [mm] until it loses stability, the fraction of steps in which the same feet stand,"
            " slip [mm/s] and tracking [mm] to the end",
            distances,
            conditions_line(
                self.walks, self.controlled, self.accelerating.procedure, self.conditions, varied=tuple(VARIED)
            ),
            *map(str, files),
        )


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
