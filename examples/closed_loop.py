"""Compare LDVS without and with sensory feedback: unloaded, and with a load of twice the insect's weight."""

import numpy as np

import hexmj

for load in (0.0, 2.0):
    open_loop, closed_loop = (
        hexmj.compare(controller, [0.5], n_starts=10, observation_time=100.0, conditions=hexmj.Conditions(load=load))
        for controller in (hexmj.LDVS, hexmj.SensoryFeedback(hexmj.LDVS))
    )
    differ = np.isfinite(open_loop.fall.values) != np.isfinite(closed_loop.fall.values)
    print(
        f"load {load:g}: physical FLSS {open_loop.physical.item():.2f} in the open loop,"
        f" {closed_loop.physical.item():.2f} with sensory feedback; {differ.sum()} of 10 starts end differently"
    )
