"""Comparison of the measures of stability on the same starts: planned feet, feet in the simulation, and falls."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Unpack, get_args

import numpy as np

from hexmj.conditions import SCALARS, Conditions, check_ground
from hexmj.controllers.planning import check_velocities
from hexmj.controllers.protocol import Controller, settings_of
from hexmj.controllers.wrappers import Begins, by_protocol
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.legs import LEGS
from hexmj.measures import tables
from hexmj.measures.figures import UNITS
from hexmj.measures.precision import MEASURES, PLANNED, StratifiedWalks, plan_table
from hexmj.measures.study import Study, outcome_table
from hexmj.measures.tables import WalkSettings
from hexmj.starts import draw_starts
from hexmj.sweep import Cell, Execution, Round, over_axes, run_study
from hexmj.timing import Acceleration, Stride
from hexmj.validate import choice, distinct, number

if TYPE_CHECKING:
    import xarray as xr

LEAST_PRECISION = 0.01
"""Minimum of `Comparison.precision`; 20,000 planned starts allow no narrower intervals."""

PLANNING_COST = 0.002
"""Computing time of planning a start for the strata, as a fraction of that of its physical walk."""

LIKELY = 150
"""Number of walks that a precision is expected to need at each point, for the progress bar."""

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
    precision: float | None = field(default=None, kw_only=True)
    """Half width of the 95 % intervals that is enough, such as 0.03: 20,000 starts are planned, and as many walk as the
    intervals need. By default, every start walks."""
    axes: Mapping[str, Sequence[float]] = field(default_factory=dict, kw_only=True)
    """Conditions that are axes of the result, each a number, and their values; the axes form a product."""

    narrowed: ClassVar[Mapping[str, str]] = {name: MEASURES[name] for name in ("grounded", "carried", "physical")}
    """Measures whose intervals `precision` limits -> outcome."""

    def __post_init__(self) -> None:
        if self.precision is not None:
            number("precision", self.precision, LEAST_PRECISION, 0.5)
            object.__setattr__(self, "n_starts", PLANNED)
        super().__post_init__()
        distinct("controllers", [*self.controllers])
        for controller in self.controllers.values():
            settings_of(controller)  # raises InputError now rather than after the computation
        choice("protocol", self.protocol, get_args(Begins))
        if (self.acceleration or 0 in self.observed[0]) and self.protocol == "steady":
            raise InputError("protocol = steady allows neither an acceleration nor V = 0; use the protocol random")
        for name, values in self.axes.items():
            choice("axes", name, SCALARS)
            distinct(name, values)
        for conditions in self.varied:
            check_ground(conditions)

    @property
    def varied(self) -> list[Conditions]:
        """The conditions of walks at every combination of the values of `axes`; the last axis varies fastest."""
        rows = product(*self.axes.values())
        return [replace(self.conditions, **dict(zip(self.axes, row, strict=True))) for row in rows]

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """The velocities V_r and their observation times [time units], both (velocity,)."""
        return tables.observed(self.velocities, self.observation_time, self.stride, self.acceleration)

    @property
    def points(self) -> list[Point]:
        """The points of all cells in the order of the result's axes: controller, `axes`, velocity."""
        every = product(self.controllers, self.varied, zip(*self.observed, strict=True))
        return [Point(name, conditions, v, t) for name, conditions, (v, t) in every]

    def cells(self) -> list[Cell]:
        """Return a cell for each of `points`: walks of all starts or, with a precision, the plans of all starts."""
        for controller in self.controllers.values():
            began = by_protocol(controller, self.protocol)
            check_velocities(began, self.velocities, self.stride, self.acceleration)
        function, cost = (outcome_table, 1.0) if self.precision is None else (plan_table, PLANNING_COST)
        return [self._cell(point, function, cost) for point in self.points]

    def _cell(self, point: Point, function: Callable[..., Any], cost: float, **own: Any) -> Cell:
        """Return a cell at a point; `cost` is its computing time as a multiple of that of all walks."""
        name, conditions, v, t = point
        controller = by_protocol(self.controllers[name], self.protocol)
        same = self.n_starts, self.seed, conditions, self.stride, self.acceleration
        walks = WalkSettings(controller, v, t, *same)
        work = cost * walks.work * conditions.substeps(self.stride)
        return Cell(f"{name}-V-{v:g}", function, {"walks": walks, **own}, work)

    def next_round(self, data: Sequence["xr.Dataset"]) -> Round:
        """Return the cells that are needed after those with these results, see `sweep.run_study`."""
        if not data:
            cells = self.cells()
            walks = 0.0 if self.precision is None else LIKELY / PLANNED / PLANNING_COST
            return Round(cells, walks * sum(cell.work for cell in cells))
        if self.precision is None:
            return Round([])
        samples, chosen = self._sampled(data, self.precision)
        cells, left = [], 0.0
        for point, sample, starts in zip(self.points, samples, chosen, strict=True):
            if len(starts):
                cells.append(self._cell(point, outcome_table, len(starts) / self.n_starts, which=starts))
                left += cells[-1].work * sample.left(self.narrowed, self.precision) / len(starts)
        return Round(cells, left)

    def _sampled(
        self, data: Sequence["xr.Dataset"], precision: float
    ) -> tuple[list[StratifiedWalks], list[np.ndarray]]:
        """Return what has walked at each point, and the starts that walk next, (n,), none if all is precise."""
        points = len(self.points)
        samples, batches = [StratifiedWalks(plan) for plan in data[:points]], iter(data[points:])
        while True:
            chosen = [sample.next_starts(self.narrowed, precision) for sample in samples]
            for sample, starts in zip(samples, chosen, strict=True):
                if len(starts):
                    if (batch := next(batches, None)) is None:
                        return samples, chosen
                    sample.walk(starts, batch)
            if not any(map(len, chosen)):
                return samples, chosen

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset that `compare` describes, from the datasets of all cells."""
        axes = {"controller": self.controllers, **self.axes, "velocity": self.velocities}
        sizes = {name: len(values) for name, values in axes.items()}
        if self.precision is None:
            table = _counted(over_axes(sizes, data))
        else:
            samples, _ = self._sampled(data, self.precision)
            table = over_axes(sizes, [sample.table() for sample in samples], join="outer", data_vars="all")
        starts = draw_starts(self.n_starts, self.seed, self.stride)[table.get_index("start")]
        own: Any = {name: (name, list(v), {"units": UNITS.get(name, "1")}) for name, v in self.axes.items()}
        table = table.assign_coords(
            **tables.velocity_axis(*self.observed),
            **own,
            controller=list(self.controllers),
            leg=list(LEGS),
            starts=(("start", "leg"), starts, {"units": "mm", "long_name": "tips at the start"}),
        )
        table.fall_part.attrs["flag_meanings"] = " ".join(self.conditions.body.trunk)
        walks = self.observation_time, self.n_starts, self.seed, self.stride, self.acceleration
        made = {"study": "compare", "protocol": self.protocol} | tables.settings(self.controllers, *walks)
        made |= {} if self.precision is None else {"precision": self.precision}
        made["conditions"] = {k: v for k, v in self.conditions.settings().items() if k not in self.axes}
        return table.transpose(*axes, "start", ...).assign_attrs(attributes(made))


@dataclass(frozen=True)
class PhysicalFlss(Comparison):
    """The physical FLSS of one controller over velocities."""

    n_starts: int = field(default=200, kw_only=True)
    """Number of random starts, the same for every velocity."""

    narrowed: ClassVar[Mapping[str, str]] = {"physical": "fall"}

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
    precision: float | None = None,
    axes: Mapping[str, Sequence[float]] = {},
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Return the FLSS of controllers by all `MEASURES` over velocities, on the same starts.

    Args:
        controllers: one controller, or several controllers by name.
        velocities: one or several V_r, each 0 <= V < 1; the final velocities when accelerating.
        n_starts: number of random starts; without effect if there is a precision.
        observation_time: 'walk', 'start' or a number of time units, see `timing.observation_duration`.
        seed: seed of the random starts.
        conditions: V_p, body, ground and contacts of the physical walks.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11; without it V_r is constant.
        protocol: 'random' or 'steady', see `Comparison.protocol`; 'steady' allows no acceleration.
        precision: half width of the 95 % intervals that is enough, see `Comparison.precision`.
        axes: condition -> values, such as {"vp": [40.0, 80.0]}; every condition that is a number can become an axis.
        folder: directory in which finished cells are cached; None caches nothing.
        how: options of `sweep.Execution`, such as `executor` and `threads`; the result does not depend on them.

    Returns:
        Over (controller, *axes, velocity): the frequencies of `MEASURES` with their 95 % intervals (`kinematic`,
        `kinematic_low`, ...), and `agreement`, the fraction of starts with a planned loss and a fall, or with neither;
        `dynamic_agreement` is that of the dynamic loss.
        Without a precision, the intervals are Wilson's, and there is the number of starts in each case of `AGREEMENT`.
        With a precision, there is the number of `walks`.
        Over (controller, *axes, velocity, start): every field of `physics.outcomes.Outcomes`; with a precision, only of
        the starts that have walked, with their `weight` in means over all starts.

    Raises:
        InputError: an argument is out of range.
        SimulationError: an insect does not come to rest at its start, or a walk diverges.
    """
    named = controllers if isinstance(controllers, Mapping) else {getattr(controllers, "name", "?"): controllers}
    walks: Any = {"n_starts": n_starts, "seed": seed, "conditions": conditions, "stride": stride}
    walks |= {"velocities": np.atleast_1d(velocities).tolist(), "observation_time": observation_time}
    walks |= {"acceleration": acceleration, "protocol": protocol, "precision": precision}
    walks["axes"] = {name: np.atleast_1d(values).tolist() for name, values in axes.items()}
    return run_study(Comparison(named, **walks), folder, **how)


