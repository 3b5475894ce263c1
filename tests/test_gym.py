"""The faces for Gymnasium: its own checks, and one insect, many insects and the physical walk to the same bits."""

import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.mujoco.utils import check_mujoco_reset_state
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import hexmj
from drawing import drawing
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.environments import IDS, dm
from hexmj.environments.gym import StickInsect
from hexmj.environments.vector import StickInsects
from hexmj.errors import InputError
from hexmj.physics import settling
from hexmj.timing import Stride
from tests.episodes import assert_same, some_actions
from tests.plain_observations import plain_observations, plain_rewards

TIPS: dict[str, Any] = {"actions": "tips"}
LDVS: Controller = hexmj.LDVS
NAMES = pytest.mark.parametrize("name", IDS)


def made(name: str, **options: Any) -> Any:
    """The environment itself, without Gymnasium's wrappers."""
    return gymnasium.make(name, **options).unwrapped


def steps_of(walking: Any, actions: np.ndarray) -> list[tuple]:
    """What each action brings about, until the episode ends."""
    seen = []
    for action in actions:
        seen.append(walking.step(action))
        if seen[-1][2] or seen[-1][3]:
            break
    return seen


@NAMES
def test_it_passes_gymnasiums_checks(name):
    """Without a warning."""
    check_env(made(name), skip_render_check=True)
    check_mujoco_reset_state(made(name))


@pytest.mark.slow
@drawing
def test_it_is_rendered():
    check_env(made("hexmj/StickInsectTips-v0"))
    walking = made("hexmj/StickInsect-v0", render_mode="rgb_array")
    walking.reset(seed=0)
    frame = walking.render()
    assert frame.shape == (480, 640, 3)
    assert frame.std() > 5
    walking.close()
    many = StickInsects(2, render_mode="rgb_array")
    many.reset(seed=0)
    first, second = many.render() or (frame, frame)
    np.testing.assert_array_equal(first, frame)
    assert (second != frame).any()
    many.close()


@drawing
def test_one_thread_draws_all_frames():
    walking = made("hexmj/StickInsect-v0", render_mode="rgb_array")
    walking.reset()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(walking.render).result()
        with pytest.raises(InputError, match="another thread has drawn this environment"):
            walking.render()
        pool.submit(walking.render).result()
    walking.close()
    walking.render()
    walking.close()


@pytest.mark.slow
@drawing
@pytest.mark.parametrize("kind", [StickInsect, StickInsects])
def test_what_is_drawn_was_compiled_at_first(kind, tmp_path):
    file = tmp_path / "insect.xml"
    file.write_text(hexmj.STICK_INSECT.mjcf.read_text())
    body = replace(hexmj.STICK_INSECT, name="insect", mjcf=file)
    walking = kind(render_mode="rgb_array", conditions=Conditions(body=body))
    file.write_text("gone")
    walking.reset(seed=0)
    assert np.std(walking.render()) > 5
    walking.close()


