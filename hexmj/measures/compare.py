"""Comparison of the measures of stability on the same starts: planned feet, feet in the simulation, and falls."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from hexmj.conditions import SCALARS, Conditions
from hexmj.controllers.protocol import Controller
from hexmj.controllers.wrappers import Begins
from hexmj.legs import LEGS
from hexmj.measures import tables
from hexmj.measures.figures import UNITS
from hexmj.measures.study import Study, outcome_table
from hexmj.starts import draw_starts
from hexmj.sweep import Cell, Execution, over_axes, run_study
from hexmj.timing import Acceleration, Stride
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr

MEASURES = {
    "kinematic": "planned_loss",
    "dynamic": "dynamic_loss",
    "grounded": "grounded_loss",
    "carried": "carried_loss",
    "physical": "fall",
}
"""Measure of FLSS -> outcome, the time of the event that the measure counts."""

BESIDE = {"toppled": "topple"}
"""Further measure -> outcome that it counts: the trunk tilts by more than `outcomes.TOPPLED`, in any direction."""

AGREEMENT = ("both", "only_kinematic", "only_physical", "none")
"""Cases of a start: planned loss and fall, planned loss only, fall only, or neither."""

REPORTED = ("clearance", "tilt", "speed", "slip", "tracking", "depth", "saturation", "unreachable")
"""Outcomes that describe how well the body follows the plan."""


class Point(NamedTuple):
    """Settings in which the cells of a comparison differ."""

    controller: str
    conditions: Conditions
    velocity: float
    duration: float
    """Observation time [time units]."""


@dataclass(frozen=True)
class Comparison(Study):
    """Walks of several controllers from the same starts at every value of `axes` and every velocity."""

    controllers: Mapping[str, Controller]
    """Controllers by their names in the result."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; the final velocities when accelerating."""
    observation_time: str | float = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two swings) or a number [time units]."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11; without it the velocity is constant."""
    protocol: Begins = field(default="random", kw_only=True)
    """Where walks begin: at 'random' starts, or in the 'steady' state that the plan reaches from them in ten periods of
    a leg. The insect then begins with all feet on the tips of the plan, and losses and time count from there."""
    n_starts: int = field(default=60, kw_only=True)
    """Number of random starts, the same in every cell."""
    axes: Mapping[str, Sequence[float]] = field(default_factory=dict, kw_only=True)
    """Conditions that are axes of the result, each a number, and their values; the axes form a product."""

    def __post_init__(self) -> None:
        for name in self.axes:
            choice("axes", name, SCALARS)
        super().__post_init__()

    @property
    def points(self) -> list[Point]:
        """The points of all cells in the order of the result's axes: controller, `axes`, velocity."""
        every = product(self.controllers, self.varied, zip(*self.observed, strict=True))
        return [Point(name, conditions, v, t) for name, conditions, (v, t) in every]

    def cells(self) -> list[Cell]:
        """Return a cell for each of `points`, computed by `outcome_table`."""
        self.check_walks(self.velocities)
        cells = []
        for name, conditions, v, t in self.points:
            walks = self.walks(v, t, conditions, self.controllers[name])
            work = walks.work * conditions.substeps(self.stride)
            cells.append(Cell(f"{name}-V-{v:g}", outcome_table, {"walks": walks}, work))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset that `compare` describes, from the datasets of all cells."""
        starts = draw_starts(self.n_starts, self.seed, self.stride)
        axes = {"controller": self.controllers, **self.axes, "velocity": self.velocities}
        own: Any = {name: (name, list(v), {"units": UNITS.get(name, "1")}) for name, v in self.axes.items()}
        table = over_axes({name: len(values) for name, values in axes.items()}, data).assign_coords(
            **tables.velocity_axis(*self.observed),
            **own,
            controller=list(self.controllers),
            leg=list(LEGS),
            starts=(("start", "leg"), starts, {"units": "mm", "long_name": "tips at the start"}),
        )
        table.fall_part.attrs["flag_meanings"] = " ".join(self.conditions.body.trunk)
        lost, fell = table.planned_loss < np.inf, table.fall < np.inf
        table = with_flss(table, MEASURES | BESIDE)
        for name, case in zip(AGREEMENT, (lost & fell, lost & ~fell, ~lost & fell, ~lost & ~fell), strict=True):
            table[name] = case.sum("start").assign_attrs(units="1", long_name="number of starts")
        return self.labelled(table, "compare")


@dataclass(frozen=True)
class PhysicalFlss(Comparison):
    """The physical FLSS of one controller over velocities."""

    n_starts: int = field(default=200, kw_only=True)
    """Number of random starts, the same for every velocity."""

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset that `physical_flss` describes, from the datasets of all cells."""
        return _falls(super().result(data))


