"""Disturbed walks: the plan that meets a disturbance, the strategies, the frequencies and the experiment."""

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr

from hexmj.cli import main
from hexmj.errors import InputError
from hexmj.experiments.disturbance import SETTLED, Disturbance, disturbance, draw_walkers
from hexmj.experiments.disturbed_frequencies import with_frequencies
from hexmj.experiments.disturbed_plan import PAUSE, DisturbedPlan
from hexmj.experiments.disturbed_walks import Case, cases, disturb, planned_losses
from hexmj.experiments.strategies import Postures, collect_postures, reorganise
from hexmj.network import NetworkRun, first_loss, walk
from hexmj.parameters import LDVS, UNCOORDINATED, Acceleration, Network
from hexmj.physics.body import Body
from hexmj.physics.closed_loop import SensedPlan
from hexmj.stability import stability_margin, walk_margin

NETWORK, V, GRID = Network(), 0.5, 20
WALKERS = draw_walkers(LDVS, V, 6, 0, NETWORK, GRID)
STEPS = int(WALKERS.step.max()) + 900
PAUSED = round(PAUSE / NETWORK.dt)
EVERY = np.arange(6)


@pytest.fixture(scope="module")
def postures() -> Postures:
    return collect_postures(LDVS, V, 0, NETWORK)


def plan(kind, **answer):
    met = disturbance(kind, WALKERS, LDVS, V, NETWORK)
    return DisturbedPlan(WALKERS.starts, LDVS, V, met, network=NETWORK, **answer)


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("velocity", "x", "stance"))


def test_a_push_does_not_change_the_plan():
    assert same(plan("push").advance(STEPS), walk(WALKERS.starts, LDVS, V, STEPS * NETWORK.dt))


@pytest.mark.parametrize("kind", ["halt", "leg"])
def test_until_its_disturbance_a_walk_is_undisturbed(kind):
    whole, free = plan(kind).advance(STEPS), walk(WALKERS.starts, LDVS, V, STEPS * NETWORK.dt)
    for start, step in enumerate(disturbance(kind, WALKERS, LDVS, V, NETWORK).step):
        assert np.array_equal(whole.x[:step, start], free.x[:step, start])
        assert not np.array_equal(whole.x[step : step + 100, start], free.x[step : step + 100, start])


def test_a_halt_is_a_new_start_from_where_the_legs_are():
    whole = plan("halt").advance(STEPS)
    tips = whole.x[WALKERS.step - 1, EVERY]
    again = walk(tips, LDVS, V, 500 * NETWORK.dt)
    for start, step in enumerate(WALKERS.step):
        rest = slice(step, step + PAUSED)
        assert (whole.x[rest, start] == tips[start]).all()
        assert whole.stance[rest, start].all() and not whole.velocity[rest, start].any()
        after = slice(step + PAUSED, step + PAUSED + 500)
        assert np.array_equal(whole.x[after, start], again.x[:, start])
        assert np.array_equal(whole.stance[after, start], again.stance[:, start])


def test_a_stopped_leg_retracts_and_the_others_go_on():
    met, free = disturbance("leg", WALKERS, LDVS, V, NETWORK), walk(WALKERS.starts, LDVS, V, STEPS * NETWORK.dt)
    whole = plan("leg").advance(STEPS)
    for start, (step, leg) in enumerate(zip(met.step, met.leg, strict=True)):
        assert not free.stance[step - 1, start, leg]
        assert free.stance[WALKERS.step[start] - 1 : step - 1, start].all()  # the first moment at which one protracts
        assert whole.x[step, start, leg] == whole.x[step - 1, start, leg] - V * NETWORK.dt
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


def test_a_disturbance_after_the_last_step_does_nothing():
    last = int(WALKERS.step.min())
    assert same(plan("halt").advance(last), walk(WALKERS.starts, LDVS, V, last * NETWORK.dt))


@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
def test_slowing_down_begins_at_the_low_velocity_and_reaches_the_old_one(kind):
    slow = plan(kind, acceleration=Acceleration(0.01, 0.1))
    velocity = slow.advance(STEPS).velocity
    for start, step in enumerate(slow.resumed):
        expected = np.minimum(0.1 + 0.01 * NETWORK.dt * np.arange(500), V)
        np.testing.assert_allclose(velocity[step : step + 500, start], expected, atol=1e-3 * NETWORK.dt * 1.01)
        assert velocity[step + 500, start] == V


def test_the_nearest_posture_is_the_nearest(postures):
    tips = np.random.default_rng(0).uniform(-10, 10, 6)
    distances = np.linalg.norm(postures.tips - tips, axis=1)
    assert distances[postures.nearest(tips)] == distances.min()
    assert [postures.nearest(one) for one in postures.tips] == list(range(len(postures.tips)))


