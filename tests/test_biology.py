"""The insect beside measured ones: laws of forces, work and strides, and the table of sources."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from hexmj import LDVS, UNCOORDINATED, Conditions, draw_starts
from hexmj.body import STICK_INSECT
from hexmj.controllers.planning import begin
from hexmj.legs import MIRROR
from hexmj.measures.tables import WalkSettings
from hexmj.physics.rollout import drive
from hexmj.physics.settle import Settled, Settling
from hexmj.studies.biology import ANIMALS, PAST, SOURCES, SPEEDS, STEP, Animal, Biology, biology_figure, timing
from hexmj.studies.quantities import (
    SEGMENTS,
    UNITS,
    Strides,
    last_strides,
    onsets,
    quantities,
    strides_between,
)
from hexmj.sweep import run_study
from hexmj.timing import Stride

WEIGHT = STICK_INSECT.mass * 9810.0
STRIKES = draw_starts(3, 2)[2:]
"""A foot of this start strikes the ground with twice the weight after 1 s."""

PERIOD = 20.0 * (1.0 + 1.0 / 0.3)  # of a single leg at V = 0.3


def settle(starts: np.ndarray, conditions: Conditions | None = None) -> Settled:
    """At rest, and what their feet push is measured."""
    return Settling(conditions or Conditions(), Stride(), pushes=True).at(starts)


def seen(starts: np.ndarray, velocity: float, duration: float) -> tuple[Strides, np.ndarray]:
    """All that one start did, and what the touch sensors showed, (row, leg)."""
    settled = settle(starts)
    chunks = list(drive(settled, begin(LDVS, settled.starts, velocity, settled.stride), duration))
    rows = sum(chunk.qpos.shape[1] for chunk in chunks)
    touch = np.concatenate([chunk.sensors[0, :, settled.compiled.columns.touch] for chunk in chunks])
    strides = strides_between(settled, chunks, 0, np.array([2, rows]))
    return strides, touch[2::2]


@pytest.fixture(scope="module")
def walking() -> tuple[dict[int, Strides], list[dict[str, float]]]:
    """The strides of three starts after three periods, and their quantities."""
    settled = settle(draw_starts(3, 0))
    walks = WalkSettings(LDVS, 0.3, 6 * PERIOD, 3, 0, Conditions(), Stride())
    strides = dict(last_strides(settled, walks, 3 * PERIOD))
    return strides, [quantities(one) for one in strides.values()]


def test_over_strides_the_ground_carries_the_weight_and_neither_drives_nor_brakes(walking):
    for strides in walking[0].values():
        force = strides.ground.sum(axis=1).mean(axis=0) / WEIGHT
        assert_allclose(force, [0.0, 0.0, 1.0], atol=0.01)
        assert strides.count >= 1
        assert strides.qpos[-1, 0] - strides.qpos[0, 0] > 20.0 * strides.count


def test_vertical_forces_are_what_the_touch_sensors_show_in_steps_taken_in_parts_too():
    strides, touch = seen(STRIKES, 0.3, 200.0)
    assert_allclose(strides.ground[:, :, 2], touch[: len(strides.ground)], rtol=0, atol=1e-9 * WEIGHT)
    assert (np.linalg.norm(strides.ground[..., :2], axis=2) <= 1.0001 * strides.ground[..., 2] + 1e-6).all()  # friction


def test_forces_are_those_that_move_the_centre_of_mass():
    strides, _ = seen(STRIKES, 0.3, 200.0)
    rows, centre = np.arange(m := strides.settled.substeps, len(strides.centre) - 1, m), strides.centre
    moved = STICK_INSECT.mass * (centre[rows + 1] - 2.0 * centre[rows] + centre[rows - 1]) / strides.step**2
    ground = strides.ground.sum(axis=1)[1 : 1 + len(rows)] - [0.0, 0.0, WEIGHT]
    off = np.abs(ground - moved) / WEIGHT
    assert np.median(off) < 1e-5
    assert (off < 0.02).mean() > 0.99  # places alone do not tell the velocity at the end of a step in parts


def test_a_standing_insect_carries_its_weight_and_stands_on_its_friction():
    strides, _ = seen(draw_starts(1, 1), 0.0, 2.0)
    assert_allclose(strides.ground.sum(axis=1) / WEIGHT, len(strides.ground) * [[0.0, 0.0, 1.0]], atol=1e-3)
    assert np.abs(strides.ground[..., 1]).mean() > 0.01 * WEIGHT


def test_mirrored_starts_feel_mirrored_forces():
    starts, mirror = draw_starts(1, 0), list(MIRROR)
    one, other = (seen(x, 0.3, 30.0)[0] for x in (starts, starts[:, mirror]))
    assert_allclose(one.ground, other.ground[:, mirror] * [1, -1, 1], atol=1e-6 * WEIGHT)
    assert_allclose(one.torques.reshape(-1, 6, 3), other.torques.reshape(-1, 6, 3)[:, mirror], atol=1.0)


def test_servos_put_in_more_work_than_they_take_out(walking):
    """Over strides nothing is gained, so their work is what friction and strikes take."""
    for one in walking[1]:
        positive, every = one["cost of transport, positive work"], one["cost of transport, all work"]
        assert 0.0 < 2.0 * positive - every < 0.2 * positive
        assert one["positive work of the joints"] == pytest.approx(9.81 * positive)
        assert 0.0 < one["work on the centre of mass"] < one["positive work of the joints"]


def test_quantities_agree_with_each_other_and_with_the_plan(walking):
    for one in walking[1]:
        assert list(one) == list(UNITS)
        assert all(map(math.isfinite, one.values()))
        assert sum(one[f"vertical impulse, {segment}"] for segment in SEGMENTS) == pytest.approx(100.0, abs=0.5)
        assert one["speed"] == pytest.approx(24.0, rel=0.03)
        assert one["duty factor"] == pytest.approx(1.0 / 1.3, abs=0.01)
        assert one["period"] == pytest.approx(PERIOD / 80.0, rel=0.1)
        assert 0.0 < one["ripple: least over mean speed"] < 1.0
        heights = [one[f"height of the coxae, {segment}"] for segment in SEGMENTS]
        assert heights == sorted(heights, reverse=True)


def test_a_hop_is_no_swing():
    standing = np.ones(100, dtype=bool)
    standing[10:12] = standing[40:60] = standing[90:] = False
    assert onsets(standing, 3.0).tolist() == [40, 90]


def test_who_lifts_where_strides_begin_or_end_has_as_many_stances_as_there_are_strides(walking):
    """Strides of 400 rows; swings of 100 rows begin in the first row, 10 rows before the last one, or 200 later."""
    begun, standing = (0, 0, 1190, 200, 200, 200), np.ones((1200, 6), dtype=bool)
    for leg, first in enumerate(begun):
        for row in range(first - 1200, first + 1200, 400):
            standing[np.arange(row, row + 100) % 1200, leg] = False
    three = replace(walking[0][0], count=3, standing=standing)
    one = replace(three, count=1, standing=standing[400:800])
    for strides, legs in ((three, (0, 0, 390, 200, 200, 200)), (one, (0, 0, 390, 200, 200, 200))):
        assert [strides.lifted(leg)[0] for leg in range(6)] == [*legs]
        for leg in range(6):
            assert [len(stance) for stance in strides.stances(leg)] == [300] * strides.count


def test_a_torque_that_rises_and_falls_evenly_is_past_half_its_peak_for_half_a_stance(walking):
    strides = walking[0][0]
    torques = np.zeros_like(strides.torques)
    for leg in range(6):
        for stance in strides.stances(leg):
            torques[stance, 3 * leg + 1] = -np.minimum(part := np.linspace(0.0, 1.0, len(stance)), 1.0 - part)
    told = quantities(replace(strides, torques=torques))
    for segment in SEGMENTS:
        assert told[f"{PAST} from, {segment}"] == pytest.approx(25.0, abs=1.5)
        assert told[f"{PAST} until, {segment}"] == pytest.approx(75.0, abs=1.5)


def test_period_and_duty_factor_follow_from_step_and_swing():
    for speed in SPEEDS:
        (shortest, longest), (least, most) = timing(speed)
        assert STEP[0] / speed < shortest < longest
        assert shortest - STEP[0] / speed == pytest.approx(0.10 * shortest + 0.14)
        assert STEP[0] / speed / least * 0.16 + 0.17 == pytest.approx(STEP[0] / speed / least - STEP[0] / speed)
        assert 0.5 < least < most < 1.0
    assert all(timing(a)[0][0] > timing(b)[0][0] for a, b in pairwise(SPEEDS))


def test_every_row_is_a_quantity_with_a_source_and_a_range_or_none():
    for row in ANIMALS:
        assert row.quantity in UNITS
        assert row.source in SOURCES
        assert math.isnan(row.low) == math.isnan(row.high) and not row.low > row.high
        assert math.isnan(row.low) or row.source not in ("", "not read")
    assert {row.source for row in ANIMALS} == set(SOURCES)
    row = Animal("speed", 1.0, 2.0)
    assert [row.verdict(value) for value in (0.5, 1.0, 2.0, 2.5)] == ["below", "within", "within", "above"]
    assert replace(row, low=math.nan).verdict(1.0) == "no figure found"
    assert row.verdict(math.nan) == "none measured"


@pytest.fixture(scope="module")
def falling(tmp_path_factory):
    """Short walks, of which some fall."""
    return run_study(Biology(UNCOORDINATED, 4, n_starts=5), tmp_path_factory.mktemp("biology"), threads=1)


def test_threads_change_no_bit(falling):
    assert run_study(Biology(UNCOORDINATED, 4, n_starts=5), threads=2).identical(falling)


def test_starts_that_fall_count_nowhere(falling):
    assert (falling.value.sel(quantity="speed").notnull().sum("start") < 5).any()
    row = falling.isel(row=list(falling.name.values).index("way of a standing foot"))
    some = falling.value.sel(speed=24.0, quantity="way of a standing foot").dropna("start")
    assert row["mean"].item() == pytest.approx(some.mean().item()) or (some.size == 0 and math.isnan(row["mean"]))
    assert row["walked"].item() == some.size
    assert len(biology_figure(falling).axes) == 6


def test_phases_around_zero_have_their_mean_there():
    """Phases 0.789 and 0.122 of two starts are a third of a period apart, around 0.955."""
    study = Biology(LDVS, n_starts=2, periods=6)
    values = np.full((len(SPEEDS), len(UNITS), 2), 0.5)
    values[:, [*UNITS].index("phase, ipsilateral")] = 0.789, 0.122
    table = xr.Dataset({"value": (("speed", "quantity", "start"), values)}, {"quantity": [*UNITS]})
    result = study.result([table.isel(speed=i) for i in range(len(SPEEDS))])
    ipsilateral = result.isel(row=result.name.values == "phase, ipsilateral")
    assert_allclose(ipsilateral["mean"], 0.9555)
    assert_allclose(ipsilateral.high - ipsilateral.low, 2 * 12.706205 * 0.333 / 2, rtol=1e-6)
    assert_allclose(result.isel(row=result.name.values == "duty factor")["mean"], 0.5)
    drawn: Any = biology_figure(result).axes[2]
    assert_allclose(np.asarray(drawn.lines[0].get_ydata(), dtype=float), 0.9555)


@pytest.mark.slow
def test_the_command_writes_its_files(tmp_path, run):
    words = ("biology", "--starts", 2, "--periods", 4, "--out", tmp_path)
    code, text, _ = run(*words, "--json")
    assert code == 0
    answer, table = json.loads(text), (tmp_path / "biology.md").read_text()
    names = {"biology.nc", "biology.png", "biology.md", "manifest.json", "walks"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert len(answer["name"]) == len(answer["verdict"]) == len(ANIMALS)
    assert f"{answer['mean'][0]:.3g} (" in table
    assert all(f"- {row.source}: " in table for row in ANIMALS if row.source)
