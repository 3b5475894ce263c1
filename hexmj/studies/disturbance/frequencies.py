"""FLSS after a disturbance, and what a strategy buys: the difference on the same starts."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.intervals import paired_difference, wilson_interval

if TYPE_CHECKING:
    import xarray as xr

WINDOWS = ("whole", "short")
"""Both begin with the disturbance; `whole` ends an observation time after the walk is at its velocity again, `short`
an observation time after the disturbance."""

MEASURES = {"kinematic": "planned_loss", "physical": "fall"}
"""Measure of FLSS -> the time whose frequency it is."""

CLOSE = 1e-6
"""Times that differ by less are the same, but for rounding [time units]."""


def with_flss_after(data: "xr.Dataset") -> "xr.Dataset":
    """Add, over (window, velocity, case), the frequencies of both measures.

    `kinematic` is the fraction that loses static stability after the disturbance and within the window, of the
    `kinematic_reached` starts that have not lost it before, with its 95 % Wilson interval `_low`, `_high`.
    `kinematic_buys` is what the case's strategy takes off the FLSS of the same disturbance without a strategy, over
    the starts that reach it in both cases, with its 95 % interval.  The same of `physical` where there is one.
    """
    dims = ("window", "velocity", "case")
    shape = (len(WINDOWS), data.sizes["velocity"], data.sizes["case"])
    none = {name: n for n, name in reversed(list(enumerate(data.disturbance.values)))}
    new: dict[str, Any] = {"window": list(WINDOWS)}
    time, back, duration = data.time.values, data.back.values, data.duration.values[:, None, None]
    ends = (back + duration, time + duration)
    for measure in [name for name, outcome in MEASURES.items() if outcome in data]:
        when = data[MEASURES[measure]].values
        reached = when > time + CLOSE
        table = {name: np.full((*shape, 3), np.nan) for name in (measure, f"{measure}_buys")}
        for window, i, n in np.ndindex(shape):
            lost = when[i] <= ends[window][i] + CLOSE
            here, other = reached[i, n], none[data.disturbance.values[n]]
            if here.any():
                count, size = int(lost[n, here].sum()), int(here.sum())
                table[measure][window, i, n] = count / size, *wilson_interval(count, size)
            both = here & reached[i, other]
            if both.any():
                table[f"{measure}_buys"][window, i, n] = paired_difference(lost[other, both], lost[n, both])
        for name, values in table.items():
            for end, part in zip(("", "_low", "_high"), np.moveaxis(values, -1, 0), strict=True):
                new[name + end] = (dims, part, {"units": "1"})
        new[f"{measure}_reached"] = (dims[1:], reached.sum(axis=-1), {"units": "1"})
    return data.assign(new)
