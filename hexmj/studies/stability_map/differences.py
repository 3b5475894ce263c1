"""The frequencies of a stability map, and what differs between its cells on the same starts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.bodies.loading import gravity
from hexmj.conditions import Conditions
from hexmj.measures.compare import BESIDE, MEASURES
from hexmj.studies.frequencies import differences, frequency
from hexmj.studies.stability_map.mechanisms import MECHANISMS

if TYPE_CHECKING:
    import xarray as xr

FLSS = MEASURES | BESIDE | {"static": "static_loss"}
"""Measure -> the outcome whose frequency it is.  `static` is the planned polygon around the body's own centre of mass;
`kinematic` the same around O, which knows no condition."""


def with_differences(data: "xr.Dataset", reference: float) -> "xr.Dataset":
    """The frequencies, differences and counts of `StabilityMap.result` beside what happened, over (value, velocity,
    start); `change` is counted from a reference, a value of the condition."""
    cells = ("value", "velocity")
    happened = {
        measure: np.isfinite(data[outcome].transpose(*cells, "start").values) for measure, outcome in FLSS.items()
    }
    new: dict[str, Any] = {}
    for measure, lost in happened.items():
        new |= frequency(measure, lost, cells)
    fell, static = happened["physical"], happened["static"]
    new |= frequency("saved", np.where(static, ~fell, np.nan), cells)
    row = data.value.values.tolist().index(reference)
    new |= differences("dynamics", fell, static, cells) | differences("change", fell, fell[row], cells)
    names = data.mechanism.transpose(*cells, "start").values
    count = np.stack([(names == number).sum(axis=-1) for number in range(len(MECHANISMS))], axis=-1)
    new["count"] = ((*cells, "mechanism_name"), count, {"units": "1", "long_name": "number of starts"})
    return data.assign(new)


def froude(conditions: Conditions, velocity: np.ndarray) -> np.ndarray:
    """The Froude number (V V_p)^2 / (g h) at each V_r, (velocity,); h is the standing height."""
    return (velocity * conditions.vp) ** 2 / (gravity(conditions.body) * conditions.standing_height)