def test_postures_are_stable_and_walking_on_from_them_is(postures):
    run = NetworkRun(np.clip(postures.tips, -20.0, 10.0), LDVS, V)
    run.see(postures.tips, postures.standing)
    assert (walk_margin(run.advance(600)) > 0).all()
    feet = np.stack([postures.tips + np.array(NETWORK.geometry.origin), postures.tips * 0 + NETWORK.geometry.y], -1)
    assert (stability_margin(feet, postures.standing) > 0).all()


def test_legs_are_reorganised_one_after_the_other_and_stably(postures):
    for start, tips in enumerate(walk(WALKERS.starts, LDVS, V, 170.0).x[-1]):
        goal = postures.tips[postures.nearest(tips)]
        rest = reorganise(tips, goal, NETWORK)
        way = np.diff(rest.tips, axis=0, prepend=tips[None])
        assert (np.count_nonzero(way, axis=1) == 1).all() and (np.abs(way) <= NETWORK.dt + 1e-12).all(), start
        assert ((~rest.standing).sum(axis=1) <= 1).all() and rest.standing[-1].all()
        assert (np.abs(rest.tips[-1] - goal) <= NETWORK.dt).all()
        lifted = np.abs(way).sum(axis=0) > 0
        assert np.array_equal(rest.tips[-1][lifted], goal[lifted])
        feet = np.stack([rest.tips + np.array(NETWORK.geometry.origin), rest.tips * 0 + NETWORK.geometry.y], axis=-1)
        assert (stability_margin(feet, rest.standing) > 0).all()


def test_legs_that_stand_right_are_not_moved():
    tips = np.arange(6.0)
    assert len(reorganise(tips, tips + 0.05, NETWORK).tips) == 0


def test_a_reorganised_walk_goes_on_with_the_posture_s_states(postures):
    one = plan("halt", postures=postures)
    whole = one.advance(STEPS)
    for start, (step, resumed) in enumerate(zip(WALKERS.step, one.resumed, strict=True)):
        standing = postures.standing[postures.nearest(whole.x[step - 1, start])]
        way = whole.x[resumed, start] - whole.x[resumed - 1, start]
        np.testing.assert_allclose(way, np.where(standing, -V, 1.0) * NETWORK.dt)
        assert not whole.velocity[step:resumed, start].any() and whole.velocity[resumed, start] == V


def test_walkers_are_stable_until_disturbed_and_do_not_depend_on_their_number():
    period = 20 * (1 + 1 / V) / NETWORK.dt
    assert (WALKERS.step % GRID == 0).all()
    assert ((WALKERS.step >= SETTLED * period) & (WALKERS.step < (SETTLED + 1) * period + GRID)).all()
    assert np.isinf(first_loss(WALKERS.starts, LDVS, V, WALKERS.step * NETWORK.dt)).all()
    more = draw_walkers(LDVS, V, 50, 0, NETWORK, GRID)
    for name in ("starts", "step", "draw"):
        assert np.array_equal(getattr(more, name)[:6], getattr(WALKERS, name))


