"""One start as a recording, and what is said of it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.loss_frequency import draw_starts, observation_time
from hexmj.network import walk
from hexmj.parameters import Model
from hexmj.progress import progress_bar

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.cli import Conditions


def recorded(
    model: Model, velocity: float, start: int, conditions: "Conditions", title: str, physical: bool
) -> "xr.Dataset":
    """A recording of one of the seed's starts."""
    from hexmj import recording
    from hexmj.physics.physical_walks import physical_walk

    if start < 0:
        raise InputError(f"start = {start}; expected at least 0")
    starts = draw_starts(start + 1, conditions.seed, conditions.network)[start:]
    acceleration = conditions.options["acceleration"]
    time = float(observation_time(conditions.time, np.array(velocity), conditions.network, acceleration))
    if not physical:
        plan = walk(starts, model, velocity, time, **conditions.options)
        return recording.record_plan(plan, conditions.body, conditions.network, title=title)
    with progress_bar("walking") as progress:
        walked = physical_walk(
            starts, model, velocity, time, body=conditions.body, progress=progress, **conditions.options
        )
    return recording.record(walked, title=title)


def walk_summary(walked: "xr.Dataset") -> dict[str, Any]:
    """When a recorded walk lost stability or fell [time units], and its least margins [mm]."""
    from hexmj.comparison import REPORTED
    from hexmj.physics.insect import TRUNK

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
            "fell on": TRUNK[part] if part >= 0 else None,
        }
        summary |= {named(walked[name]): walked[name].item() for name in REPORTED}
    return summary


def named(value: "xr.DataArray") -> str:
    """Name and unit of one of a recording's numbers."""
    unit = value.attrs["units"]
    return f"{value.name} [{unit}]" if unit != "1" else str(value.name)
