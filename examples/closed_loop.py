"""Open against closed loop on the same starts: unloaded, and with twice the insect's weight on its back."""

import numpy as np

import hexmj

for load in (0.0, 2.0):
    by_itself, reading = (
        hexmj.compare(hexmj.LDVS, [0.5], starts=16, window=100.0, body=hexmj.Body(load=load, feedback=feedback))
        for feedback in (False, True)
    )
    other = np.isfinite(by_itself.fall) != np.isfinite(reading.fall)
    print(
        f"load {load:g}: physical FLSS {by_itself.physical.item():.2f} by itself, {reading.physical.item():.2f}"
        f" reading the legs; another end for {other.sum().item()} of 16 starts"
    )
