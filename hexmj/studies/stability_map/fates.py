"""What happens to every start at one velocity and one value of a condition: a cell of a stability map."""

from dataclasses import fields
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, SimulationError
from hexmj.measures.outcome_table import UNITS
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.settling import settle
from hexmj.stability import loss_time
from hexmj.starts import draw_starts
from hexmj.storage.mjcf import content
from hexmj.studies.stability_map.mechanisms import fall_direction, mechanisms, static_plan
from hexmj.timing import Acceleration, Stride

if TYPE_CHECKING:
    import xarray as xr

BLOCK = 100
"""Starts walked at a time: their walks are kept whole, 0.5 GB at V = 0.1."""


def fates(
    controller: Controller,
    velocity: float,
    duration: float,
    *,
    n_starts: int,
    seed: int,
    over: str,
    conditions: Conditions,
    stride: Stride,
    acceleration: Acceleration | None,
    threads: int | None = None,
) -> "xr.Dataset":
    """Every field of `Outcomes`, `static_loss`, `mechanism` (index) and `direction` of the fall [rad], over start.

    Args:
        controller: plans the walks.
        velocity: V_r, or its final value.
        duration: observation time [time units].
        n_starts: number of starts; those that cannot stand on six feet are left out.
        seed: of the starts.
        over: the condition that the map varies.
        conditions: of the walks.
        stride: step range, lines of the tips and time step.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the table does not depend on it.

    Raises:
        InputError, SimulationError: no start that stands; see `measures.physical.physical_walk`.
    """
    import xarray as xr

    stands = standing_starts(n_starts, seed, conditions, stride, threads, content(conditions.body.mjcf))
    if not stands.size:
        value = conditions.flat()[over]
        raise InputError(f"{over} = {value:g}; none of {n_starts} starts stands on six feet there")
    starts, parts = draw_starts(n_starts, seed, stride)[stands], []
    for block in np.split(starts, range(BLOCK, len(starts), BLOCK)):
        walk = physical_walk(
            block, controller, velocity, duration,
            conditions=conditions, stride=stride, acceleration=acceleration, threads=threads,
        )  # fmt: skip
        parts.append(_fates_of(walk, threads))
    units = UNITS | {"static_loss": "time unit", "direction": "rad"}
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    variables = {name: ("start", values, {"units": units.get(name, "1")}) for name, values in columns.items()}
    return xr.Dataset(variables, {"start": stands})


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
    except SimulationError as error:
        if error.state:
            raise
        if len(starts) == 1:
            return np.array([False])
        halves = np.array_split(starts, 2)
        return np.concatenate([_stands(half, conditions, stride, threads) for half in halves])
    return np.ones(len(starts), dtype=bool)


def _fates_of(walk: PhysicalWalk, threads: int | None) -> dict[str, np.ndarray]:
    outcomes = {one.name: getattr(walk.outcomes, one.name) for one in fields(Outcomes)}
    static_loss = loss_time(static_plan(walk), threads=threads)
    return outcomes | {
        "static_loss": static_loss, "mechanism": mechanisms(walk), "direction": fall_direction(walk)
    }  # fmt: skip