@pytest.mark.parametrize("actions", ["joints", "tips"])
def test_the_dm_env_face_passes_them_by_shimmy(actions):
    from shimmy.dm_control_compatibility import DmControlCompatibilityV0

    wrapped = DmControlCompatibilityV0(dm.load(actions=actions))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(symmetric and normalized|not having a spec).*")
        check_env(wrapped)
    first, again, other = (wrapped.reset(seed=seed)[0]["planned_tips"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


@pytest.mark.parametrize(
    ("controller", "conditions", "stride"),
    [
        (LDVS, Conditions(), Stride()),
        (hexmj.SensoryFeedback(LDVS), Conditions(vp=160.0, grasp=0.5, load=0.5), Stride(dt=0.2)),
    ],
    ids=["as usual", "reads the legs, loaded"],
)
def test_no_offsets_are_the_physical_walk_to_the_last_bit(controller, conditions, stride):
    """From the start that is drawn with the same seed, also where the plan is told what the legs feel."""
    few: Any = {"conditions": conditions, "stride": stride}
    starts = hexmj.draw_starts(2, 7, stride)
    walked = hexmj.physical_walk(starts, controller, 0.3, 40.0, **few)
    walking = StickInsect(**TIPS, velocity=0.3, controller=controller, duration=40.0, **few)
    for start, seed in ((0, 7), (1, None)):
        walking.reset(seed=seed)
        qpos, fell, over = [], False, False
        for _ in range(round(40.0 / stride.dt)):
            *_, fell, over, _ = walking.step(np.zeros(18))
            qpos.append(walking.data.qpos.copy())
        assert over and not fell
        np.testing.assert_array_equal(qpos, walked.qpos[:, start])


@pytest.mark.parametrize("actions", ["joints", "tips"])
def test_it_is_the_environment_of_dm_env_but_for_units(actions):
    """The same positions and observations to the last bit."""
    walking, other = StickInsect(actions=actions, velocity=0.5), dm.load(0.5, actions=actions, seed=3)
    observed, step = walking.reset(seed=3)[0], other.reset()
    home = other.physics.compiled.home[7:] if actions == "joints" else np.zeros(18)
    spec = other.action_spec()
    for action in some_actions(150, 1, size=0.1)[:, 0]:
        span = np.where(action > 0, spec.maximum - home, home - spec.minimum)
        observed, reward, fell, _, _ = walking.step(action)
        step = other.step(home + action * span)
        np.testing.assert_array_equal(walking.data.qpos, other.physics.position())
        assert list(observed) == list(step.observation)
        assert_same(observed, step.observation)
        assert reward == step.reward
        assert fell == (step.discount == 0.0)
        if fell:
            break


@pytest.mark.parametrize("actions", ["joints", "tips"])
def test_what_is_computed_in_one_pass_is_what_plain_formulas_say(actions):
    """Of insects that walk, fall and lie, some of whose tips are out of reach."""
    many = StickInsects(4, actions=actions, velocity=0.5, autoreset_mode="Disabled")
    many.reset(seed=3)
    walkers, compiled, task = many._walkers, many._compiled, many.task
    for action in some_actions(150, 4, size=0.3):
        observed, reward, fell, *_ = many.step(action)
        standing = observed["contact"] > 0
        plain = plain_observations(walkers.places, standing, walkers._planned, compiled, task)
        assert list(observed) == list(plain)
        for name, values in plain.items():
            np.testing.assert_allclose(observed[name], values, rtol=0, atol=1e-9, err_msg=name)
        walks = walkers._walking | fell
        np.testing.assert_allclose(reward[walks], plain_rewards(walkers.places, fell, task)[walks], atol=1e-12)
    assert not walkers._walking.all()


def test_no_action_is_home_and_full_ones_are_the_ends_of_the_ranges():
    walking = StickInsect(actions="joints")
    walking.reset(seed=0)
    targets = []
    for action in (-1.0, 0.0, 1.0):
        walking.step(np.full(18, action, dtype=np.float32))
        targets.append(walking.data.ctrl.copy())
    low, high = walking.model.actuator_ctrlrange.T
    np.testing.assert_allclose(targets[0], low, atol=1e-12)
    np.testing.assert_allclose(targets[2], high, atol=1e-12)
    np.testing.assert_array_equal(targets[1], walking.model.key("home").qpos[7:])


def walk_alone(seed: int, done: np.ndarray, mode: AutoresetMode, **task: Any) -> list[tuple]:
    """What a vector environment of a mode shall show of one insect."""
    walking, seen, over = StickInsect(**task), [], False
    observed = walking.reset(seed=seed)[0]
    for action in done:
        if over and mode is AutoresetMode.NEXT_STEP:
            observed, over = walking.reset()[0], False
            seen.append((observed, 0.0, False, False, None))
            continue
        if over and mode is AutoresetMode.DISABLED:
            seen.append((observed, 0.0, False, False, None))
            continue
        observed, reward, fell, late, _ = walking.step(action)
        over, last = fell or late, None
        if over and mode is AutoresetMode.SAME_STEP:
            last, observed, over = observed, walking.reset()[0], False
        seen.append((observed, reward, fell, late, last))
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize(("count", "threads"), [(1, 1), (3, 1), (3, 2)])
def test_many_insects_are_single_ones_to_the_last_bit(mode, count, threads):
    """Whatever their number and the threads, in every mode of beginning anew, over falls and ends of time."""
    task: Any = {"actions": "tips", "velocity": 0.8, "duration": 14.0}
    actions = some_actions(160, count, seed=5, size=0.5)
    many = StickInsects(count, autoreset_mode=mode, threads=threads, **task)
    many.reset(seed=20)
    alone = [walk_alone(20 + i, actions[:, i], mode, **task) for i in range(count)]
    ends = 0
    for n, action in enumerate(actions):
        observed, reward, fell, late, infos = many.step(action)
        for i in range(count):
            here, gain, fell_here, late_here, last = alone[i][n]
            assert_same({name: values[i] for name, values in observed.items()}, here)
            assert (reward[i], fell[i], late[i]) == (gain, fell_here, late_here)
            if last is not None:
                assert infos["_final_obs"][i]
                assert_same(infos["final_obs"][i], last)
            ends += fell_here or late_here
    assert ends > 0


def test_a_plan_that_reads_the_legs_is_told_of_its_own_insects_alone():
    task: Any = {"actions": "tips", "velocity": 0.8, "duration": 12.0, "controller": hexmj.SensoryFeedback(LDVS)}
    actions = some_actions(140, 3, seed=1)
    many = StickInsects(3, **task)
    many.reset(seed=3)
    alone = [walk_alone(3 + i, actions[:, i], AutoresetMode.NEXT_STEP, **task) for i in range(3)]
    for n, action in enumerate(actions):
        observed = many.step(action)[0]
        for i in range(3):
            assert_same({name: values[i] for name, values in observed.items()}, alone[i][n][0])


def test_what_is_handed_out_is_never_written_to_again():
    many = StickInsects(2, **TIPS)
    handed = [many.reset(seed=0)[0]] + [many.step(np.zeros((2, 18)))[0] for _ in range(3)]
    kept = [{name: values.copy() for name, values in one.items()} for one in handed]
    many.step(np.zeros((2, 18)))
    many.reset(seed=1)
    for one, copy in zip(handed, kept, strict=True):
        assert_same(one, copy)
    assert handed[1] in many.observation_space


def test_some_insects_begin_anew_and_the_others_go_on():
    many = StickInsects(3, autoreset_mode="Disabled", **TIPS)
    many.reset(seed=0)
    before = many.step(np.zeros((3, 18)))[0]
    after = many.reset(seed=[5, 6, 7], options={"reset_mask": np.array([False, True, False])})[0]
    for i, anew in enumerate((False, True, False)):
        same = all(np.array_equal(before[name][i], after[name][i]) for name in before)
        assert same is not anew
    assert_same({name: values[1] for name, values in after.items()}, StickInsect(**TIPS).reset(seed=6)[0])
    assert many.np_random_seed == (0, 6, 2)


@pytest.mark.thorough
def test_make_finds_them_in_whatever_order_of_imports():
    """In a process of its own, as a script would; and neither dm_control nor a GL is there."""
    script = (
        "import gymnasium, sys\n"
        "gymnasium.make('hexmj.environments:hexmj/StickInsect-v0').reset(seed=0)\n"
        "gymnasium.make_vec('hexmj/StickInsectTips-v0', num_envs=2).reset(seed=0)\n"
        "print([one for one in sys.modules if one.split('.')[0] in ('dm_control', 'OpenGL')])\n"
    )
    has = "\nassert 'hexmj/StickInsect-v0' in gymnasium.registry\n"
    orders = (
        "import gymnasium, hexmj",
        "import hexmj, gymnasium",
        "import hexmj.environments.gym, gymnasium",
        "import hexmj, sys; [sys.modules.pop(one) for one in [*sys.modules] if one[:5] == 'hexmj']; import hexmj"
        "; import gymnasium",
        "import hexmj; import importlib.util as util; util.find_spec('gymnasium'); import gymnasium.spaces",
    )
    plain = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    for code, said in ((script, "[]"), *((order + has, "") for order in orders)):
        done = subprocess.run(
            [sys.executable, "-c", code], env=plain | {"PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True, text=True,
        )  # fmt: skip
        assert (done.returncode, done.stdout.strip()) == (0, said), done.stderr
    assert hexmj.environments.IDS is IDS


@pytest.mark.parametrize("walking", [StickInsect(**TIPS), StickInsects(1, **TIPS)], ids=["one", "many"])
def test_nonsensical_actions_are_refused(walking: Any):
    walking.reset(seed=0)
    shape = walking.action_space.shape
    for action, sentence in (
        (np.full(shape, 1.5), "the action's L1_forward = 1.5; expected -1 to 1"),
        (np.full(shape, np.nan), "the action's L1_forward = nan; expected -1 to 1"),
        (np.zeros(3), "an action has the shape"),
        (np.ma.masked_all(shape), "action = .*; expected numbers"),
        ("go", "action = 'go'; expected numbers"),
    ):
        with pytest.raises(InputError, match=sentence):
            walking.step(action)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"velocity": 1.5}, "velocity = 1.5; expected 0 < V < 1"),
        ({"actions": "feet"}, "actions = 'feet'; valid names: joints, tips"),
        ({"render_mode": "human"}, "render_mode = 'human'; valid names: rgb_array"),
        ({"velocty": 0.5}, "setting 'velocty'; valid names: velocity, actions, controller"),
        ({"num_envs": 0}, "num_envs = 0; expected a whole number"),
        ({"autoreset_mode": "never"}, "autoreset_mode = 'never'; valid names: NextStep, SameStep, Disabled"),
    ],
)
def test_nonsense_is_refused(options, sentence):
    with pytest.raises(InputError, match=sentence):
        StickInsects(**options)


