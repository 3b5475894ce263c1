"""Plans that do not fit their starts, or whose numbers are not finite: refused, and never an outcome."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.controllers.planning import advanced
from hexmj.measures.physical import physical_outcomes, physical_walk_of_plan
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.walks import PLANNED, part_of
from stepwise_ldvs import Own, plan_of

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS


@pytest.fixture(scope="module")
def settled():
    return settle(hexmj.draw_starts(2, 0))


def advanced_plan(settled):
    plan = plan_of(settled.starts)
    plan.advance(3)
    return plan


class Short:
    """A plan that stops short of what it is asked for."""

    def __init__(self, starts: np.ndarray):
        self._plan, self.starts, self.stride, self.done = plan_of(starts), starts, STRIDE, 0

    def advance(self, steps):
        self.done += steps
        return self._plan.advance(max(1, steps - 1))


class Rewritten(Short):
    """A plan that writes every part of its walk into the same arrays."""

    shown = None

    def advance(self, steps):
        self.done += steps
        walk = self._plan.advance(steps)
        self.shown = self.shown or walk
        for name in ("time", "velocity", *PLANNED):
            getattr(self.shown, name)[:] = getattr(walk, name)
        return self.shown


def elsewhere_begun(settled):
    starts = settled.starts.copy()
    starts[1, 3:5] = 3.0
    return plan_of(starts)


REFUSED = {
    "other starts": elsewhere_begun,
    "too few starts": lambda s: plan_of(s.starts[:1]),
    "another stride": lambda s: plan_of(s.starts, hexmj.Stride(dt=0.2)),
    "not at time 0": advanced_plan,
    "too few steps": lambda s: Short(s.starts),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_plan_that_does_not_fit_is_refused(settled, case):
    with pytest.raises(hexmj.InputError):
        list(drive(settled, REFUSED[case](settled), 0.4))
    planned = hexmj.walk(settled.starts, LDVS, 0.5, 0.4)
    with pytest.raises(hexmj.InputError):
        physical_walk_of_plan(settled, REFUSED[case](settled), planned)


LIES = {
    "a tip that is NaN": lambda walk: replace(walk, x=np.full_like(walk.x, np.nan)),
    "a tip beside that is inf": lambda walk: replace(walk, y=np.full(walk.x.shape, np.inf)),
    "a height that is inf": lambda walk: replace(walk, height=np.full(walk.x.shape, np.inf)),
    "too few steps": lambda walk: part_of(walk, slice(1, None)),
}


@dataclass(frozen=True)
class Liar:
    """LDVS by way of `stepwise`, whose plans say something else."""

    lie: str
    name: str = "liar"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        plan = Own().begin(starts, velocity, stride, acceleration, threads)
        true = plan.advance
        plan.advance = lambda steps: LIES[self.lie](true(steps))
        return plan


def test_a_plan_may_write_into_its_own_arrays_again(settled):
    plan = Rewritten(settled.starts)
    parts, whole = [advanced(plan, 9) for _ in range(3)], plan_of(settled.starts).advance(27)
    for name in ("time", "velocity", *PLANNED):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True)


@dataclass(frozen=True)
class Restless:
    """Shifts the tips by random numbers without a seed."""

    name: str = "restless"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        inner = LDVS.begin(starts, velocity, stride, acceleration)
        shift = np.random.default_rng().uniform(0.0, 1.0, starts.shape)

        def step(v):
            walk = inner.advance(1)
            return Step(walk.x[0] - shift, walk.stance[0])

        return stepwise(step, starts, velocity, stride, acceleration)


def test_a_controller_that_plans_otherwise_when_it_begins_again_is_refused():
    with pytest.raises(hexmj.InputError, match="x is"):
        hexmj.physical_walk(hexmj.draw_starts(2, 0), Restless(), 0.5, 2.0)


@dataclass(frozen=True)
class Ended:
    """LDVS by plans that have five steps."""

    name: str = "ended"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        plan = LDVS.begin(starts, velocity, stride, acceleration)
        endless = plan.advance
        plan.advance = lambda steps: endless(min(steps, 5 - plan.done))
        return plan


def test_no_more_steps_are_asked_for_than_the_walk_has(settled):
    assert len(physical_outcomes(settled, Ended(), 0.5, 0.5).fall) == 2
    with pytest.raises(hexmj.InputError, match="advance"):
        physical_outcomes(settled, Ended(), 0.5, 0.6)


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("physical", [False, True])
def test_a_plan_that_makes_no_sense_is_never_an_outcome(lie, physical):
    starts = hexmj.draw_starts(2, 0)
    with pytest.raises(hexmj.InputError):
        if physical:
            hexmj.physical_walk(starts, Liar(lie), 0.3, 5.0)
        else:
            hexmj.first_loss(starts, Liar(lie), 0.3, 5.0)
