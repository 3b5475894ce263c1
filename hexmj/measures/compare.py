"""The two measures of stability on the same starts: polygon on paper, polygon under the body, body on the ground."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from hexmj.checks import check_types, given, printable, short, typed
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.checked_plans import check_velocities
from hexmj.controllers.protocol import Controller, check_controller_type, settings_of
from hexmj.errors import InputError
from hexmj.io import attributes
from hexmj.legs import LEGS
from hexmj.measures.frequency import frequency_table, losses_by_sample, settings
from hexmj.measures.velocities import observed, several, velocity_axis
from hexmj.measures.walk_settings import WalkSettings
from hexmj.starts import check_draw, draw_starts
from hexmj.stats import wilson_intervals
from hexmj.sweep import Cell, Execution, over_axes, run_study
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr

MEASURES = {"kinematic": "planned_loss", "measured": "measured_loss", "physical": "fall"}
"""Measure of FLSS -> the outcome whose frequency it is."""

BESIDE = {"toppled": "topple"}
"""The same of a second answer, which knows no direction: the trunk is tilted by more than `outcomes.TOPPLED`."""

AGREEMENT = ("both", "only_kinematic", "only_physical", "none")
"""What a start can do: lose stability on paper, touch the ground, both or none."""

REPORTED = ("clearance", "tilt", "speed", "slip", "tracking", "depth", "saturation", "unreachable")
"""Outcomes that tell how far the bodies did what they were told."""


@dataclass(frozen=True)
class Comparison:
    """Controllers on the same starts at every velocity, a cell for each controller and velocity."""

    controllers: Mapping[str, Controller]
    """By the names under which they stand in the result."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """V_r (when accelerating, its final value), each 0 <= V < 1."""
    n_starts: int = 60
    """Number of starts, the same for every controller and velocity."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    seed: int = 0
    """Of the starts."""
    conditions: Conditions = field(default_factory=Conditions)
    """Of the physical walks."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""

    def __post_init__(self) -> None:
        check_types(self)
        if not self.controllers:
            raise InputError("no controller was given; expected at least one")
        for name, controller in self.controllers.items():
            printable("a controller's name", name)
            settings_of(controller)  # now, not after the work
        check_draw(self.n_starts, self.seed)
        check_ground(self.conditions)
        _ = self.observed

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride, self.acceleration)

    def cells(self) -> list[Cell]:
        """See `sweep.Study`; each is an `outcome_table`."""
        from hexmj.measures.outcome_table import outcome_table

        for one in self.controllers.values():
            check_velocities(one, self.velocities, self.stride, self.acceleration)
        same = self.n_starts, self.seed, self.conditions, self.stride, self.acceleration
        return [
            Cell(f"{name}-V-{v:g}", outcome_table, {"walks": WalkSettings(one, v, t, *same)}, work=t)
            for name, one in self.controllers.items()
            for v, t in zip(*self.observed, strict=True)
        ]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """As `compare` gives it."""
        starts = draw_starts(self.n_starts, self.seed, self.stride)
        table = over_axes({"controller": len(self.controllers), "velocity": len(self.velocities)}, data).assign_coords(
            **velocity_axis(*self.observed),
            controller=list(self.controllers),
            leg=list(LEGS),
            starts=(("start", "leg"), starts, {"units": "mm", "long_name": "tips at the start"}),
        )
        table.fall_part.attrs["flag_meanings"] = " ".join(self.conditions.body.trunk)
        same = self.observation_time, self.n_starts, self.seed, self.stride, self.acceleration
        told = {"study": "compare"} | settings(self.controllers, *same) | {"conditions": self.conditions.settings()}
        return _with_answers(with_flss(table, MEASURES | BESIDE)).assign_attrs(attributes(told))


def compare(
    controllers: Controller | Mapping[str, Controller],
    velocities: Sequence[float] | float,
    *,
    n_starts: int = Comparison.n_starts,
    observation_time: str | float = Comparison.observation_time,
    seed: int = Comparison.seed,
    conditions: Conditions | None = None,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Kinematic, measured and physical FLSS of one or more controllers over velocities, on the same starts.

    Args:
        controllers: one, or several by name.
        velocities: one or several, as of `Comparison`, and so are `n_starts`, `observation_time`, `seed`, `conditions`, `stride`
            and `acceleration`.
        n_starts: number of starts.
        observation_time: observation time.
        seed: of the starts.
        conditions: of the physical walks.
        stride: of the plans.
        acceleration: of Eq. 11.
        folder: keeps what is finished, for a run that was stopped; None keeps nothing.
        how: executor, threads and progress, see `sweeps.Execution`; the result does not depend on it.

    Returns:
        Over (controller, velocity): the three FLSS and that of `BESIDE` with their 95 % Wilson intervals
        (`kinematic`, `kinematic_low`, ...), the numbers of starts in each case of `AGREEMENT` and `agreement`, the
        fraction of starts for which kinematic and physical answer are the same; over (controller, velocity,
        start) every field of `physics.outcomes.Outcomes`.

    Raises:
        InputError, SimulationError: see `settling.settle` and `drive.drive`.
    """
    if type(controllers) in (list, tuple):
        raise InputError(f"controllers = {short(controllers)}; expected one, or several in a dict, by their names")
    if not isinstance(controllers, Mapping):
        check_controller_type(controllers)
        controllers = {controllers.name: controllers}
    typed("folder", folder, Path | str | None)
    walks = given("conditions", conditions, Conditions), given("stride", stride, Stride), acceleration
    return run_study(
        Comparison(controllers, several(velocities), n_starts, observation_time, seed, *walks), folder, **how
    )