@pytest.mark.parametrize("walking", [StickInsect(), StickInsects(2)], ids=["one", "many"])
def test_a_step_needs_a_reset_and_a_copy_another_make(walking: Any):
    with pytest.raises(InputError, match="before the first reset"):
        walking.step(np.zeros(walking.action_space.shape))
    with pytest.raises(InputError, match="neither copied nor pickled"):
        deepcopy(walking)
    with pytest.raises(InputError, match="options = 5"):
        walking.reset(options=5)
    valid = "none" if walking.action_space.shape == (18,) else "reset_mask"
    with pytest.raises(InputError, match=f"option 'mask'; valid names: {valid}"):
        walking.reset(options={"mask": np.array([True, False])})


def test_a_refused_reset_takes_no_seed():
    walking, other = made("hexmj/StickInsect-v0"), made("hexmj/StickInsect-v0")
    for one in (walking, other):
        one.reset(seed=0)
    with pytest.raises(InputError, match="option 'x'"):
        walking.reset(seed=5, options={"x": 1})
    assert_same(walking.reset()[0], other.reset()[0])


def test_a_step_after_the_end_is_refused_until_a_reset():
    """It would go on for ever: nobody ends twice."""
    walking = made("hexmj/StickInsect-v0", duration=1.0)
    walking.reset(seed=0)
    over = steps_of(walking, np.zeros((100, 18)))
    assert over[-1][3] and len(over) < 100
    with pytest.raises(InputError, match="a step after the episode's end; expected a reset"):
        walking.step(np.zeros(18))
    walking.reset()
    walking.step(np.zeros(18))


