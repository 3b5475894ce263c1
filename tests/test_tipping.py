"""Laws of dynamic stability: the pendulum of `hexmj.tipping`, compiled, in other plans and in readable form."""

from dataclasses import replace

import numpy as np
import pytest

import hexmj
import plain_network as plain
from hexmj.controllers.cruse1998.weights import general
from hexmj.controllers.planning import first_dynamic_losses, planned_dynamic_losses
from hexmj.legs import FIG1
from hexmj.tipping import GRAVITY, NO_FOOT, LossesSoFar, Pendulum
from stepwise_ldvs import Own
from tiers import few_of

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS
AT_80 = Pendulum.of(10.0, STRIDE.dt / 80.0)


def readable(margins: list[float], pendulum: Pendulum) -> tuple[int, int, float]:
    """The pendulum of one start, one step at a time: first static and dynamic loss, greatest excursion."""
    z = speed = most = 0.0
    lost = tipped = 0
    for n, margin in enumerate(margins, 1):
        lost = n if margin <= 0.0 and not lost else lost
        speed += pendulum.gain * (z - max(margin, NO_FOOT))
        z += speed
        if z <= 0.0:
            z = speed = 0.0
        most = max(most, z)
        if z > pendulum.height:
            tipped = n
            break
    return lost, tipped, most


@pytest.mark.parametrize("order", few_of(["printed", "undelayed", "sequential"], "printed"))
@pytest.mark.parametrize("acceleration", [None, hexmj.Acceleration(rate=0.01)])
def test_the_compiled_network_tips_like_the_readable_one(order, acceleration):
    """To the last bit: plain network, margins of its postures, plain pendulum."""
    controller, starts = replace(LDVS, order=order), hexmj.draw_starts(40, 5)
    steps = np.random.default_rng(5).integers(100, 600, len(starts))
    found = first_dynamic_losses(controller.begin(starts, np.full(40, 0.6), STRIDE, acceleration), steps, AT_80)
    expected = []
    for start, last in zip(starts.tolist(), steps.tolist(), strict=True):
        walk = plain.walk(start, general(controller.weights), 0.6, last, STRIDE, order, acceleration)
        x, stance = np.array(walk[0]), np.array(walk[1], dtype=bool)
        feet = np.stack([x + np.array(FIG1.origin), np.broadcast_to(FIG1.y, x.shape)], axis=-1)
        expected.append(readable(hexmj.stability_margin(feet, stance).tolist(), AT_80))
    for values, same in zip(found, np.transpose(expected), strict=True):
        assert np.array_equal(values, same)
    assert 0 < (found.dynamic > 0).sum() < (found.static > 0).sum()


@pytest.mark.slow
@pytest.mark.parametrize("name", hexmj.PRESETS)
def test_fast_tips_are_those_of_the_plan_whatever_the_threads_and_the_batch(name):
    starts, rng = hexmj.draw_starts(300, 3), np.random.default_rng(3)
    velocity, steps = rng.uniform(0.1, 0.9, 300), rng.integers(1, 700, 300)
    for acceleration in (None, hexmj.Acceleration(rate=0.05)):
        walks = hexmj.PRESETS[name], starts, velocity, STRIDE, acceleration
        fast, planned = (way(begin(*walks), steps, AT_80) for way in (first_dynamic_losses, planned_dynamic_losses))
        alone = first_dynamic_losses(begin(*walks, threads=1), steps, AT_80)
        for one, other, third in zip(fast, planned, alone, strict=True):
            assert np.array_equal(one, other)
            assert np.array_equal(one, third)


def begin(controller, *arguments, **options):
    return controller.begin(*arguments, **options)


def test_a_foreign_controller_tips_likewise():
    for measured in (hexmj.flss(one, [0.5], n_starts=60, measure="dynamic").flds.item() for one in (Own(), LDVS)):
        assert measured == hexmj.flss(LDVS, [0.5], n_starts=60, measure="dynamic", threads=1, range_of=7).flds.item()


def test_a_constant_margin_tips_as_the_equation_says():
    """z = |m| (cosh(t sqrt(g / h)) - 1) beyond the edge, and z = 0 inside of it."""
    seconds, height, outside = 1e-5, 10.0, 2.0
    so_far, n = LossesSoFar(Pendulum.of(height, seconds), 2), 20_000
    so_far.add(np.tile([-outside, outside], (n, 1)), np.full(2, n))
    time = np.arccosh(1.0 + height / outside) / np.sqrt(GRAVITY / height)
    assert so_far.losses.dynamic[0] * seconds == pytest.approx(time, rel=1e-3)
    assert so_far.losses.excursion[1] == so_far.losses.dynamic[1] == so_far.losses.static[1] == 0


def test_dynamic_stability_is_lost_after_static_stability_and_less_often_at_higher_speed():
    starts, frequencies = hexmj.draw_starts(2000, 0), []
    for vp in (5.0, 40.0, 160.0):
        static, dynamic, excursion = hexmj.dynamic_losses(starts, LDVS, 0.5, 180.0, conditions=hexmj.Conditions(vp=vp))
        assert np.array_equal(static, hexmj.first_loss(starts, LDVS, 0.5, 180.0))
        assert (dynamic >= static).all()
        assert (excursion[np.isinf(static)] == 0.0).all()
        frequencies.append(np.isfinite(dynamic).mean())
    assert np.isfinite(static).mean() >= frequencies[0] > frequencies[1] > frequencies[2] > 0.0


def test_outcomes_of_physical_walks_have_the_same_dynamic_loss():
    starts, conditions = hexmj.draw_starts(6, 2), hexmj.Conditions(vp=40.0)
    walked = hexmj.physical_walk(starts, LDVS, 0.6, 40.0, conditions=conditions).outcomes
    planned = hexmj.dynamic_losses(starts, LDVS, 0.6, 40.0, conditions=conditions)
    assert np.array_equal(walked.dynamic_loss, planned.dynamic)
    assert np.array_equal(walked.planned_loss, planned.static)
    assert np.isfinite(planned.dynamic).any()
