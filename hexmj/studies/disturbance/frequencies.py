"""FLSS after a disturbance, and what a strategy buys: the difference on the same starts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.studies.frequencies import differences, frequency

if TYPE_CHECKING:
    import xarray as xr

OBSERVATION_TIMES = ("whole", "short")
"""Both begin with the disturbance; `whole` ends an observation time after the walk is at its velocity again, `short`
an observation time after the disturbance."""

MEASURES = {"kinematic": "planned_loss", "physical": "fall"}
"""Measure of FLSS -> the time whose frequency it is."""

CLOSE = 1e-6
"""Times that differ by less are the same, but for rounding [time units]."""


def with_flss_after(data: "xr.Dataset") -> "xr.Dataset":
    """Add, over (observation time, velocity, case), the frequencies of both measures.

    `kinematic` is the fraction that loses static stability after the disturbance and within the observation time, of the
    `kinematic_reached` starts that have not lost it before, with its 95 % Wilson interval `_low`, `_high`.
    `kinematic_buys` is what the case's strategy takes off the FLSS of the same disturbance without a strategy, over
    the starts that reach it in both cases, with its 95 % interval.  The same of `physical` where there is one.
    """
    dims = ("observation_time", "velocity", "case")
    names = data.disturbance.values.tolist()
    without = [names.index(name) for name in names]  # the first case of a disturbance has no strategy
    new: dict[str, Any] = {"observation_time": list(OBSERVATION_TIMES)}
    time, back, duration = data.time.values, data.back.values, data.duration.values[:, None, None]
    ends = np.stack((back + duration, time + duration))
    for measure in [name for name, outcome in MEASURES.items() if outcome in data]:
        when = data[MEASURES[measure]].values
        reached = when > time + CLOSE
        lost = np.where(reached, when <= ends + CLOSE, np.nan)
        new |= frequency(measure, lost, dims) | differences(f"{measure}_buys", lost[:, :, without], lost, dims)
        new[f"{measure}_reached"] = (dims[1:], reached.sum(axis=-1), {"units": "1"})
    return data.assign(new)
