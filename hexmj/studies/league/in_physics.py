"""What the league asks of a body: falls, what a walk costs, and how walks go on that meet something."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import begin, check_repeats
from hexmj.controllers.protocol import Controller
from hexmj.errors import OutOfReach, SimulationError, StillThrown
from hexmj.measures.frequency import over_start
from hexmj.measures.kinematic import first_loss
from hexmj.measures.outcome_table import UNITS
from hexmj.physics.drive import drive
from hexmj.physics.effort import EffortSoFar
from hexmj.physics.outcomes import Outcomes, OutcomesSoFar
from hexmj.physics.settling import settle
from hexmj.starts import draw_starts
from hexmj.studies.disturbance.cases import Case
from hexmj.studies.disturbance.disturbances import TooFewStable
from hexmj.studies.disturbance.stable_walks import StableWalks
from hexmj.studies.frequencies import came
from hexmj.studies.league.entrant import Entrant
from hexmj.timing import Stride, observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

REFUSALS = OutOfReach, SimulationError, StillThrown
"""Why a walk is no outcome."""

COLUMNS = {one.name: UNITS.get(one.name, "1") for one in fields(Outcomes)} | {"work": "mm", "torque": "1", "way": "mm"}
"""What is told of every walk, and its unit."""

DISTURBED = {"time": "time unit", "fall": "time unit"}
"""The same of a walk that is disturbed."""


def unless_refused(
    walked: Callable[[np.ndarray], "xr.Dataset"], n_starts: int, columns: Mapping[str, str]
) -> "xr.Dataset":
    """How every start goes; one whose walk is refused is NaN throughout and no outcome: it diverged, its tips are out
    of reach, or a push still throws it as the observation time ends.

    Args:
        walked: how some of the starts go, (n,), which does not depend on the others.
        n_starts: number of all.
        columns: what it tells of each, and its unit.
    """
    import xarray as xr

    everyone = np.arange(n_starts)
    with suppress(*REFUSALS):
        return walked(everyone)
    nothing = xr.Dataset({name: ("start", [np.nan], {"units": units}) for name, units in columns.items()})
    alone: list[xr.Dataset] = []
    for start in everyone[:, np.newaxis]:
        try:
            alone.append(walked(start))
        except REFUSALS:
            alone.append(nothing)
    return xr.concat(alone, "start")


def walks(
    entrant: Entrant,
    controller: Controller,
    velocity: float,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    threads: int | None = None,
) -> "xr.Dataset":
    """How every start goes.

    Args, beside those of `WalkSettings`:
        entrant: with whose starts it is walked.
        controller: plans: the entrant's own, or what was made of it.
        observation_time: 'walk', 'start' or the observation time [time units].

    Returns:
        Over start all `Outcomes`; of the joints the `work` over the insect's weight [mm] and the greatest `torque` over
        its limit, see `EffortSoFar`; and the `way` walked ahead [mm].  NaN as of `unless_refused`.

    Raises:
        SimulationError: none of the random starts comes to rest, whoever walks.
    """
    starts = entrant.starts(n_starts, seed, velocity, stride)
    duration = float(observation_duration(observation_time, velocity, stride))
    steps = int(steps_within(duration, stride))

    def walked(which: np.ndarray) -> "xr.Dataset":
        some = starts[which]
        check_repeats(controller, some, velocity, steps, stride)
        settled = settle(some, conditions, stride, threads)
        lost = first_loss(some, controller, velocity, duration, stride=stride, threads=threads)
        so_far, effort = OutcomesSoFar(settled, lost), EffortSoFar(settled)
        for chunk in drive(settled, begin(controller, some, velocity, stride), duration, threads=threads):
            so_far.add(chunk)
            effort.add(chunk)
        outcomes = so_far.outcomes()
        told = vars(outcomes) | {"work": effort.work / settled.compiled.weight, "torque": effort.torque}
        commanded = np.minimum(outcomes.fall, steps * stride.dt) * velocity
        return over_start(told | {"way": commanded * outcomes.speed}, COLUMNS)

    found = unless_refused(walked, len(starts), COLUMNS)
    if found.fall.isnull().all():
        _check_settles(draw_starts(n_starts, seed, stride), conditions, stride, threads)
    return found


def _check_settles(starts: np.ndarray, conditions: Conditions, stride: Stride, threads: int | None) -> None:
    """Refuse conditions in which no start comes to rest, whoever walks."""
    refused = []
    for start in starts:
        try:
            settle(start[np.newaxis], conditions, stride, threads)
            return
        except SimulationError as error:
            refused.append(error)
    raise refused[0]


def disturbed(
    entrant: Entrant,
    velocity: float,
    case: Case,
    observation_time: str | float,
    *,
    n_starts: int,
    seed: int,
    conditions: Conditions,
    stride: Stride,
    grid: int,
    threads: int | None = None,
) -> "xr.Dataset":
    """Whether starts `fell` that a disturbance met, over start: 1 or 0, or NaN where too few starts are stable until
    then, the insect fell before, or the walk is refused, see `unless_refused`; arguments as of `StableWalks`."""
    found = StableWalks(entrant.controller, velocity, n_starts, seed, stride, grid)
    asked = case, float(observation_duration(observation_time, velocity, stride)), None, conditions, threads
    try:
        times = unless_refused(lambda which: found.times(*asked, which)[[*DISTURBED]], n_starts, DISTURBED)
    except TooFewStable:
        return over_start({"fell": np.full(n_starts, np.nan)})
    fell = came(times.fall).where(~(times.fall <= times.time))
    return over_start({"fell": fell.values})
