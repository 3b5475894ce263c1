"""Every combination of readings and orders against the plain network, to the last bit; each is compiled by itself.

    PYTHONPATH=tests python -m tests.long.every_reading

Random weights, starts, geometries and accelerations as in `tests/test_network.py`, which has six of the 144.
"""

import sys
from itertools import product
from typing import get_args, get_type_hints

import numpy as np

from hexmj.controllers.cruse1998 import Cruse1998, Order
from hexmj.controllers.cruse1998.readings import Reading
from hexmj.legs import CENTRED, FIG1
from hexmj.measures.kinematic import first_loss, walk
from hexmj.timing import Acceleration, Stride
from tests import plain_network
from tests.test_network import NEAR, random_starts, random_weights

CASES, SIZE, STEPS = 6, 3, 250


def same(order: Order, reading: Reading, rng: np.random.Generator) -> bool:
    """Whether a random network walks the same by both, step by step and in its first losses."""
    weights, starts, velocity = random_weights(rng), random_starts(rng, SIZE), rng.uniform(0.0, 0.95)
    stride = Stride(geometry=(FIG1, CENTRED, NEAR)[rng.integers(3)], dt=rng.choice([0.1, 0.25]))
    acceleration = Acceleration(rng.uniform(1e-4, 0.02), start=velocity / 2) if rng.random() < 0.5 else None
    controller, duration = Cruse1998(weights, order, reading=reading), STEPS * stride.dt
    options = {"stride": stride, "acceleration": acceleration, "threads": 1}
    fast = walk(starts, controller, velocity, duration, **options)
    lost = first_loss(starts, controller, velocity, duration, **options)
    for i, start in enumerate(starts.tolist()):
        x, s, v = plain_network.walk(start, weights, velocity, STEPS, stride, order, acceleration, reading)
        unstable = [n for n in range(STEPS) if not plain_network.stable(x[n], s[n], stride)]
        first = (unstable[0] + 1) * stride.dt if unstable else np.inf
        arrays = (fast.x[:, i], x), (fast.stance[:, i], np.array(s) == 1), (fast.velocity[:, i], v)
        if lost[i] != first or not all(np.array_equal(one, other) for one, other in arrays):
            return False
    return True


def main() -> int:
    choices = [get_args(hint) for hint in get_type_hints(Reading).values()]
    networks = [(order, Reading(*chosen)) for order in get_args(Order) for chosen in product(*choices)]
    rng, differ = np.random.default_rng(0), 0
    for n, (order, reading) in enumerate(networks):
        wrong = sum(not same(order, reading, rng) for _ in range(CASES))
        differ += wrong
        print(f"{n + 1} of {len(networks)}: {order}, {reading}: {wrong} of {CASES} differ", flush=True)
    print(f"{len(networks)} networks, {len(networks) * CASES * SIZE} walks of {STEPS} steps: {differ} cases differ")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
