"""How every start goes, as a table: the cell of all sweeps that need nothing else of a physical walk."""

from dataclasses import fields
from functools import lru_cache
from typing import TYPE_CHECKING

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.measures.physical import physical_outcomes
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.settling import Settled, settle
from hexmj.process.progress import Progress
from hexmj.starts import draw_starts
from hexmj.storage.mjcf import content
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr

UNITS = {
    "planned_loss": "time unit",
    "measured_loss": "time unit",
    "fall": "time unit",
    "topple": "time unit",
    "clearance": "mm",
    "tilt": "rad",
    "slip": "mm/s",
    "tracking": "mm",
    "depth": "mm",
}
"""Units of `Outcomes`; the others are numbers."""


@lru_cache(maxsize=1)
def settled_starts(
    n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None, mjcf: bytes
) -> Settled:
    """The seed's starts at rest, for the body's MJCF as it is; kept, since every controller begins with the same."""
    return settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)


def outcome_table(
    controller: Controller,
    velocity: float,
    duration: float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Every field of `Outcomes` over start; arguments as of `physical.physical_outcomes`.

    Args:
        controller: plans the walks.
        velocity: V_r, or its final value.
        duration: observation time [time units].
        n_starts: number of starts.
        seed: of the starts.
        conditions: of the physical walks.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the table does not depend on it.
        progress: told the fraction done since it was last called.
    """
    import xarray as xr

    settled = settled_starts(n_starts, seed, conditions, stride, threads, content(conditions.body.mjcf))
    outcomes = physical_outcomes(
        settled, controller, velocity, duration, acceleration=acceleration, threads=threads, progress=progress
    )
    columns = {one.name: getattr(outcomes, one.name) for one in fields(Outcomes)}
    return xr.Dataset({name: ("start", values, {"units": UNITS.get(name, "1")}) for name, values in columns.items()})