def test_planned_losses_are_those_of_the_network():
    starts = np.random.default_rng(1).uniform(-10, 10, (40, 6))
    lost = planned_losses(NetworkRun(starts, LDVS, 0.7), 1200)
    np.testing.assert_allclose(lost, first_loss(starts, LDVS, 0.7, 120.0))


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
    result = with_frequencies(table).isel(velocity=0)
    assert result.kinematic_reached.values.tolist() == [5, 6]
    np.testing.assert_allclose(result.kinematic.sel(window="short"), [1 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic.sel(window="whole"), [3 / 5, 1 / 6])
    np.testing.assert_allclose(result.kinematic_buys.sel(window="whole")[1], 2 / 5)  # of the five that reach both
    assert (result.kinematic_low <= result.kinematic).all() and (result.kinematic <= result.kinematic_high).all()


@pytest.mark.parametrize("kind", ["halt", "leg", "push"])
@pytest.mark.parametrize("strategy", ["none", "reorganise", "slow_down"])
def test_a_disturbed_plan_that_senses_nothing_goes_on_by_itself(kind, strategy, postures):
    answer = {"reorganise": {"postures": postures}, "slow_down": {"acceleration": Acceleration(0.01, 0.1)}}
    alone, sensed = (plan(kind, **answer.get(strategy, {})) for _ in range(2))
    one, other = SensedPlan(sensed, WALKERS.starts).advance(STEPS), alone.advance(STEPS)
    assert np.array_equal(one.stance, other.stance)
    np.testing.assert_allclose(one.x, other.x, atol=1e-9)


def test_a_halted_start_holds_on_to_where_its_tips_were_seen():
    """From the second step on, whatever is read while it rests; it goes on from there."""
    whole = SensedPlan(plan("halt"), WALKERS.starts)
    start = int(np.argmin(WALKERS.step))
    step, one, feet = WALKERS.step[start], np.array([start]), np.ones((1, 6), dtype=bool)
    before = whole.advance(step)
    tips = before.x[-1, one] - 0.2
    whole.sense(one, tips, feet)
    rest = [whole.advance(1)]
    for _ in range(PAUSED):
        whole.sense(one, tips + 0.3, feet)
        rest.append(whole.advance(1))
    assert all((row.x[0, start] == tips[0]).all() and row.stance[0, start].all() for row in rest[1:-1])
    np.testing.assert_allclose(rest[-1].x[0, start], tips[0] - V * NETWORK.dt)


def test_disturbed_walks_can_read_their_legs(tmp_path):
    walked = [Case("push", "none"), Case("halt", "none"), Case("leg", "reorganise")]
    settings = {"velocities": [V], "starts": 4, "window": 30.0}
    alone = disturb(LDVS, tmp_path / "open", walked, **settings)
    reading = disturb(LDVS, tmp_path / "closed", walked, **settings, body=Body(feedback=True))
    assert np.isfinite(reading.physical.sel(window="whole")).all()
    assert all(reading[name].equals(alone[name]) for name in ("time", "back", "planned_loss"))


def test_a_hard_push_fells_and_finished_walks_are_kept(tmp_path):
    walked = [Case("push", "none"), Case("push", "none", 200.0)]
    settings = {"velocities": [V], "starts": 4, "window": 30.0}
    result = disturb(LDVS, tmp_path, walked, **settings, threads=1)
    assert result.physical_reached.values.tolist() == [[4, 4]]
    assert result.physical.sel(window="whole").values.tolist() == [[0.0, 1.0]]
    assert (result.planned_loss.isel(case=0) == result.planned_loss.isel(case=1)).all()
    files = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert disturb(LDVS, tmp_path, walked, **settings, threads=2).identical(result)
    assert files == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    other = tmp_path / "other"
    assert disturb(LDVS, other, walked[1:], **settings, threads=2).fall[0, 0].equals(result.fall[0, 1])


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((["fall"], [], [], True), "none of halt, leg, push"),
        ((["halt", "halt"], [], [], True), "twice"),
        ((["halt"], [], ["jump"], True), "none of reorganise, slow_down, grasp"),
        ((["push"], [-1.0], [], True), "above 0"),
        ((["push"], [np.nan], [], True), "above 0"),
        ((["push"], [], [], True), "at least one"),
        (([], [], [], True), "at least one"),
        ((["push"], [1.0], [], False), "'push' without physics"),
        ((["halt"], [], ["grasp"], False), "'grasp' without physics"),
    ],
)
def test_cases_that_make_no_sense_are_refused(given, told):
    with pytest.raises(InputError, match=told):
        cases(*given)


def test_disturbances_that_make_no_sense_are_refused(tmp_path):
    wrong: list[tuple[Any, list[float], list[int]]] = [
        ("jump", [1], [0]),
        ("halt", [-1], [0]),
        ("halt", [0.5], [0]),
        ("leg", [1], [6]),
    ]
    for kind, step, leg in wrong:
        with pytest.raises(InputError, match=r"expected|valid names"):
            Disturbance(kind, np.array(step), np.array(leg))
    with pytest.raises(InputError, match="a disturbance of 1 starts; expected one of 6"):
        DisturbedPlan(WALKERS.starts, LDVS, V, Disturbance("halt", np.array([1]), np.array([0])))
    with pytest.raises(InputError, match="expected above 0 and at least"):
        disturb(LDVS, tmp_path, [Case("halt", "slow_down")], velocities=[0.05], starts=2)
    with pytest.raises(InputError, match="none of 20 starts reaches"):
        collect_postures(UNCOORDINATED, 0.9, 0, NETWORK)
    with pytest.raises(InputError, match="expected fewer starts or a lower velocity"):
        draw_walkers(UNCOORDINATED, 0.9, 50_000, 0, NETWORK, GRID)
    assert not list(tmp_path.iterdir())


def test_the_command_prints_one_object_and_refuses_with_exit_code_2(tmp_path, monkeypatch, capsys):
    words = ["hexmj", "disturb", "--kinematic", "--velocities", "0.5", "--starts", "20", "--out", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", [*words, "--strategies", "slow_down", "--json"])
    main()
    printed = json.loads(capsys.readouterr().out)
    assert printed["strategy"] == ["none", "none", "slow_down", "none", "slow_down"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "disturb.nc",
        "disturb.png",
        "manifest.json",
        "walks",
    }
    for wrong in (["--disturbances", "push"], ["--grasp", "1"], ["--acceleration", "0.1"], ["--recovery", "nan"]):
        monkeypatch.setattr("sys.argv", [*words, *wrong])
        with pytest.raises(SystemExit) as stopped:
            main()
        assert stopped.value.code == 2 and "expected" in capsys.readouterr().err