def physical_flss(
    controller: Controller, velocities: Sequence[float] | float, *, n_starts: int = 200, **options: Any
) -> "xr.Dataset":
    """Return the physical FLSS, the frequency with which the trunk touches the ground.

    Args:
        controller: controller that plans the walks.
        velocities: one or several V_r, each 0 <= V < 1.
        n_starts: number of random starts; without effect if there is a precision.
        options: other fields of `PhysicalFlss`, `folder`, and options of `sweep.Execution`. `contact_gap` has no effect
            on falls without sensory feedback. A `precision` limits the intervals of falls only.

    Returns:
        Over velocity: `flss`, the frequency of falls, the ends `low` and `high` of its 95 % interval, and the
        observation time `duration` [time units]; with a precision, the number of `walks`. Over
        (velocity, start): the time `fall`, and the outcomes `REPORTED`.

    Raises:
        InputError: an argument is out of range.
        SimulationError: an insect does not come to rest at its start, or a walk diverges.
    """
    own = {field.name: options.pop(field.name) for field in fields(PhysicalFlss) if field.name in options}
    own |= {"velocities": np.atleast_1d(velocities).tolist(), "n_starts": n_starts}
    study = PhysicalFlss({getattr(controller, "name", "?"): controller}, **own)
    return run_study(study, options.pop("folder", None), **options)


