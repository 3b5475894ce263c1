"""Controllers of a user's own that are disturbed: ones that lift feet themselves, and ones that hand on another's."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from hexmj import LDVS, UNCOORDINATED, Conditions, Cruse1998, InputError, SensoryFeedback, Stride, physical_walk
from hexmj.controllers.checked_plans import begin
from hexmj.controllers.protocol import is_steerable
from hexmj.controllers.baselines.table import BASELINES
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import PAUSE, Disturbance, Disturbed, disturbance_of, find_stable_starts

STRIDE, V = Stride(), 0.5
STABLE = find_stable_starts(LDVS, V, 6, 0, STRIDE, 20)
STEPS = int(STABLE.step.max()) + 900
PAUSED = round(PAUSE / STRIDE.dt)


def disturbance(kind: Any) -> Disturbance:
    return disturbance_of(STABLE, kind, LDVS, V, STRIDE)


@dataclass(frozen=True)
class Lifts:
    """LDVS, which lifts its feet itself, and steps beside its lines."""

    name: str = "lifts"

    def begin(self, *given, **how) -> Any:
        return self.begin_at_speed(*given, **how)

    def begin_at_speed(self, *given, **how) -> Any:
        plan: Any = LDVS.begin_at_speed(*given, **how)
        goes_on = plan.advance

        def advance(steps):
            walk = goes_on(steps)
            return replace(walk, y=walk.y + 0.01 * walk.x, height=np.where(walk.stance, 0.0, 9.0))

        plan.advance = advance
        return plan


def test_a_halted_start_puts_its_feet_down_where_they_are():
    disturbed = Disturbed(Lifts(), disturbance("halt"))
    walk = disturbed.begin(STABLE.starts, np.full(6, V), STRIDE).advance(STEPS)
    for start, step in enumerate(STABLE.step):
        rest = slice(step, step + PAUSED)
        assert np.isnan(walk.height[rest, start]).all() and walk.stance[rest, start].all()
        assert (walk.y[rest, start] == walk.y[step - 1, start]).all() and (
            walk.y[:step, start] != walk.y[0, start]
        ).any()
        assert not np.isnan(walk.height[step + PAUSED :, start]).any()


@dataclass(frozen=True)
class MadeForHalf(Lifts):
    """It does so at half the usual V_p."""

    name: str = "made for 40 mm/s"

    def begin_at_speed(self, *given: Any, **how: Any) -> Any:
        plan = Lifts.begin_at_speed(self, *given, **how)
        plan.made_for = Conditions(vp=40.0)
        return plan


@pytest.mark.parametrize("around", [Disturbed(MadeForHalf(), disturbance("push")), SensoryFeedback(MadeForHalf())])
def test_what_a_plan_is_made_for_is_handed_on(around: Any):
    with pytest.raises(InputError, match=r"the plan is made for vp = 40\.0; expected that of the conditions, 80\.0"):
        physical_walk(STABLE.starts, around, V, 5.0)


@dataclass(frozen=True)
class HandsOn:
    """Plans in a way of its own, and hands on all else that it is asked for."""

    inner: Any = LDVS
    name: str = "hands on"

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def begin(self, *given: Any, **how: Any) -> Any:
        return UNCOORDINATED.begin(*given, **how)


@dataclass(frozen=True)
class Heir(Cruse1998):
    """The network, which begins as another one."""

    def begin(self, *given: Any, **how: Any) -> Any:
        return UNCOORDINATED.begin(*given, **how)


@pytest.mark.parametrize("controller", [HandsOn(), Heir(LDVS.weights, name="heir")], ids=["hands on", "heir"])
def test_a_controller_whose_begin_at_speed_is_of_another_begin_is_not_disturbed_by_it(controller: Any):
    with pytest.raises(InputError, match=r"h.* cannot be disturbed; expected .* begin_at_speed"):
        begin(Disturbed(controller, disturbance("halt")), STABLE.starts, V, STRIDE)


class AtSpeed:
    """For controllers that walk at their final velocity at once."""

    def begin_at_speed(self: Any, starts, velocity, stride, acceleration=None, threads=None) -> Any:
        return self.begin(starts, velocity, stride, None, threads)


@dataclass(frozen=True)
class Mixed(AtSpeed):
    """With `begin` of its own."""

    name: str = "mixed"

    def begin(self, *given: Any, **how: Any) -> Any:
        return LDVS.begin(*given, **how)


class Logged:
    """For those that have it, to note that it was asked for."""

    def begin_at_speed(self, *given: Any, **how: Any) -> Any:
        return super().begin_at_speed(*given, **how)  # pyright: ignore[reportAttributeAccessIssue]


@dataclass(frozen=True)
class LoggedNetwork(Logged, Cruse1998):
    """The network's own two."""


@dataclass(frozen=True)
class LoggedHeir(Logged, Heir):
    """Of which the network's own does not go with the heir's `begin`."""


@dataclass(frozen=True)
class OfTheClass(Mixed):
    """Whose `begin` is the class's."""

    @classmethod
    def begin(cls, *given: Any, **how: Any) -> Any:
        return LDVS.begin(*given, **how)


def test_mixins_go_with_the_begin_of_the_class_that_they_are_mixed_into():
    assert is_steerable(Mixed()) and is_steerable(OfTheClass()) and is_steerable(LoggedNetwork(LDVS.weights))
    assert not is_steerable(LoggedHeir(LDVS.weights))


@dataclass(frozen=True)
class Stands(Lifts):
    """On all its feet."""

    name: str = "stands"

    def begin_at_speed(self, *given: Any, **how: Any) -> Any:
        plan: Any = LDVS.begin_at_speed(*given, **how)
        goes_on = plan.advance
        plan.advance = lambda steps: replace(goes_on(steps), stance=np.ones((steps, *plan.starts.shape), dtype=bool))
        return plan


def test_no_leg_is_stopped_of_a_controller_that_lifts_none():
    with pytest.raises(InputError, match="of stands: of 6 of 6 starts no leg protracts within 100 periods"):
        disturbance_of(STABLE, "leg", Stands(), V, STRIDE)


def test_a_start_that_is_halted_restarts_beside_tips_that_are_some(monkeypatch):
    """What it hands on is the plan's own to change, and of starts that do not restart it is where they began."""
    starts, given = draw_starts(6, 0), []
    righetti: Any = BASELINES["righetti"]
    plan_of = type(righetti.begin(starts, np.full(6, 0.5), Stride()))
    restart = plan_of.restart

    def kept(plan, which, tips):
        given.append(tips.copy())
        restart(plan, which, tips.copy())
        tips[:], which[:] = np.nan, True

    disturbed = Disturbed(righetti, Disturbance("halt", np.arange(6) * 50 + 20, np.zeros(6, dtype=int)))
    usual = begin(disturbed, starts, 0.5, Stride()).advance(600)
    monkeypatch.setattr(plan_of, "restart", kept)
    walk = begin(disturbed, starts, 0.5, Stride()).advance(600)
    assert np.array_equal(walk.x, usual.x)
    assert len(given) == 6
    assert np.array_equal(given[0][1:], starts[1:])
