"""Plans that do not fit, that say what makes no sense, or that raise: refused, and never an outcome."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import hexmj
from hexmj.controllers import Step, stepwise
from hexmj.controllers.planning import advanced
from hexmj.measures.physical import physical_outcomes, physical_walk_of_plan
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.studies.entrants import Entrant
from hexmj.studies.league import in_physics
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

    def __init__(self, starts):
        self._plan, self.starts, self.stride, self.done = plan_of(starts), starts, STRIDE, 0

    def advance(self, steps):
        self.done += steps
        return self._plan.advance(max(1, steps - 1))


class Fractional(Short):
    """A plan that counts its steps in floats."""

    def __init__(self, starts):
        super().__init__(starts)
        self.done = 0.0


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
    "steps in floats": (lambda s: Fractional(s.starts), "a plan's done = 0.0; expected a whole number of at least 0"),
    "other starts": (elsewhere_begun, "other starts: leg R1 of start 1 at 3.0 mm; expected -?[0-9.]+ mm$"),
    "too few starts": (lambda s: plan_of(s.starts[:1]), r"the plan is of other starts, \(1, 6\); expected the 2"),
    "another stride": (lambda s: plan_of(s.starts, hexmj.Stride(dt=0.2)), "the plan's stride is Stride"),
    "not at time 0": (advanced_plan, "the plan is at step 3; expected one at time 0"),
    "too few steps": (
        lambda s: Short(s.starts),
        r"asked for 4 steps, and gave \(3, 2, 6\); expected \(4, 2, 6\)",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_plan_that_does_not_fit_is_refused(settled, case):
    make, words = REFUSED[case]
    with pytest.raises(hexmj.InputError, match=words) as refused:
        list(drive(settled, make(settled), 0.4))
    assert "\n" not in str(refused.value)
    planned = hexmj.walk(settled.starts, LDVS, 0.5, 0.4)
    with pytest.raises(hexmj.InputError, match=words):
        physical_walk_of_plan(settled, make(settled), planned)


LIES = {
    "a tip that is NaN": lambda walk: replace(walk, x=np.full_like(walk.x, np.nan)),
    "a tip beside that is inf": lambda walk: replace(walk, y=np.full(walk.x.shape, np.inf)),
    "a height that is inf": lambda walk: replace(walk, height=np.full(walk.x.shape, np.inf)),
    "too few steps": lambda walk: part_of(walk, slice(1, None)),
    "states as numbers": lambda walk: replace(walk, stance=walk.stance.astype(float)),
    "no walk": lambda walk: [walk],
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
    """Draws where its legs step anew, whenever it begins."""

    name: str = "restless"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        inner = LDVS.begin(starts, velocity, stride, acceleration)
        shift = np.random.default_rng().uniform(0.0, 1.0, starts.shape)

        def step(v):
            walk = inner.advance(1)
            return Step(walk.x[0] - shift, walk.stance[0])

        return stepwise(step, starts, velocity, stride, acceleration)


@pytest.mark.parametrize(
    "measured",
    [
        lambda starts: hexmj.physical_walk(starts, Restless(), 0.5, 2.0),
        lambda starts: hexmj.compare(Restless(), [0.5], n_starts=2, observation_time=2.0),
        lambda starts: in_physics.walks(
            Entrant(Restless()),
            Restless(),
            0.5,
            2.0,
            n_starts=2,
            seed=0,
            conditions=hexmj.Conditions(),
            stride=hexmj.Stride(),
        ),
    ],
    ids=["a walk", "both measures", "the league"],
)
def test_a_controller_that_plans_otherwise_when_it_begins_again_is_refused(measured):
    with pytest.raises(hexmj.InputError, match="plans another walk when it begins again: x is"):
        measured(hexmj.draw_starts(2, 0))


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
    with pytest.raises(hexmj.InputError, match="asked for"):
        physical_outcomes(settled, Ended(), 0.5, 0.6)


def test_a_plan_that_goes_on_by_other_steps_is_refused():
    plan = LDVS.begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)
    true, plan.advance = plan.advance, lambda steps: true(steps + 1)
    with pytest.raises(hexmj.InputError, match="a plan is at step 4 after it was asked for 3 more; expected 3"):
        advanced(plan, 3)


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("physical", [False, True])
def test_a_plan_that_makes_no_sense_is_never_an_outcome(lie, physical):
    starts = hexmj.draw_starts(2, 0)
    with pytest.raises(hexmj.InputError, match=r"a plan|a walk's"):
        if physical:
            hexmj.physical_walk(starts, Liar(lie), 0.3, 5.0)
        else:
            hexmj.first_loss(starts, Liar(lie), 0.3, 5.0)


@dataclass(frozen=True)
class Raises:
    """Raises something in its third step."""

    what: type[BaseException]
    name: str = "raises"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        done = 0

        def step(v):
            nonlocal done
            done += 1
            if done == 3:
                raise self.what("no more")
            return Step(starts, True)

        return stepwise(step, starts, velocity, stride, acceleration)


@pytest.mark.parametrize("what", [ZeroDivisionError, SystemExit])
def test_what_a_controller_raises_is_said_in_one_sentence(what):
    with pytest.raises(hexmj.InputError, match=rf"{what.__name__} in .*test_refused_plans.py, line \d+: no more"):
        hexmj.first_loss(hexmj.draw_starts(2, 0), Raises(what), 0.3, 5.0)
