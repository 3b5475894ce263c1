"""Open against closed loop on the same starts: unloaded, and with twice the insect's weight on its back."""

import numpy as np

import hexmj

for load in (0.0, 2.0):
    by_itself, model_variant = (
        hexmj.compare(controller, [0.5], n_starts=10, observation_time=100.0, conditions=hexmj.Conditions(load=load))
        for controller in (hexmj.LDVS, hexmj.SensoryFeedback(hexmj.LDVS))
    )
    other = np.isfinite(by_itself.fall.values) != np.isfinite(model_variant.fall.values)
    print(
        f"load {load:g}: physical FLSS {by_itself.physical.item():.2f} by itself, {model_variant.physical.item():.2f}"
        f" reading the legs; another end for {other.sum()} of 10 starts"
    )
