"""Walks of three leg periods: when do weight sets first lose static stability, and which legs swing together then?"""

import numpy as np

import hexmj
from hexmj.paper.protocol import PRINTED, found_sets

V = 0.6
period = hexmj.Stride().periods(V)  # of a single leg [time units]
starts = hexmj.draw_starts(1000, seed=1998)
ideal = found_sets()["walk", V, V, PRINTED]
for name, controller in {"HWS": hexmj.HWS, "LDVS": hexmj.LDVS, "ideal": ideal}.items():
    plan = hexmj.walk(starts, controller, V, 3 * period)
    lost = hexmj.walk_margin(plan) <= 0  # (step, start)
    losers = np.flatnonzero(lost.any(axis=0))
    first = lost[:, losers].argmax(axis=0)
    up = ~plan.stance[first, losers]  # (loser, leg): swings
    opposite = (up[:, :3] & up[:, 3:]).any(axis=1)
    neighbours = (up[:, [0, 1, 3, 4]] & up[:, [1, 2, 4, 5]]).any(axis=1)
    print(
        f"{name}: FLSS {len(losers) / len(starts):.2f}, in the first period {np.mean(plan.time[first] < period):.2f};"
        f" swing together: neighbours {neighbours.mean():.2f}, opposite legs {opposite.mean():.2f}"
    )
