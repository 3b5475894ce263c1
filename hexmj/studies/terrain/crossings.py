"""What becomes of the starts at an obstacle: how many reach it, fall there or cross it."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.stats import wilson_intervals
from hexmj.timing import Stride, steps_within

if TYPE_CHECKING:
    import xarray as xr


def with_crossings(data: "xr.Dataset", distance: float, stride: Stride, begin: float, behind: float) -> "xr.Dataset":
    """The FLSS of the starts that reach an obstacle, and what else becomes of them, beside their outcomes.

    Args:
        data: over (obstacle, grasp, velocity, start).
        distance: to which all are told to walk, in whole steps [mm].
        stride: of these steps.
        begin: commanded distance at which a front foot may reach the obstacle [mm].
        behind: how far behind O a hind foot may stand [mm].
    """
    import xarray as xr

    time = steps_within(distance / data.velocity.values, stride) * stride.dt
    commanded = np.minimum(data.fall, data.velocity.copy(data=time)) * data.velocity
    walked = (data.speed * commanded).assign_attrs(units="mm", long_name="distance walked by O")
    upright, reaching = np.isinf(data.fall), commanded > begin
    after = reaching & ~upright
    reached, fell = reaching.sum("start"), after.sum("start")
    low, high = wilson_intervals(fell.values, reached.values)
    crossed = (upright & (walked > data.end + behind)).sum("start")
    unit = {"units": "1"}
    return data.assign(
        distance=walked,
        after=after.assign_attrs(unit, long_name="fell after it had reached the obstacle"),
        reached=reached.assign_attrs(unit, long_name="starts that reached the obstacle"),
        crossed=crossed.assign_attrs(unit, long_name="starts that crossed it without a fall"),
        flss=(fell / xr.where(reached > 0, reached, np.nan)).assign_attrs(unit, long_name="FLSS from there on"),
        flss_low=(fell.dims, low, unit),
        flss_high=(fell.dims, high, unit),
    )
