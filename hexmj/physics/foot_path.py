"""From the planned walk to the tips that the legs must follow, physics step by physics step.

The plan says where a tip is and whether it swings; where it leaves the height to the body, a foot is raised in
`Conditions.lift_time` as its leg begins to protract, and lowered over the last `Conditions.landing_time` before the AEP
that the plan names, so that it meets the ground where the plan lets it stand.  Where a swing ends elsewhere it is
lowered from then on.  These are times of the physical world: both transitions vanish against the stride as V_p goes to
zero.

The ground comes half a millimetre early, since the body sags, so a foot is slow over the last millimetre already, and
`fine_steps` takes care of those that are not.  `docs/feet_that_land.md` tells which paths were tried.
"""

from typing import Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.jitted import jitted
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk

EVENLY = 0.25
"""Share of the height that is raised and lowered evenly; it decides how fast a foot meets the ground."""


class TipTargets:
    """The targets of many starts, made as the plan goes on."""

    def __init__(self, starts: np.ndarray, conditions: Conditions, stride: Stride) -> None:
        """All feet stand at the starts, (start, leg) [mm]."""
        self._x = np.array(starts, order="C")
        self._y = np.tile(stride.geometry.y, (len(starts), 1))
        self._stance = np.ones(starts.shape, dtype=bool)
        self._lift, self._height = np.zeros(starts.shape), np.zeros(starts.shape)
        self._conditions, self._substeps = conditions, conditions.substeps(stride)
        substep = 1000.0 * conditions.seconds(stride) / self._substeps
        self._rates = substep / conditions.lift_time, substep / conditions.landing_time, conditions.landing_distance
        self._origin = np.array(stride.geometry.origin)

    def follow(self, plan: PlannedWalk, ids: np.ndarray) -> np.ndarray:
        """Tips in the root frame, (n, substep, leg, 3) forward, left and up [mm], at the end of each substep.

        They are those of some starts, (n,), in the next steps of their plan, which is of all starts.
        """
        m, conditions = self._substeps, self._conditions
        tips = np.empty((len(ids), len(plan.time) * m, 6, 3))
        planned = plan.x, plan.y, plan.stance, plan.aep, plan.height
        wanted = tuple(map(np.ascontiguousarray, planned))  # of one layout, for it would be compiled for each
        last = self._x, self._y, self._stance, self._lift, self._height
        _follow(
            wanted, ids, last, m, self._rates, (conditions.step_height, conditions.standing_height), self._origin, tips
        )
        for values, old in ((plan.x, self._x), (plan.y, self._y), (plan.stance, self._stance)):
            old[ids] = values[-1, ids]
        return tips


def standing_tips(x: np.ndarray, standing_height: float, stride: Stride) -> np.ndarray:
    """Tips on the ground in the root frame, (..., leg, 3) [mm], where they are at `x`, (..., leg), on their axes."""
    tips = x + np.array(stride.geometry.origin), np.broadcast_to(stride.geometry.y, x.shape)
    return np.stack([*tips, np.full(x.shape, -standing_height)], axis=-1)


@jitted
def _follow(wanted: Any, ids: Any, last: Any, m: int, rates: Any, heights: Any, origin: Any, tips: Any) -> None:
    """Between two steps a tip moves evenly; where the plan names no height, that is a smooth function of the phase of
    its lift, 0 to 1.

    The phase tends to 1 in swing and to 0 in stance, and to the distance from the AEP within `landing` of it [mm].
    """
    x, y, stance, aep, own_height = wanted
    x_old, y_old, s_old, lift, height_old = last
    rise, sink, landing = rates
    step_height, standing_height = heights
    for i, start in enumerate(ids):
        for leg in range(6):
            x_from, y_from, s = x_old[start, leg], y_old[start, leg], s_old[start, leg]
            phase, height = lift[start, leg], height_old[start, leg]
            for n in range(len(x)):
                x_to, y_to, end, own = x[n, start, leg], y[n, start, leg], aep[n, start, leg], own_height[n, start, leg]
                ahead, height_from = x_to >= x_from, height
                for sub in range(m):
                    part = (sub + 1.0) / m
                    at = x_from + (x_to - x_from) * part
                    left = end - at if ahead else at - end
                    wanted = 0.0 if s else 1.0 if np.isnan(end) else min(max(left / landing, 0.0), 1.0)
                    phase = min(phase + rise, max(phase - sink, wanted))
                    if np.isnan(own):
                        height = step_height * (EVENLY * phase + (1.0 - EVENLY) * phase**4 * (5.0 - 4.0 * phase))
                    else:
                        height = height_from + (own - height_from) * part
                    tip = tips[i, n * m + sub, leg]
                    tip[0] = origin[leg] + at
                    tip[1] = y_from + (y_to - y_from) * part
                    tip[2] = height - standing_height
                x_from, y_from, s = x_to, y_to, stance[n, start, leg]
            lift[start, leg], height_old[start, leg] = phase, height
