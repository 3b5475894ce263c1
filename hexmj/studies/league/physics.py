"""What the league asks of a body: falls, what a walk costs, and how walks go on that meet something."""

from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.asking import begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import OutOfReach, SimulationError
from hexmj.measures.kinematic import first_loss
from hexmj.measures.outcome_table import UNITS
from hexmj.physics.drive import drive
from hexmj.physics.effort import EffortSoFar
from hexmj.physics.outcomes import Outcomes, OutcomesSoFar
from hexmj.physics.settling import settle
from hexmj.studies.disturbance.cases import Case
from hexmj.studies.disturbance.disturbances import TooFewStable
from hexmj.studies.disturbance.stable_walks import StableWalks
from hexmj.studies.league.entrant import Entrant
from hexmj.timing import Stride, observation_time

if TYPE_CHECKING:
    import xarray as xr

REFUSALS = OutOfReach, SimulationError
"""Why a walk is no outcome."""


def walks(
    entrant: Entrant,
    controller: Controller,
    velocity: float,
    window: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    threads: int | None = None,
) -> "xr.Dataset":
    """How every start goes.

    Args:
        entrant: with whose starts it is walked.
        controller: plans: the entrant's own, or what was made of it.
        velocity: V_r.
        window: 'walk', 'start' or the observation time [time units].
        n_starts: number of starts.
        seed: of the starts.
        conditions: of the walks.
        stride: step range, lines of the tips and time step.
        threads: one per core unless given; the outcomes do not depend on it.

    Returns:
        Over start all `Outcomes`; of the joints the `work` over the insect's weight [mm] and the greatest `torque` over
        its limit, see `EffortSoFar`; and the `way` walked ahead [mm].  A start whose walk is refused, since it diverged
        or its tips are out of reach, is NaN throughout and no outcome.

    Raises:
        OutOfReach, SimulationError: every walk is refused.
    """
    import xarray as xr

    starts = entrant.starts(n_starts, seed, velocity, stride)
    how: Any = {"conditions": conditions, "stride": stride, "threads": threads}
    walked = controller, velocity, float(observation_time(window, velocity, stride))
    try:
        return _outcomes(starts, *walked, **how)
    except REFUSALS:
        alone = [_unless_refused(start[None], *walked, **how) for start in starts]
    if not (known := [one for one in alone if one is not None]):
        raise
    nothing = xr.full_like(known[0], np.nan, dtype=float)
    return xr.concat([nothing if one is None else one for one in alone], "start")


def _unless_refused(start: np.ndarray, *walked: Any, **how: Any) -> "xr.Dataset | None":
    """The outcome of one start, (1, leg); None where its walk is refused."""
    with suppress(*REFUSALS):
        return _outcomes(start, *walked, **how)
    return None


def _outcomes(
    starts: np.ndarray,
    controller: Controller,
    velocity: float,
    duration: float,
    *,
    conditions: Conditions,
    stride: Stride,
    threads: int | None,
) -> "xr.Dataset":
    """Of all starts, (start, leg); see `walks`."""
    import xarray as xr

    settled = settle(starts, conditions, stride, threads)
    lost = first_loss(starts, controller, velocity, duration, stride=stride, threads=threads)
    so_far, effort = OutcomesSoFar(settled, lost), EffortSoFar(settled)
    for chunk in drive(settled, begin(controller, starts, velocity, stride), duration, threads=threads):
        so_far.add(chunk)
        effort.add(chunk)
    outcomes = so_far.outcomes()
    columns = {one.name: (getattr(outcomes, one.name), UNITS.get(one.name, "1")) for one in fields(Outcomes)}
    columns |= {"work": (effort.work / settled.compiled.weight, "mm"), "torque": (effort.torque, "1")}
    columns |= {"way": (np.minimum(outcomes.fall, duration) * velocity * outcomes.speed, "mm")}
    return xr.Dataset({name: ("start", values, {"units": units}) for name, (values, units) in columns.items()})


def disturbed(
    entrant: Entrant,
    velocity: float,
    case: Case,
    window: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    grid: int,
    threads: int | None = None,
) -> "xr.Dataset":
    """Whether starts `fell` that a disturbance met, over start: 1 or 0, or NaN where too few starts are stable until
    then, or the insect fell before; arguments as of `StableWalks`."""
    import xarray as xr

    found = StableWalks(entrant.controller, velocity, n_starts, seed, stride, grid)
    try:
        times = found.times(case, float(observation_time(window, velocity, stride)), None, conditions, threads)
    except TooFewStable:
        return xr.Dataset({"fell": ("start", np.full(n_starts, np.nan), {"units": "1"})})
    fell = np.where(times.fall <= times.time, np.nan, np.isfinite(times.fall))
    return xr.Dataset({"fell": ("start", fell, {"units": "1"})})
