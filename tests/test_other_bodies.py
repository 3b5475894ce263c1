"""Bodies of other names, lengths and hinges stand, walk, are recorded and filmed as the stick insect is."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from compiled_bodies import at_home, conditions, differences
from film_reader import read_film
from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.kinematics import HingeChains, ThreeHinges
from hexmj.bodies.mjcf import compile_body, gains, plain_model
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.errors import InputError
from hexmj.measures.physical import physical_walk
from hexmj.physics.outcomes import Outcomes
from hexmj.rendering import gl
from hexmj.replay.recording import load_recording, record, record_plan, save_recording
from hexmj.replay.video import Film, render
from hexmj.starts import draw_starts
from other_bodies import any_hexapod, renamed


@pytest.mark.parametrize("hinges", [3, 4])
def test_a_body_of_any_hinges_compiles_and_can_be_loaded(tmp_path: Path, hinges: int):
    body = any_hexapod(tmp_path, hinges, 6)
    compiled = compile_body(conditions(body, load=0.5, grasp=1.0, leg_mass=0.5, ground="rough"))
    assert isinstance(compiled.kinematics, HingeChains)
    assert compiled.joints == 6 * hinges == compiled.columns.grasp.start
    assert compiled.model.body_mass.sum() == pytest.approx(1.5 * body.mass)
    assert compiled.torque_limits.tolist() == 6 * hinges * [gains(plain_model(body), body)[0]]
    assert compiled.trunk_corners[0].shape == (8, 3)
    stands_and_steps(compiled)


def stands_and_steps(compiled: CompiledBody) -> None:
    """Inverse and forward kinematics are each other's; `test_inverse_kinematics` holds them against MuJoCo's."""
    rng, home = np.random.default_rng(3), compiled.home[compiled.columns.qpos].reshape(6, -1)
    tips = compiled.forward(home + rng.uniform(-0.1, 0.1, (20, *home.shape)))
    joints, reachable = compiled.inverse(tips)
    assert reachable.all()
    assert_allclose(compiled.forward(joints), tips, rtol=0, atol=1e-9)


def test_a_body_of_other_names_and_lengths_stands(tmp_path: Path):
    body = renamed(tmp_path)
    compiled = compile_body(conditions(body))
    old = {*STICK_INSECT.joints, *STICK_INSECT.feet, *STICK_INSECT.trunk, STICK_INSECT.ground}
    assert not old & {*body.joints, *body.feet, *body.trunk, body.ground}
    assert isinstance(compiled.kinematics, ThreeHinges)
    assert compiled.torque_limits[0] == 4.2e5
    stands_and_steps(compiled)
    data = at_home(compiled)
    for _ in range(round(0.5 / compiled.model.opt.timestep)):
        mujoco.mj_step(compiled.model, data)
    mujoco.mj_forward(compiled.model, data)
    touch = data.sensordata[compiled.columns.touch]
    assert (touch > 0).all() and touch.sum() == pytest.approx(compiled.weight, rel=0.01)
    assert not data.sensordata[compiled.columns.trunk].any()
    assert np.linalg.norm(data.qvel[:3]) < body.lengths.speed_at_rest


@pytest.mark.slow
def test_names_alone_change_no_bit(tmp_path: Path):
    """Of the model and of a walk, whether its plan reads the legs or not."""
    body, insect = renamed(tmp_path, 1.0), compile_body(conditions())
    same_home = {"key_qpos", "key_ctrl"}  # from 10 digits in the MJCF to all of them
    other = compile_body(conditions(body))
    assert set(differences(other.model, insect.model)) <= same_home
    assert_allclose(other.home, insect.home, atol=1e-9)
    for controller in (LDVS, SensoryFeedback(LDVS)):
        ours, theirs = (
            physical_walk(draw_starts(4, 0), controller, 0.5, 30.0, conditions=conditions(one, grasp=0.3, load=0.5))
            for one in (STICK_INSECT, body)
        )
        assert_array_equal(theirs.qpos, ours.qpos)
        for name in ("stance", "x", "y"):
            assert_array_equal(getattr(theirs.measured, name), getattr(ours.measured, name))
        for name in Outcomes.__dataclass_fields__:
            assert_array_equal(getattr(theirs.outcomes, name), getattr(ours.outcomes, name))


@pytest.fixture(scope="module")
def longer(tmp_path_factory: pytest.TempPathFactory) -> Body:
    """Another name, longer legs and every name another."""
    return renamed(tmp_path_factory.mktemp("longer"))


def test_a_body_of_other_names_and_lengths_walks(longer: Body):
    """By passing its description, at the speed asked for."""
    walked = physical_walk(draw_starts(6, 0), LDVS, 0.3, 100.0, conditions=conditions(longer))
    stays = np.isinf(walked.outcomes.fall)
    assert stays.mean() > 0.5
    tips = 1000 * walked.conditions.substeps(walked.stride) * 6
    assert (walked.outcomes.unreachable < 0.05 * tips).all()  # its joints' ranges are those of shorter legs
    assert_allclose(walked.outcomes.speed[stays], 1.0, atol=0.05)
    ours = physical_walk(draw_starts(6, 0), LDVS, 0.3, 100.0)
    assert (walked.qpos[-1, stays] != ours.qpos[-1, stays]).any()


def test_a_body_of_other_names_walks_in_the_environment(longer: Body, dm):
    """Zero offsets are its physical walk to the last bit."""
    walked = physical_walk(draw_starts(1, 3), LDVS, 0.3, 20.0, conditions=conditions(longer))
    walking = dm.load(0.3, actions="tips", conditions=conditions(longer), duration=20.0, seed=3)
    step, qpos = walking.reset(), []
    while not step.last():
        step = walking.step(np.zeros(18))
        qpos.append(walking.physics.position())
    assert_array_equal(qpos, walked.qpos[:, 0])


def test_a_body_of_other_names_is_recorded_and_filmed(longer: Body, tmp_path: Path):
    """The insect and a puppet beside it, from a file."""
    walked = physical_walk(draw_starts(1, 0), LDVS, 0.3, 8.0, conditions=conditions(longer))
    puppet = record_plan(walked.planned, walked.conditions, walked.stride)
    path = save_recording(record(walked), tmp_path / "walk.nc")
    if gl.missing():
        pytest.skip("nothing can be rendered here")
    film = Film(width=160, height=120, slow_motion=0.3)
    with load_recording(path) as recording:
        assert render([recording, puppet], tmp_path / "film.mp4", film, body=longer) == 1
        with pytest.raises(InputError):
            render([recording], tmp_path / "other.mp4", film)
    assert read_film(tmp_path / "film.mp4")[0].shape == (1, 120, 320, 3)


def test_usual_places_of_obstacles_hold_no_body_back_where_the_ground_is_flat(tmp_path):
    long = renamed(tmp_path, factor=1.2)
    Conditions(body=long)
    for ground in ("step", "gap", "rough"):
        with pytest.raises(InputError):
            Conditions(body=long, ground=ground)
