"""Disturbed walks: the plan that meets a disturbance, the strategies, the starts, and the frequencies."""

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from hexmj import (
    HWS,
    LDVS,
    UNCOORDINATED,
    Acceleration,
    Conditions,
    Cruse1998,
    InputError,
    SensoryFeedback,
    Stride,
    first_loss,
    physical_walk,
    walk,
)
from hexmj.controllers.cruse1998.weights import general
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Sensed
from hexmj.stability import stability_margin, walk_margin
from hexmj.studies.disturbance import DisturbedWalks, with_flss_after
from hexmj.studies.disturbed_plans import (
    PAUSE,
    Disturbance,
    Disturbed,
    DisturbedPlan,
    Postures,
    collect_postures,
    reorganise,
)
from hexmj.studies.disturbed_walks import SETTLED, Case, StableWalks, disturbance_of, find_stable_starts
from hexmj.sweep import run_study
from tiers import few_of

STRIDE, V, GRID = Stride(), 0.5, 20
STABLE = find_stable_starts(LDVS, V, 6, 0, STRIDE, GRID)
STEPS = int(STABLE.step.max()) + 900
PAUSED = round(PAUSE / STRIDE.dt)
EVERY = np.arange(6)


@pytest.fixture(scope="module")
def postures() -> Postures:
    return collect_postures(LDVS, V, 0, STRIDE)


def disturbance(kind) -> Disturbance:
    return disturbance_of(STABLE, kind, LDVS, V, STRIDE)


def plan(kind, postures=None, acceleration=None, threads=None) -> DisturbedPlan:
    disturbed = Disturbed(LDVS, disturbance(kind), postures, slows=acceleration is not None)
    plan = begin(disturbed, STABLE.starts, V, STRIDE, acceleration, threads)
    assert isinstance(plan, DisturbedPlan)
    return plan


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


@pytest.mark.slow
def test_the_leg_that_is_stopped_is_one_that_protracts_as_the_legs_are_told():
    """Where none does, the next one that does."""
    stopped = Disturbance("leg", np.array([4, 4, 4]), np.array([1, 4, 5]))
    up = ~np.eye(6, dtype=bool)[[3, 4, 2]]
    tips, standing = stopped.legs(np.zeros((3, 6)), up)
    assert standing.all() and not tips.any()
    up[1] = True
    assert stopped.awaited(up).tolist() == [False, True, False]
    assert not replace(stopped, kind="halt").awaited(up).any()
    least = Disturbance("leg", np.array([300, 310, 320, 330, 340, 350]), np.array([0, 1, 2, 3, 4, 5]))
    free, *walks = (
        physical_walk(STABLE.starts, SensoryFeedback(one), V, (least.step.max() + 200) * STRIDE.dt)
        for one in (LDVS, Disturbed(LDVS, least), Disturbed(LDVS, replace(least, leg=(least.leg + 3) % 6)))
    )
    goes_on = np.flatnonzero(free.outcomes.fall > (least.step + 200) * STRIDE.dt)
    assert len(goes_on) > 3
    for stance in (one.ordered.stance for one in walks):
        for start in goes_on:
            first = np.flatnonzero((stance[:, start] != free.ordered.stance[:, start]).any(axis=1))[0] + 1
            assert least.step[start] < first < least.step[start] + 200
            assert stance[first - 1, start].sum() > free.ordered.stance[first - 1, start].sum()


def test_a_push_does_not_change_the_plan():
    assert same(plan("push").advance(STEPS), walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt))


@pytest.mark.parametrize("kind", ["halt", "leg"])
def test_until_its_disturbance_a_walk_is_undisturbed(kind):
    whole, free = plan(kind).advance(STEPS), walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt)
    for start, step in enumerate(disturbance(kind).step):
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


def test_a_stopped_leg_retracts_and_the_others_go_on():
    stopped, free = disturbance("leg"), walk(STABLE.starts, LDVS, V, STEPS * STRIDE.dt)
    whole = plan("leg").advance(STEPS)
    for start, (step, leg) in enumerate(zip(stopped.step, stopped.leg, strict=True)):
        assert not free.stance[step - 1, start, leg]
        assert free.stance[STABLE.step[start] - 1 : step - 1, start].all()  # the first moment at which one protracts
        assert whole.x[step, start, leg] == whole.x[step - 1, start, leg] - V * STRIDE.dt
        others = np.arange(6) != leg
        assert np.array_equal(whole.x[step, start, others], free.x[step, start, others])


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


