"""Halt an insect in mid-stride: it begins again from there, or puts its legs in order first."""

import numpy as np

import hexmj
from hexmj.experiments.disturbance import disturbance, draw_walkers
from hexmj.experiments.disturbed_plan import DisturbedPlan
from hexmj.experiments.disturbed_walks import planned_losses
from hexmj.experiments.strategies import collect_postures
from hexmj.physics.physical_walks import outcomes_of_plan
from hexmj.physics.settling import settle

V, STARTS = 0.6, 12
network = hexmj.Network()
walkers = draw_walkers(hexmj.LDVS, V, STARTS, seed=0, network=network, grid=1)
halt = disturbance("halt", walkers, hexmj.LDVS, V, network)
settled = settle(walkers.starts)
duration = 0.1 * halt.step.max() + 150.0  # time units
for name, postures in {"as they stand": None, "reorganised": collect_postures(hexmj.LDVS, V, 0, network)}.items():
    plans = [DisturbedPlan(walkers.starts, hexmj.LDVS, V, halt, postures=postures) for _ in range(2)]
    lost = planned_losses(plans[0], round(duration / network.dt))
    fell = outcomes_of_plan(settled, plans[1], duration, lost).fall
    print(
        f"legs {name}: rest {network.dt * np.mean(plans[0].resumed - halt.step):.0f} time units,"
        f" {np.isfinite(lost).sum()} of {STARTS} lose stability on paper, {np.isfinite(fell).sum()} fall"
    )
