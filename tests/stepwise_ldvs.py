"""LDVS by way of `stepwise`, as it is or changed, and whether two plans are the same."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.walks import PlannedWalk

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS
Change = Callable[[PlannedWalk, int], dict[str, Any]]


@dataclass(frozen=True)
class Own:
    """LDVS by way of `stepwise`, or what a test makes of it."""

    change: Change | None = field(default=None, compare=False)
    name: str = "own"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        inner = LDVS.begin(starts, velocity, stride, acceleration)

        def step(v):
            walk = inner.advance(1)
            changed = self.change(walk, inner.done) if self.change else {}
            return Step(**({"x": walk.x[0], "stance": walk.stance[0]} | changed))

        return stepwise(step, starts, velocity, stride, acceleration)


def plan_of(starts, stride=STRIDE, change=None):
    return Own(change).begin(starts, np.full(len(starts), 0.5), stride)


def same(one: PlannedWalk, other: PlannedWalk) -> bool:
    names = ("time", "velocity", "x", "y", "stance", "aep", "height")
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == "height") for name in names)