def _falls(result: "xr.Dataset") -> "xr.Dataset":
    """Return the dataset of `physical_flss` from a comparison of one controller."""
    kept = ("physical", "physical_low", "physical_high", "walks", "weight", "fall", *REPORTED)
    falls = result.isel(controller=0, drop=True)[[name for name in kept if name in result]]
    falls = falls.rename(physical="flss", physical_low="low", physical_high="high").reset_coords("duration")
    return falls.assign_attrs(result.attrs | {"study": "flss"})


def _counted(outcomes: "xr.Dataset") -> "xr.Dataset":
    """Add all frequencies with 95 % Wilson intervals, `agreement` and the cases of `AGREEMENT` to outcomes."""
    new: dict[str, Any] = {}
    for measure, outcome in MEASURES.items():
        happened = tables.happened(outcomes[outcome]).transpose(..., "start")
        new |= tables.frequency(measure, happened.values, tuple(map(str, happened.dims[:-1])))
        new[measure][2]["long_name"] = f"{measure} FLSS"
    lost, tipped, fell = (outcomes[name] < np.inf for name in ("planned_loss", "dynamic_loss", "fall"))
    for name, measure, answer in ("agreement", "kinematic", lost), ("dynamic_agreement", "dynamic", tipped):
        text = f"{measure} and physical answer agree"
        new[name] = (answer == fell).mean("start").assign_attrs(units="1", long_name=text)
    for name, case in zip(AGREEMENT, (lost & fell, lost & ~fell, ~lost & fell, ~lost & ~fell), strict=True):
        new[name] = case.sum("start").assign_attrs(units="1", long_name="number of starts")
    return outcomes.assign(new)


def physical_report(result: "xr.Dataset") -> dict[str, float]:
    """Return means and extremes over all walks of a result that show how well the bodies followed their plans."""
    weight = result.weight.fillna(0.0) if "weight" in result else (result.slip > -np.inf).astype(float)

    def mean(name: str) -> float:
        return result[name].weighted(weight).mean().item()

    return {
        "mean slip [mm/s]": mean("slip"),
        "tracking, 95th percentile [mm]": mean("tracking"),
        "deepest foot in the ground [mm]": result.depth.max().item(),
        "joints at their torque limit": mean("saturation"),
        "tip targets out of reach": result.unreachable.sum().item(),
        "least clearance [mm]": result.clearance.min().item(),
        "greatest tilt [rad]": result.tilt.max().item(),
    }