def physical_flss(
    controller: Controller,
    velocities: Sequence[float] | float,
    *,
    n_starts: int = 200,
    observation_time: str | float = Comparison.observation_time,
    seed: int = Comparison.seed,
    conditions: Conditions | None = None,
    stride: Stride | None = None,
    acceleration: Acceleration | None = None,
    folder: Path | None = None,
    **how: Unpack[Execution],
) -> "xr.Dataset":
    """Physical FLSS: the frequency with which the trunk touches the ground; arguments and errors as of `compare`.

    No polygon counts here: the contact gap of the conditions matters to controllers alone that read the legs.

    Returns:
        The table of `kinematic.flss`, the frequency of `BESIDE` with its interval; the times of the fall and of
        `BESIDE`, and the outcomes `REPORTED`, of every start.
    """
    check_controller_type(controller)
    result = compare(
        controller, velocities, n_starts=n_starts, observation_time=observation_time, seed=seed, conditions=conditions, stride=stride,
        acceleration=acceleration, folder=folder, **how,
    )  # fmt: skip
    fell = losses_by_sample(np.isfinite(result.fall.values[0]))
    table = frequency_table(fell, result.sizes["start"], result.velocity.values, result.duration.values)
    beside = [measure + end for measure in BESIDE for end in ("", "_low", "_high")]
    wanted = [*beside, "fall", *BESIDE.values(), *REPORTED]
    reported = result.isel(controller=0, drop=True)[wanted].drop_vars("duration")
    return table.assign(reported.data_vars).assign_attrs(result.attrs | {"study": "flss"})


def with_flss(data: "xr.Dataset", measures: Mapping[str, str] = MEASURES) -> "xr.Dataset":
    """The FLSS of `measures` with 95 % Wilson intervals, and `agreement`, beside outcomes over (..., start)."""
    new: dict[str, xr.DataArray] = {}
    for measure, outcome in measures.items():
        lost = data[outcome] < np.inf
        new[measure] = lost.mean("start").assign_attrs(units="1", long_name=f"{measure} FLSS")
        ends = wilson_intervals(lost.sum("start").values, data.sizes["start"])
        for end, values in zip(("_low", "_high"), ends, strict=True):
            new[measure + end] = new[measure].copy(data=values).drop_attrs().assign_attrs(units="1")
    same = (data.planned_loss < np.inf) == (data.fall < np.inf)
    new["agreement"] = same.mean("start").assign_attrs(units="1", long_name="kinematic and physical answer agree")
    return data.assign(new)


def _with_answers(data: "xr.Dataset") -> "xr.Dataset":
    """The numbers of starts in each case of `AGREEMENT` beside their outcomes."""
    lost, fell = data.planned_loss < np.inf, data.fall < np.inf
    answers = dict(zip(AGREEMENT, (lost & fell, lost & ~fell, ~lost & fell, ~lost & ~fell), strict=True))
    told = {"units": "1", "long_name": "number of starts"}
    return data.assign({name: true.sum("start").assign_attrs(told) for name, true in answers.items()})
