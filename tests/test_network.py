"""Laws of the network: it equals its plain form to the last bit, whatever the number of starts and threads."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import plain_network as plain
from hexmj.controllers.cruse1998 import HWS, LDVS, UNCOORDINATED, Cruse1998, ModelVariant, Weights, kernel
from hexmj.controllers.cruse1998 import network as network_module
from hexmj.controllers.cruse1998.kernel import LANES
from hexmj.controllers.cruse1998.weights import PLACES, general
from hexmj.errors import InputError
from hexmj.legs import CENTRED, FIG1, LEGS, MIRROR, Geometry
from hexmj.measures.kinematic import first_loss, walk
from hexmj.stability import walk_margin
from hexmj.timing import Acceleration, Stride

STRIDE = Stride()
NEAR = Geometry(origins=(7.0, 2.0, -4.0), lateral=(10.0, 25.0, 16.0))
"""Legs so near each other that tips pass those ahead of them, and any one may be the foremost."""

RULES = [
    ("printed", ModelVariant()),
    ("undelayed", ModelVariant()),
    ("sequential", ModelVariant()),
    ("printed", ModelVariant(ipsilateral="lasting")),
    ("undelayed", ModelVariant("lasting", "lasting", "sum", "strongest", "final")),
    ("sequential", ModelVariant(contralateral="lasting", cap="both", rear="strongest", neutral="final")),
]
"""Every choice once at least, alone or with others; each combination is compiled by itself."""


def random_weights(rng: np.random.Generator) -> Weights:
    """Asymmetric weights of the size of the published ones; the binary ones 0 or 1."""
    vector = rng.normal(0.0, 8.0, 58)
    vector[10:14] = rng.integers(0, 2, 4)
    vector[24:44] *= rng.choice([0.02, 1.0], 20)
    vector[54:58] = rng.integers(0, 2, 4)
    return Weights.of(dict(zip(PLACES.values(), vector, strict=True)))


def random_starts(rng: np.random.Generator, size: int) -> np.ndarray:
    return rng.uniform(-10.0, 10.0, (size, 6))


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([1, 2, LANES - 1, LANES, LANES + 3]),
    threads=st.sampled_from([1, 2, 3]),
    rules=st.sampled_from(RULES),
    geometry=st.sampled_from([FIG1, CENTRED, NEAR]),
    velocity=st.floats(0.0, 0.99),
    rate=st.one_of(st.none(), st.floats(1e-5, 0.02)),
)
def test_equals_plain_network_to_the_last_bit(seed, size, threads, rules, geometry, velocity, rate):
    rng = np.random.default_rng(seed)
    p, starts, (order, model_variant) = random_weights(rng), random_starts(rng, size), rules
    controller, stride = (
        Cruse1998(p, order, model_variant=model_variant),
        Stride(geometry=geometry, dt=rng.choice([0.1, 0.25])),
    )
    acceleration = Acceleration(rate, start=velocity / 2) if rate else None
    steps = 250
    options = {"stride": stride, "acceleration": acceleration, "threads": threads}
    fast = walk(starts, controller, velocity, steps * stride.dt, **options)
    lost = first_loss(starts, controller, velocity, steps * stride.dt, **options)
    for i in rng.choice(size, min(size, 2), replace=False):
        x, s, v = plain.walk(list(starts[i]), p, velocity, steps, stride, order, acceleration, model_variant)
        assert np.array_equal(fast.x[:, i], x)
        assert np.array_equal(fast.stance[:, i], np.array(s) == 1)
        assert np.array_equal(fast.velocity[:, i], v)
        unstable = [n for n in range(steps) if not plain.stable(x[n], s[n], stride)]
        assert lost[i] == ((unstable[0] + 1) * stride.dt if unstable else np.inf)


@pytest.mark.parametrize("geometry", [FIG1, NEAR])
def test_any_posture_is_stable_where_its_plain_form_is(geometry):
    """Legs stand and swing at random, and a step at V_r = 0 hardly moves them."""
    rng, size, stride = np.random.default_rng(10), 1500, Stride(geometry=geometry)
    tips, standing = random_starts(rng, size), rng.random((size, 6)) < 0.6
    plan = UNCOORDINATED.begin(tips, np.zeros(size), stride)
    plan.see(tips, standing)
    lost, now = plan.losses_after(0, 1).static, zip(plan.tips.tolist(), plan.standing.tolist(), strict=True)
    assert np.array_equal(lost, [0.0 if plain.stable(x, s, stride) else 1.0 for x, s in now])
    assert plan.done == 1
    assert 0 < (lost > 0).sum() < size


def test_a_centre_of_mass_on_the_edge_is_not_stable():
    """L2 and R2 exactly beside O are the rear or the front edge; half a millimetre back or ahead, they hold it."""
    ahead, behind = np.array(2 * [True, True, False]), np.array(2 * [False, True, True])
    tips, standing = np.zeros((4, 6)), np.array([ahead, ahead, behind, behind])
    tips[:, [1, 4]] = np.array([-4.0, -4.5, -4.0, -3.5])[:, np.newaxis]
    plan = UNCOORDINATED.begin(tips, np.zeros(4), STRIDE)
    plan.see(tips, standing)
    assert np.array_equal(plan.losses_after(0, 1).static, [1, 0, 1, 0])


@pytest.mark.parametrize("unseen", [0, 1, 40])
def test_losses_that_are_not_seen_do_not_count(unseen):
    starts, seen = random_starts(np.random.default_rng(11), LANES + 7), 100
    lost = UNCOORDINATED.begin(starts, np.full(len(starts), 0.5), STRIDE).losses_after(unseen, seen).static
    unstable = walk_margin(walk(starts, UNCOORDINATED, 0.5, 0.1 * (unseen + seen)))[unseen:] <= 0.0
    assert np.array_equal(lost, np.where(unstable.any(axis=0), unseen + 1 + np.argmax(unstable, axis=0), 0))
    assert (lost > 0).any()


def test_one_may_look_again_and_again():
    starts, period = random_starts(np.random.default_rng(12), LANES + 7), 50
    plan = UNCOORDINATED.begin(starts, np.full(len(starts), 0.5), STRIDE)
    lost = [plan.losses_after(period - 1, 1).static for _ in range(6)][-1]
    looked = walk_margin(walk(starts, UNCOORDINATED, 0.5, 0.1 * 6 * period))[period - 1 :: period] <= 0.0
    assert np.array_equal(lost, np.where(looked.any(axis=0), period * (1 + np.argmax(looked, axis=0)), 0))
    assert (lost > period).any()


@pytest.mark.parametrize("controller", [HWS, LDVS])
def test_published_sets_equal_plain_network(controller):
    starts = random_starts(np.random.default_rng(1), 2)
    fast = walk(starts, controller, 0.3, 200.0)
    for i in range(2):
        x, s, _ = plain.walk(list(starts[i]), general(controller.weights), 0.3, 2000, STRIDE)
        assert np.array_equal(fast.x[:, i], x)
        assert np.array_equal(fast.stance[:, i], np.array(s) == 1)


def test_does_not_depend_on_threads_batch_or_neighbours_in_the_batch():
    starts = random_starts(np.random.default_rng(2), 3 * LANES + 5)
    whole = walk(starts, LDVS, 0.4, 60.0, threads=1)
    threaded = walk(starts, LDVS, 0.4, 60.0, threads=2)
    some = slice(LANES + 1, 3 * LANES + 2)
    part = walk(starts[some], LDVS, 0.4, 60.0)
    assert np.array_equal(whole.x, threaded.x)
    assert np.array_equal(whole.x[:, some], part.x)
    assert np.array_equal(whole.stance[:, some], part.stance)


def test_does_not_depend_on_the_number_of_lanes(tmp_path, monkeypatch):
    """The same kernel, not compiled, for blocks of another width; 23 starts leave remainders and change lanes."""
    width = 5
    source = Path(kernel.__file__).read_text(encoding="utf-8")
    path = tmp_path / f"kernel_{width}.py"
    path.write_text(source.replace(f"LANES = {LANES}\n", f"LANES = {width}\n"), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec and spec.loader
    other = importlib.util.module_from_spec(spec)
    monkeypatch.setattr("numba.config.DISABLE_JIT", True)
    spec.loader.exec_module(other)
    monkeypatch.undo()
    assert width == other.LANES
    starts = random_starts(np.random.default_rng(7), 23)
    speeds = np.linspace(0.1, 0.9, 23)
    usual = first_loss(starts, LDVS, speeds, 60.0), walk(starts, LDVS, speeds, 20.0).x
    assert 0 < np.isfinite(usual[0]).sum() < 23
    monkeypatch.setattr(network_module, "kernel", other)
    assert np.array_equal(first_loss(starts, LDVS, speeds, 60.0), usual[0])
    assert np.array_equal(walk(starts, LDVS, speeds, 20.0).x, usual[1])


@pytest.mark.parametrize("size", [1, LANES - 1, 8 * LANES + 1])
def test_a_loss_does_not_depend_on_who_had_the_lane_before(size):
    """Lanes are handed on at different times: with other starts around it every start keeps its answer."""
    starts = random_starts(np.random.default_rng(8), size)
    together = first_loss(starts, LDVS, 0.6, 100.0)
    assert np.array_equal(together, first_loss(starts[::-1], LDVS, 0.6, 100.0, threads=1)[::-1])
    some = np.random.default_rng(9).choice(size, min(size, 5), replace=False)
    alone = [first_loss(starts[i : i + 1], LDVS, 0.6, 100.0)[0] for i in some]
    assert np.array_equal(together[some], alone)


def test_advancing_in_parts_is_one_walk():
    starts = random_starts(np.random.default_rng(3), 5)
    whole = walk(starts, LDVS, 0.4, 50.0, acceleration=Acceleration(0.002))
    plan = LDVS.begin(starts, np.full(5, 0.4), STRIDE, Acceleration(0.002))
    parts = [plan.advance(n) for n in (1, 99, 400)]
    for name in ("time", "velocity", "x", "stance"):
        assert np.array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))


def test_restarted_starts_begin_anew_and_leave_the_others_alone():
    rng = np.random.default_rng(31)
    starts, tips = random_starts(rng, 70), random_starts(rng, 70)
    which = rng.random(70) < 0.5
    plan = LDVS.begin(starts, np.full(70, 0.4), STRIDE)
    plan.advance(300)
    plan.restart(which, tips)
    after, begun, on = plan.advance(200), walk(tips, LDVS, 0.4, 20.0), walk(starts, LDVS, 0.4, 50.0)
    assert np.array_equal(after.x[:, which], begun.x[:, which])
    assert np.array_equal(after.stance[:, which], begun.stance[:, which])
    assert np.array_equal(after.x[:, ~which], on.x[300:, ~which])


def test_only_restarted_starts_accelerate():
    starts, which = random_starts(np.random.default_rng(32), 3), np.array([True, False, True])
    plan = LDVS.begin_at_speed(starts, np.full(3, 0.5), STRIDE, Acceleration(0.01))
    assert np.array_equal(plan.advance(100).x, walk(starts, LDVS, 0.5, 10.0).x)
    plan.restart(which, plan.tips)
    velocity = plan.advance(60).velocity
    assert np.array_equal(velocity[:, which], np.repeat(0.1 + 0.01 * (np.arange(60)[:, None] * 0.1), 2, axis=1))
    assert (velocity[:, 1] == 0.5).all()


def test_seeing_what_was_planned_changes_nothing():
    starts = random_starts(np.random.default_rng(33), 65)
    plan, parts = LDVS.begin(starts, np.full(65, 0.4), STRIDE), []
    for _ in range(100):
        parts.append(plan.advance(1).x)
        assert np.array_equal(parts[-1][0], plan.tips)
        plan.see(plan.tips, plan.standing)
    assert np.array_equal(np.concatenate(parts), walk(starts, LDVS, 0.4, 10.0).x)


@pytest.mark.parametrize("controller", [HWS, LDVS, UNCOORDINATED])
@pytest.mark.parametrize("order", ["printed", "undelayed"])
def test_mirrored_starts_give_mirrored_walks(controller, order):
    starts, controller = random_starts(np.random.default_rng(4), 40), replace(controller, order=order)
    walked = walk(starts, controller, 0.35, 150.0)
    mirrored = walk(starts[:, MIRROR], controller, 0.35, 150.0)
    assert np.array_equal(walked.x[:, :, MIRROR], mirrored.x)
    assert np.array_equal(walked.stance[:, :, MIRROR], mirrored.stance)


def test_acceleration_is_eq_11_step_by_step():
    acceleration = Acceleration(rate=0.013, start=0.1)
    walked = walk(np.zeros((1, 6)), UNCOORDINATED, 0.3, 30.0, acceleration=acceleration)
    expected = [0.1]
    for n in range(1, 300):
        expected.append(0.1 + 0.013 * (n * 0.1) if expected[-1] < 0.3 else 0.3)
    assert np.array_equal(walked.velocity[:, 0], expected)
    assert walked.velocity[-1, 0] == 0.3
    assert (np.diff(walked.velocity[:150, 0]) > 0).all()


def test_steps_end_beyond_aep_and_pep_not_at_them():
    at_pep = UNCOORDINATED.begin(np.full((1, 6), STRIDE.pep0), np.zeros(1), STRIDE)
    assert at_pep.advance(5).stance.all()
    swinging = UNCOORDINATED.begin(np.zeros((1, 6)), np.zeros(1), STRIDE)
    swinging.see(np.full((1, 6), 9.9), np.zeros((1, 6), dtype=bool))
    steps = swinging.advance(2)
    assert (steps.x[0] == STRIDE.aep0).all()
    assert not steps.stance[0].any()
    assert steps.stance[1].all()


def test_tips_stay_within_the_step_range():
    walked = walk(random_starts(np.random.default_rng(6), 100), LDVS, 0.7, 100.0)
    assert walked.x.max() <= 10.0 + 0.1 + 1e-9
    assert walked.x.min() >= -20.0 - 0.1


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("velocity", {"velocity": 1.0}),
        ("velocity", {"velocity": [0.1, 0.2]}),
        ("velocity", {"velocity": 0.05, "acceleration": Acceleration()}),
        ("duration", {"duration": 0.0}),
        ("starts", {"starts": np.zeros((3, 5))}),
        ("starts", {"starts": np.full((1, 6), np.nan)}),
    ],
)
def test_invalid_walks_are_refused(name, change):
    arguments = {"starts": np.zeros((1, 6)), "controller": LDVS, "velocity": 0.3, "duration": 10.0}
    with pytest.raises(InputError, match=name):
        walk(**arguments | change)


def test_a_dimension_leg_may_stand_anywhere():
    starts = random_starts(np.random.default_rng(13), 3)
    labelled = xr.DataArray(starts.T, dims=("leg", "start"), coords={"leg": [*LEGS]})
    assert np.array_equal(walk(labelled, LDVS, 0.4, 10.0).x, walk(starts, LDVS, 0.4, 10.0).x)
