"""Dynamic stability maps: physical FLSS over the velocity and one condition, with the same starts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from hexmj.checks import typed
from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import begin, check_velocities
from hexmj.controllers.protocol import FeedbackPlan
from hexmj.errors import InputError
from hexmj.measures.velocities import observed, velocity_axis
from hexmj.starts import draw_starts
from hexmj.studies.same_starts import SameStarts
from hexmj.sweep import Cell, over_axes
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

Over = Literal["vp", "step_height", "standing_height", "friction", "load", "centre_of_mass"]
"""Conditions that a map can vary."""


@dataclass(frozen=True)
class Condition:
    """A condition that a map can vary."""

    values: tuple[float, ...]
    """Those of a map unless others are given."""
    unit: str
    name: str


CONDITIONS: dict[Over, Condition] = {
    "vp": Condition((20.0, 40.0, 80.0, 160.0, 320.0), "mm/s", "swing velocity V_p"),
    "step_height": Condition((4.0, 6.0, 8.0, 10.0, 12.0), "mm", "step height"),
    "standing_height": Condition((6.0, 8.0, 10.0, 12.0, 14.0), "mm", "standing height"),
    "friction": Condition((0.05, 0.2, 0.5, 1.0, 2.0), "1", "friction"),
    "load": Condition((0.0, 0.5, 1.0, 1.5, 2.0), "own weight", "load"),
    "centre_of_mass": Condition((-9.4, -5.0, 0.0, 5.0, 10.0), "mm", "centre of mass ahead of O"),
}
"""Name of a condition -> its values, unit and name; the animal's own centre of mass lies at -9.4 mm."""


@dataclass(frozen=True)
class StabilityMap(SameStarts):
    """The same starts at every value of a condition and every velocity.

    No controller that reads the legs: mechanisms are told from the plan alone.  Starts that cannot stand on six feet at
    every value, or do not reach nine of ten tips at every value and velocity, are left out of the result.
    """

    over: Over = "vp"
    """The condition that is varied, one of `CONDITIONS`."""
    values: Sequence[float] = ()
    """Of that condition in its unit, each once; those of `CONDITIONS` unless given."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """V_r (when accelerating, its final value), each 0 <= V < 1."""

    def __post_init__(self) -> None:
        typed("over", self.over, Over)
        super().__post_init__()
        distinct("values", self.chosen)
        _ = self.varied, self.observed
        start, v = draw_starts(1, self.seed, self.stride), self.observed[0][:1]
        if isinstance(begin(self.controller, start, v, self.stride, self.acceleration, threads=1), FeedbackPlan):
            raise InputError(
                f"{self.controller.name} reads the legs; expected a controller that does not: mechanisms are told"
                " from the plan alone"
            )

    @property
    def lists(self) -> Mapping[str, str]:
        """See `SameStarts.lists`."""
        return {self.over: "values"}

    @property
    def chosen(self) -> list[float]:
        """The values of the condition."""
        return [float(value) for value in self.values or CONDITIONS[self.over].values]

    @property
    def varied(self) -> list[Conditions]:
        """The conditions at each of them."""
        return [replace(self.conditions, **{self.over: value}) for value in self.chosen]

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride, self.acceleration)

    def cells(self) -> list[Cell]:
        """A cell for each value and velocity; see `sweep.Study`."""
        from hexmj.physics.settling import check_adhesion
        from hexmj.studies.stability_map.fates import fates

        def cell(conditions: Conditions, velocity: float, time: float) -> Cell:
            name = f"{self.over}-{conditions.values()[self.over]:g}-V-{velocity:g}"
            work = time * conditions.substeps(self.stride)
            return Cell(name, fates, {"walks": self.walks(velocity, time, conditions), "over": self.over}, work)

        check_velocities(self.controller, self.velocities, self.stride, self.acceleration)
        for one in self.varied:
            check_adhesion(one, self.stride, self.seed)
        return [cell(one, v, time) for one in self.varied for v, time in zip(*self.observed, strict=True)]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """What happened, how often, and what dynamics and the condition change.

        Returns:
            Over (value, velocity): the measures of `differences.FLSS` and `saved`, the fraction of the starts with a
            static loss that do not fall, with their 95 % Wilson intervals; the paired differences `dynamics`, physical
            less static, and `change` of physical from the value in `attrs["reference"]`, with 95 % intervals; the
            Froude number `froude`; over mechanism too the numbers of starts, `count`.  Over (value, velocity, start):
            every field of `Outcomes`, `static_loss`, `mechanism` (index) and `direction` of the fall [rad].  Over
            value: how many starts `stand`, and reach nine of ten tips at every velocity.

        Raises:
            InputError: no start is left.
        """
        from hexmj.studies.stability_map.differences import froude, with_differences

        table = self._over_values(data)
        usual = Conditions().values()[self.over]
        reference = usual if usual in self.chosen else self.chosen[0]
        numbers = np.array([froude(one, self.observed[0]) for one in self.varied])
        table = with_differences(table, reference).assign(froude=(("value", "velocity"), numbers, {"units": "1"}))
        return self.labelled(table, "map", over=self.over, reference=reference)

    def _over_values(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """What happened to the starts that are left, over (value, velocity, start)."""
        from hexmj.studies.stability_map.mechanisms import MECHANISMS

        sizes, condition = {"value": len(self.chosen), "velocity": len(self.velocities)}, CONDITIONS[self.over]
        table = over_axes(sizes, data, join="inner", combine_attrs="override")
        if not table.sizes["start"]:
            raise InputError(
                f"{self.over} = {self.chosen}; none of {self.n_starts} starts stands on six feet and reaches its"
                " tips at all of them"
            )
        left, v = [{*one.start.values.tolist()} for one in data], sizes["velocity"]
        stand = [len(set.intersection(*left[i : i + v])) for i in range(0, len(left), v)]
        return table.assign_coords(
            **velocity_axis(*self.observed),
            value=("value", self.chosen, {"units": condition.unit, "long_name": condition.name}),
            mechanism_name=("mechanism_name", list(MECHANISMS)),
        ).assign(stand=("value", stand, {"units": "1", "long_name": "starts that stand and reach nine of ten tips"}))
