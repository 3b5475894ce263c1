"""Laws of the tip targets: no jumps, a lift that takes its time in milliseconds, plan and target agree."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexmj.bodies.kinematics import standing_tips
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import HWS, LDVS, UNCOORDINATED
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.measures.kinematic import walk
from hexmj.physics.foot_path import EVENLY, TipTargets
from hexmj.starts import draw_starts
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk

STRIDE = Stride()
LINES = np.stack([STRIDE.geometry.origin, STRIDE.geometry.y], axis=-1)  # (leg, axis)


def all_tips(
    conditions: Conditions,
    controller: Controller = LDVS,
    velocity: float = 0.6,
    steps: int = 600,
    size: int = 20,
    chunk: int = 60,
) -> tuple[np.ndarray, PlannedWalk]:
    """Tips of every substep, (start, substep, leg, 3), made in chunks, and the whole plan."""
    starts = draw_starts(size, 0)
    plan, targets = begin(controller, starts, velocity, STRIDE), TipTargets(starts, conditions, STRIDE)
    tips = [targets.follow(plan.advance(chunk), np.arange(size)) for _ in range(steps // chunk)]
    return np.concatenate(tips, axis=1), walk(starts, controller, velocity, steps * STRIDE.dt)


def planned(
    x: np.ndarray, stance: np.ndarray, y: np.ndarray | None = None, height: np.ndarray | None = None
) -> PlannedWalk:
    """A plan of one start, all (step, leg); on the lines and lifted by the body unless told, and no AEP is named."""
    unknown = np.full(x.shape, np.nan)
    rows = {
        "x": x,
        "y": np.broadcast_to(LINES[:, 1], x.shape) if y is None else y,
        "stance": stance,
        "aep": unknown,
        "height": unknown if height is None else height,
    }
    whole = {name: values[:, np.newaxis] for name, values in rows.items()}
    return PlannedWalk(STRIDE.dt * np.arange(1, len(x) + 1), np.zeros((len(x), 1)), **whole)


@pytest.mark.parametrize("vp", [20.0, 80.0, 400.0])
@pytest.mark.parametrize("controller", [HWS, LDVS, UNCOORDINATED], ids=lambda one: one.name)
def test_no_tip_jumps(vp: float, controller: Controller):
    """Along its line a tip moves at most V_p; up and down at most as at a phase of 3/4, where it is steepest."""
    conditions = Conditions(vp=vp)
    path = conditions
    tips, _ = all_tips(conditions, controller)
    seconds = conditions.timestep(STRIDE)
    moved = np.abs(np.diff(tips, axis=1))
    assert moved[..., 0].max() <= vp * seconds * (1 + 1e-9)
    assert moved[..., 1].max() == 0.0
    up = np.diff(tips[..., 2], axis=1)
    steepest = (EVENLY + (1 - EVENLY) * 20 * 0.75**3 * 0.25) * path.step_height * 1000 * seconds * (1 + 1e-9)
    assert up.max() <= steepest / path.lift_time
    assert -up.min() <= steepest / path.landing_time
    assert tips[..., 2].min() >= -path.standing_height
    assert tips[..., 2].max() <= path.step_height - path.standing_height + 1e-12


def test_a_foot_is_slow_where_the_ground_may_come_early():
    """Half a millimetre above the planned ground, as far as the body sags, a foot falls at less than 0.2 m/s."""
    conditions = Conditions()
    tips, _ = all_tips(conditions)
    height = tips[..., 2] + conditions.standing_height
    speed = -np.diff(height, axis=1) / (1000.0 * conditions.timestep(STRIDE))  # mm/ms = m/s
    low = (height[:, 1:] <= 0.5) & (speed > 0)
    assert low.any()
    assert speed[low].max() < 0.2 < speed.max()


def test_targets_at_the_plans_steps_are_the_plan():
    conditions = Conditions()
    tips, plan = all_tips(conditions)
    m = conditions.substeps(STRIDE)
    assert_allclose(tips[:, m - 1 :: m, :, 0].swapaxes(0, 1), plan.feet[..., 0], rtol=0, atol=1e-12)
    assert_array_equal(tips[:, m - 1 :: m, :, 1].swapaxes(0, 1), plan.y)


def test_lift_takes_its_milliseconds_whatever_vp():
    """A foot is at full height exactly one lift time after its swing began, if the swing lasts that long."""
    for vp in (20.0, 50.0):
        conditions = Conditions(vp=vp, lift_time=25.0)
        path, m = conditions, conditions.substeps(STRIDE)
        tips, plan = all_tips(conditions, velocity=0.3, steps=900)
        substep_ms = 1000.0 * conditions.timestep(STRIDE)
        n, start, leg = np.argwhere(plan.stance[:-1] & ~plan.stance[1:])[0] + [1, 0, 0]
        rising = tips[start, (n + 1) * m :, leg, 2]
        full = np.argmax(rising >= path.step_height - path.standing_height - 1e-9) + 1
        assert full * substep_ms == pytest.approx(path.lift_time, abs=substep_ms)


@pytest.mark.parametrize("vp", [20.0, 80.0])
def test_feet_meet_the_ground_at_their_aep(vp: float):
    """Wherever a swing ends at AEP_0, within a step of the plan; those that end earlier take their landing time."""
    conditions = Conditions(vp=vp)
    path, m = conditions, conditions.substeps(STRIDE)
    tips, plan = all_tips(conditions, velocity=0.3, steps=900)
    height = tips[:, m - 1 :: m, :, 2].swapaxes(0, 1) + path.standing_height
    lands = ~plan.stance[:-1] & plan.stance[1:]
    there = lands & (plan.x[1:] >= STRIDE.aep0)
    assert there.sum() > 100
    assert (height[1:][there] < 1e-9).all()
    wait = int(np.ceil(path.landing_time / 1000.0 / conditions.seconds(STRIDE))) + 1
    early = np.argwhere(lands[:-wait] & (plan.x[1:-wait] < STRIDE.aep0 - conditions.landing_distance))
    stay = [one for one in early.tolist() if plan.stance[one[0] + 1 : one[0] + 1 + wait, one[1], one[2]].all()]
    assert stay
    for step, start, leg in stay:
        assert height[step + wait, start, leg] < 1e-9


def test_a_leg_that_swings_back_is_lifted_at_once():
    """And stays up as long as nothing tells where its swing ends."""
    conditions, steps = Conditions(), 60
    x, stance = np.full((steps, 6), STRIDE.aep0), np.ones((steps, 6), dtype=bool)
    x[:, 0] -= STRIDE.dt * np.arange(steps)
    stance[:, 0] = False
    path, m = conditions, conditions.substeps(STRIDE)
    tips = TipTargets(x[:1], conditions, STRIDE).follow(planned(x, stance), np.arange(1))
    height = tips[0, :, 0, 2] + path.standing_height
    full = m + round(path.lift_time / 1000.0 / conditions.timestep(STRIDE))  # it swings from the first step's end
    assert_allclose(height[full - 1 :], path.step_height)


def test_a_leg_that_swings_on_its_spot_is_lifted_until_that_is_where_its_swing_ends():
    """Two legs that stay where they are in swing: one shall come down ahead of there, the other there."""
    conditions, steps, start = Conditions(), 60, np.zeros((1, 6))
    x, stance, aep = np.zeros((steps, 6)), np.ones((steps, 6), dtype=bool), np.full((steps, 6), STRIDE.aep0)
    stance[:, :2], aep[:, 1] = False, 0.0
    plan = replace(planned(x, stance), aep=aep[:, np.newaxis])
    height = TipTargets(start, conditions, STRIDE).follow(plan, np.arange(1))[0, -1, :, 2]
    path = conditions
    assert height[0] == pytest.approx(path.step_height - path.standing_height)
    assert_array_equal(height[1:], -path.standing_height)


def test_feet_that_stand_still_have_standing_tips():
    starts, conditions = draw_starts(3, 2), Conditions()
    plan = begin(UNCOORDINATED, starts, 0.0, STRIDE)
    standing = standing_tips(starts, conditions.standing_height, STRIDE)
    tips = TipTargets(starts, conditions, STRIDE).follow(plan.advance(4), np.arange(3))
    assert standing.shape == (3, 6, 3)
    assert_array_equal(tips, np.broadcast_to(standing[:, np.newaxis], tips.shape))


@pytest.mark.parametrize(("vp", "m"), [(400.0, 1), (80.0, 2), (20.0, 8)])
def test_a_height_of_its_own_and_a_place_beside_the_line_are_honoured(vp: float, m: int):
    """At the end of each step they are what the plan says, between the steps they change evenly."""
    conditions, rng, steps = Conditions(vp=vp), np.random.default_rng(5), 12
    assert conditions.substeps(STRIDE) == m
    x, aside, height = (rng.uniform(*range_, (steps, 6)) for range_ in ((-10, 10), (-4, 4), (0, 9)))
    y, stance, start = LINES[:, 1] + aside, rng.random((steps, 6)) < 0.5, np.zeros((1, 6))
    targets, halves = TipTargets(start, conditions, STRIDE), (slice(5), slice(5, None))
    parts = [planned(x[half], stance[half], y[half], height[half]) for half in halves]
    tips = np.concatenate([targets.follow(part, np.arange(1))[0] for part in parts])
    at_steps = np.stack([x + LINES[:, 0], y, height - conditions.standing_height], axis=-1)
    at_first = np.concatenate([LINES, np.full((6, 1), -conditions.standing_height)], axis=1)
    whole = np.concatenate([at_first[np.newaxis], at_steps]).reshape(steps + 1, -1)
    time = np.arange(1, steps * m + 1) / m
    wanted = np.stack([np.interp(time, np.arange(steps + 1), one) for one in whole.T], axis=1)
    assert_allclose(tips.reshape(steps * m, -1), wanted, rtol=0, atol=1e-12)
    assert_allclose(tips[m - 1 :: m], at_steps, rtol=0, atol=1e-12)


def test_starts_left_out_change_nothing_for_the_others():
    starts, conditions = draw_starts(6, 1), Conditions()
    whole, part = TipTargets(starts, conditions, STRIDE), TipTargets(starts, conditions, STRIDE)
    plan = begin(LDVS, starts, 0.5, STRIDE)
    for ids in (np.arange(6), np.array([0, 2, 5]), np.array([2])):
        ahead = plan.advance(40)
        assert_array_equal(whole.follow(ahead, np.arange(6))[ids], part.follow(ahead, ids))


def test_substeps_are_whole_and_short_enough():
    for vp in (20.0, 80.0, 99.9, 100.0, 400.0):
        conditions = Conditions(vp=vp)
        m = conditions.substeps(STRIDE)
        assert conditions.timestep(STRIDE) <= 0.000625 + 1e-12
        assert m == 1 or conditions.seconds(STRIDE) / (m - 1) > 0.000625
    assert Conditions().substeps(STRIDE) == 2
    assert Conditions(vp=40.0).seconds(STRIDE) == pytest.approx(0.0025)


@pytest.mark.parametrize("name", ["lift_time", "landing_time", "step_height", "friction", "longest_substep"])
def test_conditions_out_of_range_are_refused(name: str):
    with pytest.raises(InputError):
        Conditions(**{name: -1.0})  # pyright: ignore[reportArgumentType]