def compare(
    controllers: Controller | Mapping[str, Controller],
    velocities: Sequence[float] | float,
    *,
    n_starts: int = Comparison.n_starts,
    observation_time: str | float = Comparison.observation_time,
    seed: int = Comparison.seed,
    conditions: Conditions = Comparison.conditions,
    stride: Stride = Comparison.stride,
    acceleration: Acceleration | None = None,
    protocol: Begins = Comparison.protocol,
    axes: Mapping[str, Sequence[float]] = {},
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Return the FLSS of controllers by all `MEASURES` over velocities, on the same starts.

    Args:
        controllers: one controller, or several controllers by name.
        velocities: one or several V_r, each 0 <= V < 1; the final velocities when accelerating.
        n_starts: number of random starts.
        observation_time: 'walk', 'start' or a number of time units, see `timing.observation_duration`.
        seed: seed of the random starts.
        conditions: V_p, body, ground and contacts of the physical walks.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        protocol: 'random' or 'steady', see `Comparison.protocol`; 'steady' allows no acceleration.
        axes: condition -> values, such as {"vp": [40.0, 80.0]}; every condition that is a number can become an axis.
        folder: directory in which finished cells are cached; None caches nothing.
        how: options of `sweep.Execution`, such as `executor` and `threads`; the result does not depend on them.

    Returns:
        Over (controller, *axes, velocity): the FLSS of `MEASURES` and `BESIDE` with their 95 % Wilson intervals
        (`kinematic`, `kinematic_low`, ...), the number of starts in each case of `AGREEMENT`, and `agreement`, the
        fraction of starts with a planned loss and a fall, or with neither. Over (controller, *axes, velocity, start):
        every field of `physics.outcomes.Outcomes`.

    Raises:
        InputError: an argument is out of range.
        SimulationError: an insect does not come to rest at its start, or a walk diverges.
    """
    named = controllers if isinstance(controllers, Mapping) else {getattr(controllers, "name", "?"): controllers}
    walks: Any = {"n_starts": n_starts, "seed": seed, "conditions": conditions, "stride": stride}
    walks |= {"velocities": np.atleast_1d(velocities).tolist(), "observation_time": observation_time}
    walks |= {"acceleration": acceleration, "protocol": protocol}
    walks["axes"] = {name: np.atleast_1d(values).tolist() for name, values in axes.items()}
    return run_study(Comparison(named, **walks), folder, **how)


def physical_flss(
    controller: Controller, velocities: Sequence[float] | float, *, n_starts: int = 200, **options: Any
) -> "xr.Dataset":
    """Return the physical FLSS, the frequency with which the trunk touches the ground.

    Args:
        controller: controller that plans the walks.
        velocities: one or several V_r, each 0 <= V < 1.
        n_starts: number of random starts.
        options: arguments of `compare`, except `axes`. `contact_gap` has no effect on falls without sensory feedback.

    Returns:
        The variables of `kinematic.flss` for falls, and the frequency `toppled` with its interval; over
        (velocity, start) the times `fall` and `topple`, and the outcomes `REPORTED`.

    Raises:
        InputError: an argument is out of range.
        SimulationError: an insect does not come to rest at its start, or a walk diverges.
    """
    return _falls(compare(controller, velocities, n_starts=n_starts, **options))


def _falls(result: "xr.Dataset") -> "xr.Dataset":
    """Return the dataset of `physical_flss` from a comparison of one controller."""
    fell = tables.losses_by_sample(np.isfinite(result.fall.values[0]))
    table = tables.frequency_table(fell, result.sizes["start"], result.velocity.values, result.duration.values)
    beside = [measure + end for measure in BESIDE for end in ("", "_low", "_high")]
    reported = result.isel(controller=0, drop=True)[[*beside, "fall", *BESIDE.values(), *REPORTED]]
    return table.assign(reported.drop_vars("duration").data_vars).assign_attrs(result.attrs | {"study": "flss"})


def with_flss(data: "xr.Dataset", measures: Mapping[str, str] = MEASURES) -> "xr.Dataset":
    """Add the FLSS of each measure with its 95 % Wilson interval, and `agreement`, to outcomes over (..., start)."""
    new: dict[str, Any] = {}
    for measure, outcome in measures.items():
        lost = tables.happened(data[outcome]).transpose(..., "start")
        new |= tables.frequency(measure, lost.values, tuple(map(str, lost.dims[:-1])))
        new[measure][2]["long_name"] = f"{measure} FLSS"
    same = (data.planned_loss < np.inf) == (data.fall < np.inf)
    new["agreement"] = same.mean("start").assign_attrs(units="1", long_name="kinematic and physical answer agree")
    return data.assign(new)


def physical_report(result: "xr.Dataset") -> dict[str, float]:
    """Return means and extremes over all walks of a result that show how well the bodies followed their plans."""
    return {
        "mean slip [mm/s]": result.slip.mean().item(),
        "tracking, 95th percentile [mm]": result.tracking.mean().item(),
        "deepest foot in the ground [mm]": result.depth.max().item(),
        "joints at their torque limit": result.saturation.mean().item(),
        "tip targets out of reach": result.unreachable.sum().item(),
        "least clearance [mm]": result.clearance.min().item(),
        "greatest tilt [rad]": result.tilt.max().item(),
    }
