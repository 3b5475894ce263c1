"""Commands and steering: every controller that walks straight ahead follows a command."""

from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.bodies.mjcf import compile_body
from hexmj.command import Command
from hexmj.controllers.planning import advanced
from hexmj.controllers.steered import Lines, begin
from hexmj.errors import InputError
from hexmj.legs import MIRROR, SIDE, WORKSPACE, Workspace
from hexmj.measures.physical import physical_walk
from hexmj.tasks.league import EVERYONE, entrants

STRIDE = hexmj.Stride()
STARTS = hexmj.draw_starts(5, 67)
PERIOD = STRIDE.periods(0.3)
BOX = Workspace(*(tuple(10.0 * np.array(ends)) for ends in vars(WORKSPACE).values()))
"""The boxes of the legs [mm]."""
COMMANDS = {
    "straight": Command(0.3),
    "sideways": Command(0.0, 0.3),
    "backward": Command(-0.2),
    "curve": Command(0.25, 0.0, 0.003),
    "turn": Command(0.0, 0.0, 0.008),
    "slalom": Command(0.25, 0.0, (0.003, -0.003, 0.003), (0.0, PERIOD, 2 * PERIOD)),
    "stop and go": Command((0.3, 0.0, 0.3), times=(0.0, PERIOD, 1.5 * PERIOD)),
}
LEAGUE = entrants(EVERYONE)


def planned(command, controller: Any = hexmj.LDVS, starts=STARTS, steps=1200):
    return advanced(begin(controller, starts, command, STRIDE), steps)


def mirrored(command):
    parts = command.parts * (1, -1, -1)
    return Command(parts[:, 0].tolist(), parts[:, 1].tolist(), parts[:, 2].tolist(), command.times)


# ---- commands ----


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_a_path_is_the_integral_of_the_command(command):
    time = np.linspace(0.0, 3 * PERIOD, 60001)
    parts = command.parts[np.searchsorted(command.times, time[:-1], side="right") - 1]
    path = command.path(time)
    heading = path[:-1, 2] + np.diff(path[:, 2]) / 2
    cosine, sine = np.cos(heading), np.sin(heading)
    velocity = np.stack([parts[:, 0] * cosine - parts[:, 1] * sine, parts[:, 0] * sine + parts[:, 1] * cosine], axis=1)
    there = np.cumsum(velocity * np.diff(time)[:, None], axis=0)
    assert np.allclose(path[1:, :2], there, rtol=0.0, atol=1e-3)
    assert path[-1, 2] == pytest.approx((parts[:, 2] * np.diff(time)).sum(), abs=1e-4)


def test_a_twist_in_millimetres_and_seconds_is_the_command_at_v_p():
    found = Command.twist(20.0, [0.0, 8.0], 0.4, vp=40.0, times=[0.0, 2.0])
    assert found == Command(0.5, (0.0, 0.2), 0.01, (0.0, 80.0))


@pytest.mark.parametrize(
    ("name", "values"),
    [("forward", {"forward": 1.5}), ("left", {"left": "fast"}), ("turn", {"turn": 0.2}), ("times", {"times": (1.0,)}),
     ("times", {"times": (0.0, 2.0, 1.0)}), ("forward", {"forward": (0.1, 0.2)})],
)  # fmt: skip
def test_impossible_commands_are_refused(name, values):
    with pytest.raises(InputError, match=name):
        Command(**values)


# ---- steering ----


@pytest.mark.parametrize("name", LEAGUE)
def test_straight_ahead_a_controller_walks_as_without_a_command(name):
    own, steered = (planned(v, LEAGUE[name], steps=600) for v in (0.3, Command((0.3, 0.3), times=(0.0, 30.0))))
    for values in ("x", "y", "stance", "aep", "velocity", "time"):
        assert np.array_equal(getattr(own, values), getattr(steered, values), equal_nan=values == "aep")


@pytest.mark.parametrize("name", LEAGUE)
@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_standing_feet_stay_where_they_are(name, command):
    walk = planned(command, LEAGUE[name], steps=900)
    assert np.isfinite(walk.x).all()
    feet, dt = walk.feet, STRIDE.dt
    forward, left, turn = (getattr(walk, part)[1:, :, None] for part in ("velocity", "left", "turn"))
    ahead, aside = np.moveaxis(feet[:-1] + feet[1:], 3, 0) / 2
    slide = np.diff(feet, axis=0) / dt + np.stack([forward - turn * aside, left + turn * ahead], axis=3)
    stands = walk.stance[1:] & walk.stance[:-1]
    assert np.abs(slide[stands]).max() < 1e-3


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_mirrored_commands_give_mirrored_walks(command):
    walk, other = planned(command), planned(mirrored(command), starts=STARTS[:, MIRROR])
    for name in ("x", "stance", "aep"):
        assert np.array_equal(getattr(walk, name), getattr(other, name)[..., MIRROR])
    assert np.array_equal(walk.y, -other.y[..., MIRROR])


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_a_walk_does_not_depend_on_the_batch_or_on_calls_of_advance(command):
    walk, plan = planned(command), begin(hexmj.LDVS, STARTS[1:3], command, STRIDE, threads=2)
    parts = [advanced(plan, steps) for steps in (1, 399, 800)]
    assert np.array_equal(np.concatenate([part.x for part in parts]), walk.x[:, 1:3])
    assert np.array_equal(np.concatenate([part.y for part in parts]), walk.y[:, 1:3])


