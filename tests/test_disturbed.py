"""Disturbed plans: halts, stopped legs, the strategies after them, and the starts that are stable until then."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from hexmj import LDVS, UNCOORDINATED, Acceleration, InputError, SensoryFeedback, Stride, first_loss, walk
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Sensed
from hexmj.stability import stability_margin, walk_margin
from hexmj.tasks.disturbed import (
    PAUSE,
    SETTLED,
    Disturbance,
    Disturbed,
    DisturbedPlan,
    Postures,
    collect_postures,
    find_stable_starts,
    reorganise,
)
from tiers import few_of

STRIDE, V, GRID = Stride(), 0.5, 20
STABLE = find_stable_starts(LDVS, V, 6, 0, STRIDE, GRID)
STEPS = int(STABLE.step.max()) + 900
PAUSED = round(PAUSE / STRIDE.dt)
EVERY = np.arange(6)


@pytest.fixture(scope="module")
def postures() -> Postures:
    return collect_postures(LDVS, V, 0, STRIDE)


def disturbance(kind, leg=None) -> Disturbance:
    return Disturbance(kind, STABLE.step, STABLE.draw, leg)


def begin_with(disturbance, postures=None, acceleration=None, threads=None) -> DisturbedPlan:
    disturbed = Disturbed(LDVS, disturbance, postures, slows=acceleration is not None)
    plan = begin(disturbed, STABLE.starts, V, STRIDE, acceleration, threads)
    assert isinstance(plan, DisturbedPlan)
    return plan


def plan(kind, *how, **more) -> DisturbedPlan:
    return begin_with(disturbance(kind), *how, **more)


def disturbed_at(kind) -> np.ndarray:
    """Return the step before which each start is disturbed, (start,)."""
    disturbed = plan(kind)
    disturbed.advance(STEPS)
    return disturbed.step


def sensing(postures=None, acceleration=None, kind="halt") -> Any:
    disturbed = Disturbed(LDVS, disturbance(kind), postures, slows=acceleration is not None)
    return SensoryFeedback(disturbed).begin(STABLE.starts, np.full(len(STABLE.starts), V), STRIDE, acceleration)


def sensed(ids, tips, gained) -> Sensed:
    """Tips on their own axes, (n, leg) [mm], and the feet that have met the ground, (n, leg)."""
    where = np.stack([tips + np.array(STRIDE.geometry.origin), tips * 0.0, tips * 0.0], axis=-1)
    nothing: Any = None
    return Sensed(ids, where, gained, gained, ~gained, *(6 * [nothing]))


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("velocity", "x", "stance"))


def test_a_push_does_not_change_the_plan():
    assert same(plan("push").advance(STEPS), walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt))


@pytest.mark.parametrize("kind", ["halt", "leg"])
def test_until_its_disturbance_a_walk_is_undisturbed(kind):
    whole, free = plan(kind).advance(STEPS), walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt)
    for start, step in enumerate(disturbed_at(kind)):
        assert np.array_equal(whole.x[:step, start], free.x[:step, start])
        assert not np.array_equal(whole.x[step : step + 100, start], free.x[step : step + 100, start])


def test_a_halt_is_a_new_start_from_where_the_legs_are():
    whole = plan("halt").advance(STEPS)
    tips = whole.x[STABLE.step - 1, EVERY]
    again = walk(tips, LDVS, V, 500 * STRIDE.dt)
    for start, step in enumerate(STABLE.step):
        rest = slice(step, step + PAUSED)
        assert (whole.x[rest, start] == tips[start]).all()
        assert whole.stance[rest, start].all() and not whole.velocity[rest, start].any()
        after = slice(step + PAUSED, step + PAUSED + 500)
        assert np.array_equal(whole.x[after, start], again.x[:, start])
        assert np.array_equal(whole.stance[after, start], again.stance[:, start])


@pytest.mark.parametrize("leg", [None, 4])
def test_one_swinging_leg_is_stopped_and_the_others_continue(leg):
    free, stopped = walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt), begin_with(disturbance("leg", leg))
    whole = stopped.advance(STEPS)
    for start, step in enumerate(stopped.step):
        changed = whole.x[step, start] != free.x[step, start]
        (index,) = np.flatnonzero(changed)
        assert leg in (None, index) and not free.stance[step - 1, start, index]
        waited = free.stance[STABLE.step[start] - 1 : step - 1, start]
        assert (waited if leg is None else waited[:, leg]).all()
        assert whole.x[step, start, index] == whole.x[step - 1, start, index] - V * STRIDE.dt


@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
@pytest.mark.parametrize("strategy", ["none", "reorganise", "slow_down"])
def test_a_plan_depends_neither_on_chunks_nor_on_threads(kind, strategy, postures):
    answer = {"reorganise": {"postures": postures}, "slow_down": {"acceleration": Acceleration(0.004)}}
    keywords = answer.get(strategy, {})
    whole = plan(kind, **keywords, threads=1).advance(STEPS)
    for chunk in (7, GRID, 611):
        chopped = plan(kind, **keywords, threads=2)
        while chopped.done < STEPS:
            first = chopped.done
            part = chopped.advance(min(chunk, STEPS - first))
            assert np.array_equal(part.time, whole.time[first : chopped.done])
            for name in ("velocity", "x", "stance"):
                assert np.array_equal(getattr(part, name), getattr(whole, name)[first : chopped.done])


@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
def test_slowing_down_begins_at_the_low_velocity_and_reaches_the_old_one(kind):
    slow = plan(kind, acceleration=Acceleration(0.01, 0.1))
    velocity = slow.advance(STEPS).velocity
    for start, step in enumerate(slow.resumed):
        expected = np.minimum(0.1 + 0.01 * STRIDE.dt * np.arange(500), V)
        np.testing.assert_allclose(velocity[step : step + 500, start], expected, atol=1e-3 * STRIDE.dt * 1.01)
        assert velocity[step + 500, start] == V


def test_the_nearest_posture_is_the_nearest(postures):
    tips = np.random.default_rng(0).uniform(-10, 10, 6)
    distances = np.linalg.norm(postures.tips - tips, axis=1)
    assert distances[postures.nearest(tips)] == distances.min()
    assert [postures.nearest(one) for one in postures.tips] == list(range(len(postures.tips)))


def test_postures_are_stable_and_walking_on_from_them_is(postures):
    walking = LDVS.begin(np.clip(postures.tips, -20.0, 10.0), np.full(len(postures.tips), V), STRIDE)
    walking.see(postures.tips, postures.standing)
    assert (walk_margin(walking.advance(600)) > 0).all()
    feet = np.stack([postures.tips + np.array(STRIDE.geometry.origin), postures.tips * 0 + STRIDE.geometry.y], -1)
    assert (stability_margin(feet, postures.standing) > 0).all()


def test_legs_are_reorganised_one_after_the_other_and_stably(postures):
    for start, tips in enumerate(walk(STABLE.starts, LDVS, V, 170.0).x[-1]):
        goal = postures.tips[postures.nearest(tips)]
        moved, standing = reorganise(tips, goal, STRIDE)
        way = np.diff(moved, axis=0, prepend=tips[None])
        assert (np.count_nonzero(way, axis=1) == 1).all() and (np.abs(way) <= STRIDE.dt + 1e-12).all(), start
        assert ((~standing).sum(axis=1) <= 1).all() and standing[-1].all()
        assert (np.abs(moved[-1] - goal) <= STRIDE.dt).all()
        lifted = np.abs(way).sum(axis=0) > 0
        assert np.array_equal(moved[-1][lifted], goal[lifted])
        feet = np.stack([moved + np.array(STRIDE.geometry.origin), moved * 0 + STRIDE.geometry.y], axis=-1)
        assert (stability_margin(feet, standing) > 0).all()


def test_a_reorganised_walk_goes_on_with_the_posture_s_states(postures):
    one = plan("halt", postures=postures)
    whole = one.advance(STEPS)
    for start, (step, resumed) in enumerate(zip(STABLE.step, one.resumed, strict=True)):
        standing = postures.standing[postures.nearest(whole.x[step - 1, start])]
        way = whole.x[resumed, start] - whole.x[resumed - 1, start]
        np.testing.assert_allclose(way, np.where(standing, -V, 1.0) * STRIDE.dt)
        assert not whole.velocity[step:resumed, start].any() and whole.velocity[resumed, start] == V


@pytest.mark.slow
@pytest.mark.parametrize("kind", few_of(["halt", "leg", "push"], "leg"))
@pytest.mark.parametrize("strategy", ["none", "reorganise", "slow_down"])
def test_a_disturbed_plan_that_senses_nothing_goes_on_by_itself(kind, strategy, postures):
    answers: dict[str, Any] = {
        "reorganise": {"postures": postures},
        "slow_down": {"acceleration": Acceleration(0.01, 0.1)},
    }
    answer = answers.get(strategy, {})
    one, other = sensing(**answer, kind=kind).advance(STEPS), plan(kind, **answer).advance(STEPS)
    assert np.array_equal(one.stance, other.stance)
    np.testing.assert_allclose(one.x, other.x, atol=1e-9)


def test_a_halted_start_holds_on_to_where_its_tips_were_seen():
    """From the second step on, whatever is read while it rests; it goes on from there."""
    whole = sensing()
    start = int(np.argmin(STABLE.step))
    step, one, feet = STABLE.step[start], np.array([start]), np.ones((1, 6), dtype=bool)
    before = whole.advance(step)
    tips = before.x[-1, one] - 0.2
    whole.sense(sensed(one, tips, feet))
    rest = [whole.advance(1)]
    for _ in range(PAUSED):
        whole.sense(sensed(one, tips + 0.3, feet))
        rest.append(whole.advance(1))
    np.testing.assert_allclose([row.x[0, start] for row in rest[1:-1]], np.tile(tips, (PAUSED - 1, 1)), atol=1e-12)
    assert all(row.stance[0, start].all() for row in rest[1:-1])
    np.testing.assert_allclose(rest[-1].x[0, start], tips[0] - V * STRIDE.dt)


def test_starts_are_stable_until_disturbed_and_do_not_depend_on_their_number():
    period = 20 * (1 + 1 / V) / STRIDE.dt
    assert (STABLE.step % GRID == 0).all()
    assert ((STABLE.step >= SETTLED * period) & (STABLE.step < (SETTLED + 1) * period + GRID)).all()
    assert np.isinf(first_loss(STABLE.starts, LDVS, V, STABLE.step * STRIDE.dt)).all()
    more = find_stable_starts(LDVS, V, 50, 0, STRIDE, GRID)
    for name in ("starts", "step", "draw"):
        assert np.array_equal(getattr(more, name)[:6], getattr(STABLE, name))


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


def test_walks_that_cannot_be_disturbed_are_errors():
    with pytest.raises(InputError):
        collect_postures(UNCOORDINATED, 0.9, 0, STRIDE)
    with pytest.raises(InputError):
        find_stable_starts(UNCOORDINATED, 0.9, 50_000, 0, STRIDE, GRID)
