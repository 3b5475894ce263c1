"""The static limit: as V_p goes to zero, does the walking insect tend to the plan and to the paper's static criterion?

The same starts walk at smaller and smaller V_p, with the insect's own legs and with legs that weigh next to nothing,
as the paper has them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.measures.compare import with_flss
from hexmj.measures.velocities import observed
from hexmj.studies.same_starts import SameStarts
from hexmj.sweep import Cell, over_axes
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

VARIED = {"vp": "vps", "leg_mass": "leg_masses"}
"""Conditions that are given as lists, and the lists."""

FINE = Conditions(longest_substep=0.5)
"""Light legs need physics steps of 0.5 ms or less."""


@dataclass(frozen=True)
class StaticLimit(SameStarts):
    """The same starts at every V_p, with every mass of the legs."""

    velocity: float = 0.5
    """V_r (when accelerating, its final value), 0 <= V < 1."""
    vps: Sequence[float] = (400.0, 200.0, 100.0, 50.0, 25.0)
    """Velocities V_p of a protracting tip [mm/s], each once."""
    leg_masses: Sequence[float] = (1.0, 0.01)
    """As `Conditions.leg_mass`, each once."""
    n_starts: int = field(default=200, kw_only=True)
    conditions: Conditions = field(default=FINE, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        for several in VARIED.values():
            distinct(several, getattr(self, several))
        _ = self.varied, self.duration

    @property
    def lists(self) -> Mapping[str, str]:
        """See `SameStarts.lists`."""
        return VARIED

    @property
    def varied(self) -> list[Conditions]:
        """The conditions at each mass of the legs and V_p."""
        return [replace(self.conditions, leg_mass=mass, vp=vp) for mass, vp in product(self.leg_masses, self.vps)]

    @property
    def duration(self) -> float:
        """Observation time [time units]."""
        return observed([self.velocity], self.observation_time, self.stride, self.acceleration)[1].item()

    def cells(self) -> list[Cell]:
        """A cell for each mass of the legs and V_p; see `sweep.Study`."""
        from hexmj.physics.settling import check_adhesion
        from hexmj.studies.static_limit.distances import distance_table

        def cell(conditions: Conditions) -> Cell:
            name = f"leg-mass-{conditions.leg_mass:g}-vp-{conditions.vp:g}"
            walks = self.walks(self.velocity, self.duration, conditions)
            return Cell(name, distance_table, {"walks": walks}, conditions.substeps(self.stride))

        for one in self.varied:
            check_adhesion(one, self.stride, self.seed)
        return [cell(one) for one in self.varied]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """FLSS, agreement and distances from the plan.

        Returns:
            Over (leg_mass, vp): the FLSS of `LOSSES` with their 95 % Wilson intervals and `agreement`, the fraction of
            starts for which kinematic and physical answer are the same, `agreement_measured` and
            `agreement_grounded`, those for which kinematic and that answer are; over (leg_mass, vp, start) the
            outcomes behind them, `DISTANCES` and `REPORTED`.
        """
        from hexmj.studies.static_limit.distances import LOSSES

        sizes = {"leg_mass": len(self.leg_masses), "vp": len(self.vps)}
        mass = {"units": "1", "long_name": "mass of the legs over the insect's own"}
        table = over_axes(sizes, data).assign_coords(
            vp=("vp", list(self.vps), {"units": "mm/s", "long_name": "velocity V_p of a protracting tip"}),
            leg_mass=("leg_mass", list(self.leg_masses), mass),
        )
        lost = table.planned_loss < np.inf
        for measure in ("measured", "grounded"):
            same = (table[LOSSES[measure]] < np.inf) == lost
            told = {"units": "1", "long_name": f"kinematic and {measure} answer agree"}
            table[f"agreement_{measure}"] = same.mean("start").assign_attrs(told)
        return self.labelled(with_flss(table, LOSSES), "converge", velocity=self.velocity, duration=self.duration)