def test_seeds_of_many_are_whole_numbers():
    many = StickInsects(2)
    plain = many.reset(seed=3)[0]["tips"]
    for seed in (np.int64(3), [3, 4], np.array([3, 4])):
        assert np.array_equal(many.reset(seed=seed)[0]["tips"], plain)  # pyright: ignore[reportArgumentType]
    for wrong in (1.5, "ab", -1, [1.5, 2], [True, 1], np.array(5)):
        with pytest.raises(InputError, match="seed = "):
            many.reset(seed=wrong)  # pyright: ignore[reportArgumentType]


def test_who_begins_again_settles_to_the_same_bits_and_builds_nothing(monkeypatch):
    again = settling.Settling(Conditions(), Stride(), None)
    for starts in (hexmj.draw_starts(3, 1), hexmj.draw_starts(3, 0), hexmj.draw_starts(1, 0)):
        reused, fresh = again.at(starts), settling.settle(starts)
        for name in ("state", "ctrl", "load", "torques"):
            np.testing.assert_array_equal(getattr(reused, name), getattr(fresh, name))
    walking = made("hexmj/StickInsect-v0")
    walking.reset(seed=0)
    for name in ("compile_body", "MujocoBatch"):
        monkeypatch.setattr(settling, name, None)
    walking.reset()


@pytest.mark.parametrize("face", ["gym", "vector"])
def test_without_gymnasium_it_is_said_what_brings_it(face):
    program = f"""
import sys
sys.modules["gymnasium"] = None
from hexmj.errors import InputError
try:
    from hexmj.environments import {face}
except InputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == 'gymnasium is not installed; in a checkout of hexmj: pip install ".[gym]"\n'
