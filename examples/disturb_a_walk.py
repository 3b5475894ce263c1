"""Halt an insect in mid-stride. The walk restarts from this posture, or the legs first move to another posture."""

import numpy as np

import hexmj
from hexmj.controllers.planning import planned_losses
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics.settle import settle
from hexmj.studies.disturbed_plans import Disturbed, collect_postures
from hexmj.studies.disturbed_walks import disturbance_of, find_stable_starts

V, STARTS = 0.6, 12
stride = hexmj.Stride()
stable = find_stable_starts(hexmj.LDVS, V, STARTS, seed=0, stride=stride, grid=1)
halt = disturbance_of(stable, "halt", hexmj.LDVS, V, stride)
settled = settle(stable.starts)
steps = int(halt.step.max()) + 1500
for name, postures in {"as they stand": None, "reorganised": collect_postures(hexmj.LDVS, V, 0, stride)}.items():
    halted = Disturbed(hexmj.LDVS, halt, postures)
    kinematic, physical = (halted.begin(stable.starts, np.full(STARTS, V), stride) for _ in range(2))
    lost = planned_losses(kinematic, np.array(steps))
    fell = outcomes_of_plan(settled, physical, steps * stride.dt, np.where(lost, lost * stride.dt, np.inf)).fall
    rest = stride.dt * np.mean(kinematic.resumed - halt.step)
    lose, fall = np.count_nonzero(lost), np.count_nonzero(np.isfinite(fell))
    print(f"legs {name}: rest {rest:.0f} time units, {lose} of {STARTS} lose static stability, {fall} fall")
