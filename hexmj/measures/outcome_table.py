"""How every start goes, as a table: the cell of all sweeps that need nothing else of a physical walk."""

from functools import lru_cache
from typing import TYPE_CHECKING

from hexmj.conditions import Conditions
from hexmj.measures.frequency import over_start
from hexmj.measures.physical import physical_outcomes
from hexmj.measures.walk_settings import WalkSettings
from hexmj.physics.settling import Settled, settle
from hexmj.progress import Progress
from hexmj.starts import draw_starts
from hexmj.timing import Stride

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


def outcome_table(walks: WalkSettings, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
    """Every field of `Outcomes` over start."""
    files = walks.conditions.body.mjcf.read_bytes()
    settled = settled_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads, files)
    outcomes = physical_outcomes(
        settled, walks.controller, walks.velocity, walks.duration,
        acceleration=walks.acceleration, threads=threads, progress=progress,
    )  # fmt: skip
    return over_start(vars(outcomes), UNITS)
