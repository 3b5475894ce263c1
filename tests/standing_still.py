"""Controllers of one's own that stand, one of them sometimes out of its legs' reach."""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.controllers.stepwise import Step, stepwise


@dataclass(frozen=True)
class Still:
    """A controller of one's own that can neither be steered nor reads its legs: it stands."""

    name: str = "still"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """All feet recede to PEP_min and stay there."""
        x = starts

        def step(v):
            nonlocal x
            x = np.maximum(x - v[:, None] * stride.dt, stride.pep_min)
            return Step(x, np.ones(x.shape, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)


@dataclass(frozen=True)
class Stretched(Still):
    """The same; where the first leg starts ahead of its origin, that leg is told to stand where none reaches."""

    name: str = "stretched"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """As `Still`, with a tip far beside its line."""
        plan = super().begin(starts, velocity, stride, acceleration, threads)
        y = np.tile(stride.geometry.y, (len(starts), 1))
        y[starts[:, 0] > 0] *= 3
        still = plan.step
        plan.step = lambda v: replace(still(v), y=y)
        return plan