def test_a_table_of_one_command_is_the_constant_command():
    command, table = COMMANDS["curve"], Command(0.25, 0.0, (0.003, 0.003), (0.0, 40.0))
    assert np.array_equal(planned(command).x, planned(table).x)


def test_every_start_can_have_its_own_command():
    commands = [COMMANDS[name] for name in ("curve", "turn", "curve", "straight", "stop and go")]
    together = advanced(begin(hexmj.LDVS, STARTS, commands, STRIDE), 1200)
    for n, command in enumerate(commands):
        alone = planned(command, starts=STARTS[n : n + 1])
        assert np.array_equal(together.x[:, n], alone.x[:, 0]) and np.array_equal(together.y[:, n], alone.y[:, 0])


@pytest.mark.parametrize("name", LEAGUE)
def test_after_a_command_of_zero_all_legs_stand_once_their_swings_have_ended(name):
    stop, swing = 600, round(2 * (STRIDE.aep0 - STRIDE.pep_min) / STRIDE.dt)
    walk = planned(Command((0.3, 0.0), times=(0.0, stop * STRIDE.dt)), LEAGUE[name])
    lifted = ~walk.stance[stop:]
    assert not (lifted[1:] & ~lifted[:-1]).any() and walk.stance[stop + swing :].all()
    assert (np.diff(walk.x[stop:], axis=0)[walk.stance[stop:-1]] == 0.0).all()


def test_inner_legs_take_shorter_steps_in_the_same_period():
    lines = Lines.of(np.array([0.25, 0.0, 0.004]), STRIDE)
    length = np.hypot(*lines.along.T)
    assert (length[:3] < length[3:]).all() and lines.velocity < 0.35


@pytest.mark.parametrize("command", [(0.0, 0.3, 0.0), (0.0, -0.9, 0.02), (0.9, 0.1, 0.0), (0.0, 0.0, 0.05)])
def test_lines_lie_in_the_workspace(command):
    lines, box = Lines.of(np.array(command), STRIDE), BOX
    beside = np.array(SIDE) * (lines.neutral[:, 1] - STRIDE.geometry.y)
    half = np.abs(lines.along) * (STRIDE.aep0 - STRIDE.pep0) / 2
    width = np.tile(np.subtract(box.outer, box.inner), 2) / 2
    sideways = np.abs(lines.along[:, 1]) / np.hypot(*lines.along.T) > width / 10.0  # else they lie near the usual lines
    assert (beside + half[:, 1] <= np.tile(box.outer, 2) + 1e-9).all()
    assert (beside - half[:, 1] >= np.tile(box.inner, 2) - 1e-9)[sideways].all()
    assert 0 < lines.velocity < 1


def test_the_stick_insect_reaches_its_workspace_on_the_ground_and_in_the_air():
    conditions, box, geometry = hexmj.Conditions(), BOX, STRIDE.geometry
    compiled, share = compile_body(conditions), np.linspace(0.0, 1.0, 9)[:, None]
    ends = (box.behind, box.ahead), (box.inner, box.outer)
    along, beside = (np.tile(low + share * np.subtract(high, low), 2) for low, high in ends)
    for height in (0.0, 0.5, 1.0):
        tips = np.empty((9, 9, 6, 3))
        tips[..., 0] = geometry.origin + along[:, None]
        tips[..., 1] = geometry.y + np.array(SIDE) * beside
        tips[..., 2] = height * conditions.step_height - conditions.standing_height
        _, reachable = compiled.inverse(tips)
        assert reachable.all()


@pytest.mark.parametrize("name", ["curve", "turn", "slalom", "sideways"])
def test_a_body_follows_the_path(name):
    command, duration = COMMANDS[name], 2 * PERIOD
    walk = physical_walk(STARTS[:3], hexmj.load_controller("graham"), command, duration)
    assert np.isinf(walk.outcomes.fall).all()
    end = command.path(walk.planned.time[-1:])[0]
    moved = walk.qpos[-1, :, :2] - walk.qpos[0, :, :2]
    assert np.allclose(moved, end[:2], atol=0.05 * np.hypot(*end[:2]) + 3.0)
    heading = 2 * np.arctan2(walk.qpos[-1, :, 6], walk.qpos[-1, :, 3])
    assert np.allclose(heading, end[2], atol=max(0.1, 0.1 * abs(end[2])))