def test_only_losses_after_the_disturbance_and_within_the_window_count():
    #              before, short, between, whole's end, later, never
    lost = [[5.0, 20.0, 31.0, 45.0, 45.1, np.inf], [np.inf, np.inf, np.inf, 12.0, np.inf, np.inf]]
    table = xr.Dataset(
        {
            "time": (("velocity", "case", "start"), np.full((1, 2, 6), 10.0)),
            "back": (("velocity", "case", "start"), np.full((1, 2, 6), 25.0)),
            "planned_loss": (("velocity", "case", "start"), [lost]),
        },
        coords={
            "duration": ("velocity", [20.0]),
            "disturbance": ("case", ["halt", "halt"]),
            "strategy": ("case", ["none", "slow_down"]),
        },
    )
    result = with_flss_after(table).isel(velocity=0)
    assert result.kinematic_reached.values.tolist() == [5, 6]
    np.testing.assert_allclose(result.kinematic.sel(observation_time="short"), [1 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic.sel(observation_time="whole"), [3 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic_buys.sel(observation_time="whole")[1], 2 / 5)
    assert (result.kinematic_low <= result.kinematic).all() and (result.kinematic <= result.kinematic_high).all()


FEW: dict[str, Any] = {"velocities": [V], "n_starts": 4, "observation_time": 30.0}


@pytest.mark.slow
def test_a_hard_push_fells_and_finished_walks_are_kept(tmp_path):
    pushed: dict[str, Any] = FEW | {"disturbances": ["push"], "strategies": [], "observation_time": 45.0}
    study = DisturbedWalks(LDVS, impulses=[60.0], **pushed)
    result = run_study(study, tmp_path, threads=1)
    assert result.physical_reached.values.tolist() == [[4, 4]]
    assert result.physical.sel(observation_time="whole").values.tolist() == [[0.0, 0.25]]
    assert (result.planned_loss.isel(case=0) == result.planned_loss.isel(case=1)).all()
    files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert len(files) == 2
    assert run_study(study, tmp_path, threads=2).identical(result)
    assert files == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    other = run_study(DisturbedWalks(LDVS, impulses=[50.0, 60.0], **pushed), threads=2)
    assert other.fall[0, 2].equals(result.fall[0, 1])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
def test_some_starts_alone_go_as_among_all(kind):
    walks = StableWalks(LDVS, V, 3, 0, STRIDE)
    asked = Case(kind, "none", 5.0 * (kind == "push")), 5.0, None, Conditions()
    every, alone = walks.times(*asked), walks.times(*asked, which=np.array([2, 0]))
    assert alone.identical(every.isel(start=[2, 0]))


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
class Stands(Lifts):
    """On all its feet."""

    name: str = "stands"

    def begin_at_speed(self, *given: Any, **how: Any) -> Any:
        plan: Any = LDVS.begin_at_speed(*given, **how)
        goes_on = plan.advance
        plan.advance = lambda steps: replace(goes_on(steps), stance=np.ones((steps, *plan.starts.shape), dtype=bool))
        return plan


def test_no_leg_is_stopped_of_a_controller_that_lifts_none():
    with pytest.raises(InputError, match="leg"):
        disturbance_of(STABLE, "leg", Stands(), V, STRIDE)


def test_any_weights_can_be_disturbed():
    """General weights have no hash."""
    controller = Cruse1998(general(HWS.weights))
    study = DisturbedWalks(controller, disturbances=["halt"], strategies=["reorganise"], kinematic=True, **FEW)
    assert np.isfinite(run_study(study).kinematic.sel(observation_time="whole")).all()


def test_without_physics_pushes_and_grasping_are_left_out():
    few: Any = {"disturbances": ["halt", "push"], "strategies": ["reorganise", "grasp"], "kinematic": True}
    cases = DisturbedWalks(LDVS, **FEW, **few).cases
    assert [(case.disturbance, case.strategy) for case in cases] == [
        ("undisturbed", "none"), ("halt", "none"), ("halt", "reorganise"),
    ]  # fmt: skip


def test_walks_that_cannot_be_disturbed_are_errors():
    with pytest.raises(InputError):
        collect_postures(UNCOORDINATED, 0.9, 0, STRIDE)
    with pytest.raises(InputError):
        find_stable_starts(UNCOORDINATED, 0.9, 50_000, 0, STRIDE, GRID)


@pytest.mark.slow
def test_the_command_writes_its_files(tmp_path, run):
    words = ["disturb", "--kinematic", "--velocity", 0.5, "--starts", 20, "--out", tmp_path / "out"]
    code, text, _ = run(*words, "--strategies", "slow_down", "--json")
    assert code == 0
    assert json.loads(text)["strategy"] == ["none", "none", "slow_down", "none", "slow_down"]
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"disturb.nc", "disturb.png", "manifest.json", "walks"}
