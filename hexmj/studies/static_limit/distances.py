"""How far the walking insect is from its plan, or, if the plan reads the legs, from what these were told: a cell of the
static limit."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.measures.physical import PhysicalWalk, walk_of_settings
from hexmj.measures.support import grounded, pressure_margin
from hexmj.measures.walk_settings import WalkSettings
from hexmj.stability import loss_time, walk_margin

if TYPE_CHECKING:
    import xarray as xr

LOSSES = {"kinematic": "planned_loss", "measured": "measured_loss", "grounded": "grounded_loss", "physical": "fall"}
"""Measure of FLSS -> the outcome whose frequency it is: `compare.MEASURES`, and `grounded`, which is the measured one
with all the feet at the ground, see `measures.support`."""

DISTANCES = {  # units, long_name
    "margin": ("mm", "mean distance between measured and planned stability margin"),
    "margin_grounded": ("mm", "the same with all the feet at the ground"),
    "margin_pressure": ("mm", "the same of the margin of the centre of pressure"),
    "margin_same_feet": ("mm", "that of the measured one where the same feet stand"),
    "same_feet": ("1", "fraction of steps in which the same feet stand"),
    "same_feet_grounded": ("1", "the same with all the feet at the ground"),
    "drift": ("mm", "mean distance of the centre of mass from O"),
}
"""How far a measured walk is from its plan; counted until the plan loses stability or the insect falls."""

REPORTED = {"slip": "mm/s", "tracking": "mm"}
"""Other outcomes that are kept, with their units."""


def distance_table(walks: WalkSettings, threads: int | None = None) -> "xr.Dataset":
    """The outcomes of `LOSSES`, `DISTANCES` and `REPORTED` over start."""
    import xarray as xr

    walk = walk_of_settings(walks, walks.starts, threads)
    happened = vars(walk.outcomes) | {"grounded_loss": loss_time(grounded(walk), threads=threads)}
    lost = {name: ("start", happened[name], {"units": "time unit"}) for name in LOSSES.values()}
    off = {
        name: ("start", values, dict(zip(("units", "long_name"), DISTANCES[name], strict=True)))
        for name, values in distances(walk).items()
    }
    reported = {name: ("start", getattr(walk.outcomes, name), {"units": unit}) for name, unit in REPORTED.items()}
    return xr.Dataset(lost | off | reported)


def distances(walk: PhysicalWalk) -> dict[str, np.ndarray]:
    """`DISTANCES` of every start, (start,); NaN where the plan is lost at once."""
    told, measured, near = walk.ordered, walk.measured, grounded(walk)
    compared = told.time[:, None] < np.minimum(loss_time(told), walk.outcomes.fall)
    wanted, pressure = walk_margin(told), pressure_margin(walk)
    with np.errstate(invalid="ignore"):  # where no foot stands in either, which does not count
        off, off_grounded = (np.abs(walk_margin(one) - wanted) for one in (measured, near))
    same, same_near = ((one.stance == told.stance).all(axis=-1) for one in (measured, near))
    drift = np.linalg.norm(walk.centre_of_mass[..., :2] - walk.qpos[..., :2], axis=-1)
    touching = compared & measured.stance.any(axis=-1)  # without any foot there is no margin
    return {
        "margin": _mean(off, touching),
        "margin_grounded": _mean(off_grounded, touching),
        "margin_pressure": _mean(np.abs(pressure - wanted), compared & np.isfinite(pressure)),
        "margin_same_feet": _mean(off, touching & same),
        "same_feet": _mean(same, compared),
        "same_feet_grounded": _mean(same_near, compared),
        "drift": _mean(drift, compared),
    }


def _mean(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Mean over the steps `where` it counts, (start,), of (step, start)."""
    with np.errstate(invalid="ignore"):
        return np.where(where, values, 0.0).sum(axis=0) / where.sum(axis=0)
