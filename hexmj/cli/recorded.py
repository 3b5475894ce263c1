"""One start as a recording, and what is said of it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.cli.walking_command import WalkingCommand
from hexmj.controllers.protocol import Controller
from hexmj.progress import progress_bar
from hexmj.threads import check_memory
from hexmj.timing import observation_duration, steps_within

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.measures.physical import PhysicalWalk

KEPT = 2000
"""Memory that a step of a recording takes until it is written, as measured [bytes]."""


def recorded(
    command: WalkingCommand,
    controller: Controller,
    velocity: float,
    start: int,
    *,
    physical: bool = True,
    title: str,
    threads: int | None = None,
) -> "xr.Dataset":
    """A recording of one of the seed's starts: what the insect did, or, unless `physical`, a puppet of the plan."""
    from hexmj.measures.kinematic import walk
    from hexmj.replay.recording import record, record_plan

    if physical:
        return record(walked_start(command, controller, velocity, start, threads), title=title)
    starts, time, how = _asked(command, velocity, start, threads)
    with progress_bar("walking"):
        planned = walk(starts, controller, velocity, time, **how)
    return record_plan(planned, command.conditions, how["stride"], title=title)


def walked_start(
    command: WalkingCommand, controller: Controller, velocity: float, start: int, threads: int | None = None
) -> "PhysicalWalk":
    """The physical walk of one of the seed's starts."""
    from hexmj.measures.physical import physical_walk

    starts, time, how = _asked(command, velocity, start, threads)
    with progress_bar("walking") as progress:
        how |= {"conditions": command.conditions, "progress": progress}
        return physical_walk(starts, controller, velocity, time, **how)


def _asked(
    command: WalkingCommand, velocity: float, start: int, threads: int | None
) -> tuple[np.ndarray, float, dict[str, Any]]:
    """A start, (1, leg) [mm], how long it walks [time units], and how."""
    from hexmj.starts import draw_start

    stride, acceleration = command.walks.stride, command.accelerating.procedure
    time = float(observation_duration(command.walks.time, np.array(velocity), stride, acceleration))
    check_memory(f"recordings of {time:g} time units", KEPT * int(steps_within(time, stride)))
    how = {"stride": stride, "acceleration": acceleration, "threads": threads}
    return draw_start(start, command.walks.seed, stride), time, how


def walk_summary(walked: "xr.Dataset") -> dict[str, Any]:
    """When a recorded walk lost stability or fell [time units], and its least margins [mm]."""
    from hexmj.measures.compare import REPORTED
    from hexmj.replay.recording import recorded_conditions

    summary: dict[str, Any] = {
        "time units": float(walked.time[-1]),
        "planned loss": float(walked.planned_loss_time),
        "least planned margin [mm]": float(walked.planned_margin.min()),
    }
    if "measured_margin" in walked:
        part = int(walked.fall_part)
        summary |= {
            "measured loss": float(walked.measured_loss_time),
            "least measured margin [mm]": float(walked.measured_margin.min()),
            "fall": float(walked.fall_time),
            "fell on": recorded_conditions(walked).body.trunk[part] if part >= 0 else None,
        }
        summary |= {named(walked[name]): walked[name].item() for name in REPORTED}
    return summary


def named(value: "xr.DataArray") -> str:
    """Name and unit of one of a recording's numbers."""
    unit = value.attrs["units"]
    return f"{value.name} [{unit}]" if unit != "1" else str(value.name)
