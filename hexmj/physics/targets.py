"""From the planned walk to the tips that the legs must follow, physics step by physics step.

The plan says where a tip is along its line and whether it swings; here it gets a height.  A foot is raised in
`Body.lift_time` as its leg begins to protract, and lowered over the last `Body.landing_time` before AEP_0, so that it
meets the ground where the plan lets it stand.  Where a swing ends elsewhere it is lowered from then on.  These are
times of the physical world: both transitions vanish against the stride as V_p goes to zero.

A foot that was lowered in 5 ms from AEP_0 on struck the ground at up to 2.2 m/s and sank in by up to 1.8 mm.  It also
stood late: at V = 0.5 and V_p = 20 mm/s the measured FLSS was 0.72 instead of 0.67 (100 starts, planned 0.57).

The ground comes half a millimetre early, since the body sags, so a foot must be slow over the last millimetre already:
with a height that began as phase^3 it struck at 0.3 to 0.4 m/s, and each physics step took it 0.25 mm deeper.  And feet
raised in 5 ms shook the body until middle feet that stood hopped.  Of 228 times that a foot was deeper than 2 % of the
standing height (LDVS, V = 0.5, 60 starts) 32 are left, of 100 (`own-0.1`, 20 starts) 2; `strikes` takes care of these.
Longer landing times leave fewer, but feet that are low for longer catch the body: at 40 ms the physical FLSS at V = 0.5
and V_p = 20 mm/s is 0.45 instead of 0.52 (planned 0.57).  The time of raising does not matter to it between 2.5 and
20 ms.
"""

from typing import Any

import numpy as np
from numba import njit

from hexmj.parameters import Network
from hexmj.physics.body import Body
from hexmj.walks import Walk

EVENLY = 0.25
"""Share of the height that is raised and lowered evenly; it decides how fast a foot meets the ground."""


class TipTargets:
    """The targets of many starts, made as the plan goes on."""

    def __init__(self, starts: np.ndarray, body: Body, network: Network) -> None:
        """All feet stand at the starts, (start, leg) [mm]."""
        self._x = np.array(starts)
        self._stance = np.ones(starts.shape, dtype=bool)
        self._lift = np.zeros(starts.shape)
        self._body, self._network = body, network
        self._origin, self._y = np.array(network.geometry.origin), np.array(network.geometry.y)

    def follow(self, plan: Walk, ids: np.ndarray) -> np.ndarray:
        """Tips in the root frame at the end of each substep of the plan's steps.

        Args:
            plan: the next steps of the walk, of all starts.
            ids: the starts that are still wanted, (n,).

        Returns:
            (n, substep, leg, 3) [mm]: forward, left, up.
        """
        body, network = self._body, self._network
        m = body.substeps(network)
        tips = np.empty((len(ids), len(plan.time) * m, 6, 3))
        substep = 1000.0 * body.seconds(network) / m
        lift = substep / body.lift_time, substep / body.landing_time, body.landing_distance
        shape = m, *lift, network.aep0, body.step_height, body.standing_height, self._origin, self._y
        _follow(plan.x, plan.stance, ids, self._x, self._stance, self._lift, *shape, tips)
        self._x[ids], self._stance[ids] = plan.x[-1, ids], plan.stance[-1, ids]
        return tips


def standing_tips(x: np.ndarray, body: Body, network: Network) -> np.ndarray:
    """Tips on the ground in the root frame, (..., leg, 3) [mm], where they are at `x`, (..., leg), on their axes."""
    tips = x + np.array(network.geometry.origin), np.broadcast_to(network.geometry.y, x.shape)
    return np.stack([*tips, np.full(x.shape, -body.standing_height)], axis=-1)


@njit(cache=True, nogil=True)
def _follow(
    x: Any, stance: Any, ids: Any, x_old: Any, s_old: Any, lift: Any, m: int, rise: float, sink: float, landing: float,
    aep0: float, step_height: float, standing_height: float, origin: Any, y: Any, tips: Any,
) -> None:  # fmt: skip
    """Between two steps a tip moves evenly; its height is a smooth function of the phase of its lift, 0 to 1.

    The phase tends to 1 in swing and to 0 in stance, and on the way ahead to the distance from AEP_0 within `landing`
    of it [mm]; on the way back, as when legs are reorganised, nothing tells where a swing will end.
    """
    for i, start in enumerate(ids):
        for leg in range(6):
            x_from, s, phase = x_old[start, leg], s_old[start, leg], lift[start, leg]
            for n in range(len(x)):
                x_to = x[n, start, leg]
                for sub in range(m):
                    at = x_from + (x_to - x_from) * ((sub + 1.0) / m)
                    wanted = 0.0 if s else 1.0 if x_to < x_from else min(max((aep0 - at) / landing, 0.0), 1.0)
                    phase = min(phase + rise, max(phase - sink, wanted))
                    height = step_height * (EVENLY * phase + (1.0 - EVENLY) * phase**4 * (5.0 - 4.0 * phase))
                    tip = tips[i, n * m + sub, leg]
                    tip[0] = origin[leg] + at
                    tip[1] = y[leg]
                    tip[2] = height - standing_height
                x_from, s = x_to, stance[n, start, leg]
            lift[start, leg] = phase
