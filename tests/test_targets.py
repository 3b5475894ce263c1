"""Laws of the tip targets: no jumps, a lift that takes its time in milliseconds, plan and target agree."""

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.loss_frequency import draw_starts
from hexmj.network import NetworkRun, walk
from hexmj.parameters import HWS, LDVS, UNCOORDINATED, Network
from hexmj.physics.body import Body
from hexmj.physics.targets import EVENLY, TipTargets
from hexmj.walks import Walk


def all_tips(body: Body, model=LDVS, velocity=0.6, steps=600, size=20, stretch=60):
    """Tips of every substep, (start, substep, leg, 3), made in stretches, and the whole plan."""
    network, starts = Network(), draw_starts(size, 0)
    run, targets = NetworkRun(starts, model, velocity), TipTargets(starts, body, network)
    tips = [targets.follow(run.advance(stretch), np.arange(size)) for _ in range(steps // stretch)]
    return np.concatenate(tips, axis=1), walk(starts, model, velocity, steps * network.dt)


@pytest.mark.parametrize("vp", [20.0, 80.0, 400.0])
@pytest.mark.parametrize("model", [HWS, LDVS, UNCOORDINATED])
def test_no_tip_jumps(vp, model):
    """Along its line a tip moves at most V_p; up and down at most as at a phase of 3/4, where it is steepest."""
    body = Body(vp=vp)
    tips, _ = all_tips(body, model)
    seconds = body.seconds(Network()) / body.substeps(Network())
    moved = np.abs(np.diff(tips, axis=1))
    assert moved[..., 0].max() <= vp * seconds * (1 + 1e-9)
    assert moved[..., 1].max() == 0.0
    up = np.diff(tips[..., 2], axis=1)
    steepest = (EVENLY + (1 - EVENLY) * 20 * 0.75**3 * 0.25) * body.step_height * 1000 * seconds * (1 + 1e-9)
    assert up.max() <= steepest / body.lift_time
    assert -up.min() <= steepest / body.landing_time
    assert tips[..., 2].min() >= -body.standing_height
    assert tips[..., 2].max() <= body.step_height - body.standing_height + 1e-12


def test_a_foot_is_slow_where_the_ground_may_come_early():
    """Half a millimetre above the planned ground, as far as the body sags, a foot falls at less than 0.2 m/s."""
    body = Body()
    tips, _ = all_tips(body)
    height = tips[..., 2] + body.standing_height
    speed = -np.diff(height, axis=1) / (1000.0 * body.seconds(Network()) / body.substeps(Network()))  # mm/ms = m/s
    low = (height[:, 1:] <= 0.5) & (speed > 0)
    assert low.any()
    assert speed[low].max() < 0.2 < speed.max()


def test_targets_at_the_network_s_steps_are_the_plan():
    body = Body()
    tips, plan = all_tips(body)
    m = body.substeps(Network())
    assert np.allclose(tips[:, m - 1 :: m, :, 0].swapaxes(0, 1), plan.feet[..., 0], atol=1e-12)
    assert np.array_equal(tips[:, m - 1 :: m, :, 1].swapaxes(0, 1), plan.y)


def test_lift_takes_its_milliseconds_whatever_vp():
    """A foot is at full height exactly one lift time after its swing began, if the swing lasts that long."""
    for vp in (20.0, 50.0):
        body = Body(vp=vp, lift_time=25.0)
        tips, plan = all_tips(body, velocity=0.3, steps=900)
        m, network = body.substeps(Network()), Network()
        substep_ms = 1000.0 * body.seconds(network) / m
        n, start, leg = np.argwhere(plan.stance[:-1] & ~plan.stance[1:])[0] + [1, 0, 0]
        rising = tips[start, (n + 1) * m :, leg, 2]
        full = np.argmax(rising >= body.step_height - body.standing_height - 1e-9) + 1
        assert full * substep_ms == pytest.approx(body.lift_time, abs=substep_ms)


@pytest.mark.parametrize("vp", [20.0, 80.0])
def test_feet_meet_the_ground_at_their_aep(vp):
    """Wherever a swing ends at AEP_0, within a step of the network; those that end earlier take their landing time."""
    body, network = Body(vp=vp), Network()
    tips, plan = all_tips(body, velocity=0.3, steps=900)
    m = body.substeps(network)
    height = tips[:, m - 1 :: m, :, 2].swapaxes(0, 1) + body.standing_height
    lands = ~plan.stance[:-1] & plan.stance[1:]
    there = lands & (plan.x[1:] >= network.aep0)
    assert there.sum() > 100
    assert (height[1:][there] < 1e-9).all()
    wait = int(np.ceil(body.landing_time / 1000.0 / body.seconds(network))) + 1
    early = np.argwhere(lands[:-wait] & (plan.x[1:-wait] < network.aep0 - vp * body.landing_time / 1000.0))
    stay = [one for one in early.tolist() if plan.stance[one[0] + 1 : one[0] + 1 + wait, one[1], one[2]].all()]
    assert stay
    for step, start, leg in stay:
        assert height[step + wait, start, leg] < 1e-9


def test_a_leg_that_swings_back_is_lifted_at_once():
    network, body, steps, one = Network(), Body(), 60, np.arange(1)
    x, stance = np.full((steps, 1, 6), network.aep0), np.ones((steps, 1, 6), dtype=bool)
    x[:, 0, 0] -= network.dt * np.arange(steps)
    stance[:, 0, 0] = False
    y = np.broadcast_to(network.geometry.y, x.shape)
    plan = Walk(network.dt * np.arange(1, steps + 1), np.zeros((steps, 1)), x, y, stance, network.geometry)
    height = TipTargets(x[0], body, network).follow(plan, one)[0, :, 0, 2] + body.standing_height
    m = body.substeps(network)
    full = 2 * m + round(body.lift_time / 1000.0 / body.seconds(network) * m)  # it swings from the first step's end
    assert height[full - 1] == pytest.approx(body.step_height)


def test_starts_left_out_change_nothing_for_the_others():
    network, starts, body = Network(), draw_starts(6, 1), Body()
    whole, part = TipTargets(starts, body, network), TipTargets(starts, body, network)
    run = NetworkRun(starts, LDVS, 0.5)
    for ids in (np.arange(6), np.array([0, 2, 5]), np.array([2])):
        plan = run.advance(40)
        assert np.array_equal(whole.follow(plan, np.arange(6))[ids], part.follow(plan, ids))


def test_substeps_are_whole_and_short_enough():
    for vp in (20.0, 80.0, 99.9, 100.0, 400.0):
        body, network = Body(vp=vp), Network()
        m = body.substeps(network)
        assert body.seconds(network) / m <= 0.000625 + 1e-12
        assert m == 1 or body.seconds(network) / (m - 1) > 0.000625
    assert Body().substeps(Network()) == 2


@pytest.mark.parametrize(
    "change",
    [{"vp": 0.0}, {"vp": float("nan")}, {"step_height": -1.0}, {"step_height": 20.0}, {"friction": -0.1},
     {"lift_time": 0.0}, {"landing_time": 0.0}, {"longest_substep": 1.0}, {"standing_height": float("inf")}],
)  # fmt: skip
def test_conditions_that_make_no_sense(change):
    with pytest.raises(InputError, match=f"{next(iter(change))} = .*expected"):
        Body(**change)
