"""What happens to every start at one velocity and one value of a condition: a cell of a stability map."""

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.errors import InputError, OutOfReach, SimulationError
from hexmj.measures.frequency import over_start
from hexmj.measures.outcome_table import UNITS
from hexmj.measures.physical import PhysicalWalk, walk_of_settings
from hexmj.measures.walk_settings import WalkSettings
from hexmj.physics.settling import settle
from hexmj.stability import loss_time
from hexmj.starts import draw_starts
from hexmj.studies.stability_map.mechanisms import fall_direction, mechanisms, static_plan
from hexmj.timing import Stride

if TYPE_CHECKING:
    import xarray as xr

BLOCK = 100
"""Starts walked at a time: their walks are kept whole, 0.5 GB at V = 0.1."""


def fates(walks: WalkSettings, over: str, threads: int | None = None) -> "xr.Dataset":
    """Every field of `Outcomes`, `static_loss`, `mechanism` (index) and `direction` of the fall [rad], over start.

    Starts that cannot stand on six feet, or more than a tenth of whose tips is out of reach, are left out; `over` is
    the condition that the map varies.

    Raises:
        InputError, SimulationError: no start is left; see `measures.physical.physical_walk`.
    """
    n_starts, conditions = walks.n_starts, walks.conditions
    files = conditions.body.mjcf.read_bytes()
    stands = standing_starts(n_starts, walks.seed, conditions, walks.stride, threads, files)
    blocks = np.split(stands, range(BLOCK, len(stands), BLOCK)) if stands.size else ()
    parts = [part for block in blocks for part in _within_reach(walks, block, threads)]
    if not parts:
        value = conditions.values()[over]
        raise InputError(
            f"{over} = {value:g}; none of {n_starts} starts stands on six feet there and reaches its tips"
            f" at V = {walks.velocity:g}"
        )
    columns = {name: np.concatenate([part[name] for _, part in parts]) for name in parts[0][1]}
    within = np.concatenate([which for which, _ in parts])
    return over_start(columns, UNITS | {"static_loss": "time unit", "direction": "rad"}).assign_coords(
        start=("start", within, {"units": "1"})
    )


@lru_cache(maxsize=1)
def standing_starts(
    n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None, mjcf: bytes
) -> np.ndarray:
    """Which of the seed's starts come to rest on six feet, indices, for the body's MJCF as it is; kept for the other
    velocities."""
    return np.flatnonzero(_stands(draw_starts(n_starts, seed, stride), conditions, stride, threads))


def _stands(starts: np.ndarray, conditions: Conditions, stride: Stride, threads: int | None) -> np.ndarray:
    """Which starts come to rest on six feet, (start,); one that diverges is an error."""
    try:
        settle(starts, conditions, stride, threads)
    except (OutOfReach, SimulationError) as error:
        if isinstance(error, SimulationError) and error.state:
            raise
        if len(starts) == 1:
            return np.array([False])
        halves = np.array_split(starts, 2)
        return np.concatenate([_stands(half, conditions, stride, threads) for half in halves])
    return np.ones(len(starts), dtype=bool)


def _within_reach(
    walks: WalkSettings, which: np.ndarray, threads: int | None
) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Some of the starts, (n,), in parts with their fates; those are left out that do not reach nine of ten tips."""
    try:
        yield which, _fates_of(walk_of_settings(walks, walks.starts[which], threads), threads)
    except OutOfReach:
        if len(which) > 1:
            for half in np.array_split(which, 2):
                yield from _within_reach(walks, half, threads)


def _fates_of(walk: PhysicalWalk, threads: int | None) -> dict[str, np.ndarray]:
    static_loss = loss_time(static_plan(walk), threads=threads)
    return vars(walk.outcomes) | {
        "static_loss": static_loss, "mechanism": mechanisms(walk), "direction": fall_direction(walk)
    }  # fmt: skip
