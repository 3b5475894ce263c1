"""The static limit: slow walks tend to their plan and to the static criterion, and what keeps them apart is known."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexmj import LDVS, Conditions, draw_starts, load_controller, physical_walk, walk_margin
from hexmj.body import STICK_INSECT
from hexmj.studies.static_limit import StaticLimit, distances
from hexmj.sweep import run_study

FEW: dict[str, Any] = {"n_starts": 12, "observation_time": "start"}


@pytest.fixture(scope="module")
def slower(tmp_path_factory):
    folder = tmp_path_factory.mktemp("converge")
    return folder, run_study(StaticLimit(LDVS, vps=(400.0, 100.0, 25.0), **FEW), folder)


@pytest.mark.slow
def test_slow_walks_tend_to_their_plan_and_to_the_static_criterion(slower):
    _, result = slower
    fast, slow = result.sel(vp=400.0), result.sel(vp=25.0)
    assert (slow.margin.mean("start") < 0.25 * fast.margin.mean("start")).all()
    assert (slow.agreement >= fast.agreement).all()
    assert (abs(slow.physical - slow.kinematic) < abs(fast.physical - fast.kinematic)).all()
    assert (fast.physical < slow.physical / 2).all()  # dynamics saves fast walks


@pytest.mark.slow
def test_the_feet_at_the_ground_give_the_planned_answer_where_those_that_carry_do_not(slower):
    """With 30 starts over the observation time `walk` at 20 mm/s: 0.467 planned, 0.600 carried, 0.467 at the ground."""
    _, result = slower
    slow = result.sel(vp=25.0)
    assert (abs(slow.grounded - slow.kinematic) <= abs(slow.carried - slow.kinematic)).all()
    assert (slow.carried > slow.kinematic).all()
    assert (slow.agreement_grounded == 1.0).all()
    assert (result.agreement_grounded > result.agreement_carried).sel(vp=[100.0, 25.0]).all()


@pytest.mark.slow
def test_light_legs_keep_the_centre_of_mass_at_o(slower):
    _, result = slower
    assert (result.drift.sel(leg_mass=0.01) < 0.02).all()
    assert (result.drift.sel(leg_mass=1.0) > 0.05).all()
    assert (result.kinematic == result.kinematic[0, 0]).all()


@pytest.mark.slow
def test_margins_of_light_and_stiff_legs_are_the_planned_ones():
    """What keeps them apart where the same feet stand: legs that give way, and whose mass moves the centre of mass.

    A servo for half the time step is four times as stiff.  Measured: 0.158 mm, and 0.039 and 0.011 mm with legs of 1 %
    of the mass and servos 4 and 16 times as stiff.
    """
    margins, servo = [], STICK_INSECT.servo
    for finer, leg_mass, longest in ((1, 1.0, 0.5), (2, 0.01, 0.25), (4, 0.01, 0.125)):
        body = replace(STICK_INSECT, servo=replace(servo, step=servo.step / finer))
        conditions = replace(Conditions(vp=25.0, leg_mass=leg_mass, longest_substep=longest), body=body)
        walk = physical_walk(draw_starts(8, 0), LDVS, 0.5, 40.0, conditions=conditions)
        stable = (walk.planned.time[:, None] < walk.outcomes.planned_loss) & np.isfinite(walk.measured.x[..., 0])
        same = stable & (walk.measured.stance == walk.planned.stance).all(axis=-1)
        margins.append(abs(walk_margin(walk.measured) - walk_margin(walk.planned))[same].mean())
    assert margins[1] < margins[0] / 3
    assert margins[2] < margins[1] / 3


@pytest.mark.slow
def test_with_feedback_the_distance_is_that_from_the_plan_as_commanded():
    walk = physical_walk(draw_starts(6, 0), load_controller("tegotae"), 0.5, 60.0, conditions=Conditions(vp=20.0))
    kinematic = replace(walk, ordered=walk.planned)
    commanded, planned = (distances(way)["margin"].mean() for way in (walk, kinematic))
    assert commanded < planned


@pytest.mark.slow
def test_the_command_writes_its_files_and_tells_the_same_as_text(tmp_path, run):
    words = ("converge", "--vps", 100, 50, "--starts", 4, "--observation-time", 10, "--out", tmp_path)
    code, text, _ = run(*words, "--json")
    assert code == 0
    answer = json.loads(text)
    assert {path.name for path in tmp_path.iterdir()} == {"converge.nc", "converge.png", "manifest.json", "walks"}
    assert len(list((tmp_path / "walks").iterdir())) == 4
    assert np.shape(answer["margin"]) == np.shape(answer["agreement"]) == (2, 2)
    assert answer["settings"]["conditions"]["longest_substep"] == 0.5
    assert not {"vp", "leg_mass"} & set(answer["settings"]["conditions"])
    code, text, _ = run(*words)
    assert code == 0
    assert f"{answer['margin'][0][1]:.3f}" in text
    assert "vp 80" not in text
