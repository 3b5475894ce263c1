"""The frequencies of a stability map, and what differs between its cells on the same starts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.bodies.loading import gravity
from hexmj.conditions import Conditions
from hexmj.intervals import paired_difference, wilson_intervals
from hexmj.measures.compare import BESIDE, MEASURES
from hexmj.studies.stability_map.mechanisms import MECHANISMS

if TYPE_CHECKING:
    import xarray as xr

FLSS = MEASURES | BESIDE | {"static": "static_loss"}
"""Measure -> the outcome whose frequency it is.  `static` is the planned polygon around the body's own centre of mass;
`kinematic` the same around O, which knows no condition."""


def with_differences(data: "xr.Dataset", reference: float) -> "xr.Dataset":
    """The frequencies, differences and counts of `StabilityMap.result` beside what happened to every start.

    Args:
        data: over (value, velocity, start).
        reference: value of the condition from which `change` is counted.
    """
    cells, size = ("value", "velocity"), data.sizes["start"]
    happened = {
        measure: np.isfinite(data[outcome].transpose(*cells, "start").values) for measure, outcome in FLSS.items()
    }
    new: dict[str, Any] = {}

    def put(name: str, middle: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
        for end, numbers in (("", middle), ("_low", low), ("_high", high)):
            new[name + end] = (cells, numbers, {"units": "1"})

    for measure, lost in happened.items():
        put(measure, lost.mean(axis=-1), *wilson_intervals(lost.sum(axis=-1), size))
    fell, static = happened["physical"], happened["static"]
    lost, saved = static.sum(axis=-1), (static & ~fell).sum(axis=-1)
    put("saved", np.where(lost > 0, saved / np.maximum(lost, 1), np.nan), *wilson_intervals(saved, lost))
    put("dynamics", *paired_difference(fell, static))
    row = data.value.values.tolist().index(reference)
    put("change", *paired_difference(fell, np.broadcast_to(fell[row], fell.shape)))
    names = data.mechanism.transpose(*cells, "start").values
    count = np.stack([(names == number).sum(axis=-1) for number in range(len(MECHANISMS))], axis=-1)
    new["count"] = ((*cells, "mechanism_name"), count, {"units": "1", "long_name": "number of starts"})
    return data.assign(new)


def froude(conditions: Conditions, velocity: np.ndarray) -> np.ndarray:
    """The Froude number (V V_p)^2 / (g h) at each V_r, (velocity,); h is the standing height."""
    return (velocity * conditions.time.vp) ** 2 / (gravity(conditions.body) * conditions.path.standing_height)
