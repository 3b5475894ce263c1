"""The Gymnasium interfaces: Gymnasium's checks, and one insect, many insects and the physical walk bit for bit."""

import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.mujoco.utils import check_mujoco_reset_state
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import hexmj
from drawing import drawing
from episodes import KINDS, TIPS, ZEROS, assert_same, some_actions
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.environments import IDS
from hexmj.environments.gym import StickInsect, StickInsects
from hexmj.errors import InputError, SimulationError
from hexmj.physics import settle as settling
from hexmj.timing import Stride
from plain_observations import plain_observations, plain_rewards

LDVS: Controller = hexmj.LDVS
TILTING: dict[str, Any] = TIPS | {"conditions": Conditions(centre_of_mass=-8.0)}
"""Not every start settles."""


def made(name: str, **options: Any) -> Any:
    """Return the environment without Gymnasium's wrappers."""
    return gymnasium.make(name, **options).unwrapped


UNBOUNDED = pytest.mark.filterwarnings("ignore:.*infinity")


@UNBOUNDED
@pytest.mark.parametrize("name", IDS)
def test_it_passes_gymnasiums_checks(name):
    """Without a warning, except for observations without bounds, which Gymnasium's own MuJoCo environments have too."""
    check_env(made(name), skip_render_check=True)
    check_mujoco_reset_state(made(name))


@KINDS
def test_the_dm_env_interface_passes_them_by_shimmy(actions, dm):
    from shimmy.dm_control_compatibility import DmControlCompatibilityV0

    wrapped = DmControlCompatibilityV0(dm.load(actions=actions))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(symmetric and normalized|not having a spec|infinity).*")
        check_env(wrapped)
    first, again, other = (wrapped.reset(seed=seed)[0]["planned_tips"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


@UNBOUNDED
@pytest.mark.slow
@drawing
def test_environments_are_rendered_beside_each_other():
    walking = made("hexmj/StickInsect-v0", render_mode="rgb_array")
    walking.reset(seed=0)
    frame = walking.render()
    assert frame.shape == (480, 640, 3) and frame.std() > 5
    many = StickInsects(2, render_mode="rgb_array")
    many.reset(seed=0)
    first, second = many.render() or (frame, frame)
    np.testing.assert_array_equal(first, frame)
    assert (second != frame).any()
    before = walking.render()
    many.close()
    np.testing.assert_array_equal(walking.render(), before)
    walking.close()
    check_env(made("hexmj/StickInsectTips-v0"))


@pytest.mark.slow
def test_make_imports_the_package_and_a_process_ends_without_messages():
    """With a module name before the id; without dm_control; and frames need not be closed."""
    program = """
import sys, gymnasium
gymnasium.make("hexmj.environments:hexmj/StickInsect-v0").reset(seed=0)
gymnasium.make_vec("hexmj/StickInsectTips-v0", num_envs=2).reset(seed=0)
assert "dm_control" not in sys.modules
"""
    rendered = """
walking = gymnasium.make("hexmj/StickInsectTips-v0", render_mode="rgb_array")
walking.reset(seed=0)
walking.render()
"""
    program += rendered if not drawing.args[0] else ""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr == ""


def test_without_gymnasium_the_error_names_the_extra():
    program = "import sys; sys.modules['gymnasium'] = None; import hexmj.environments.gym"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "InputError" in done.stderr and "[gym]" in done.stderr


@pytest.mark.parametrize(
    ("controller", "conditions", "stride"),
    [
        (LDVS, Conditions(), Stride()),
        (hexmj.SensoryFeedback(LDVS), Conditions(vp=160.0, grasp=0.5, load=0.5), Stride(dt=0.2)),
    ],
    ids=["usual", "sensory feedback, loaded"],
)
def test_zero_offsets_are_the_physical_walk_bit_for_bit(controller, conditions, stride):
    settings: Any = {"conditions": conditions, "stride": stride}
    starts = hexmj.draw_starts(2, 7, stride)
    walked = hexmj.physical_walk(starts, controller, 0.3, 40.0, **settings)
    walking = StickInsect(**TIPS, velocity=0.3, controller=controller, duration=40.0, **settings)
    for start, seed in ((0, 7), (1, None)):
        walking.reset(seed=seed)
        qpos, fell, over = [], False, False
        for _ in range(round(40.0 / stride.dt)):
            *_, fell, over, _ = walking.step(ZEROS)
            qpos.append(walking.data.qpos.copy())
        assert over and not fell
        np.testing.assert_array_equal(qpos, walked.qpos[:, start])


@KINDS
def test_it_is_the_dm_env_environment_in_other_units(actions, dm):
    """Positions and observations agree bit for bit."""
    walking, other = StickInsect(actions=actions, velocity=0.5), dm.load(0.5, actions=actions, seed=3)
    observed, step = walking.reset(seed=3)[0], other.reset()
    home = other.compiled.home[7:] if actions == "joints" else ZEROS
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


@KINDS
def test_compiled_observations_and_rewards_equal_the_plain_formulas(actions):
    """For insects that walk, fall and lie, some with tips out of reach."""
    many = StickInsects(4, actions=actions, velocity=0.5, autoreset_mode="Disabled")
    many.reset(seed=3)
    walkers, compiled, task = many._walkers, many._compiled, many.task
    for action in some_actions(150, 4, size=0.3):
        observed, reward, fell, *_ = many.step(action)
        standing = observed["contact"] > 0
        plain = plain_observations(walkers.state, standing, walkers.planned, compiled, task)
        assert list(observed) == list(plain)
        for name, values in plain.items():
            np.testing.assert_allclose(observed[name], values, rtol=0, atol=1e-9, err_msg=name)
        walks = walkers.walking | fell
        np.testing.assert_allclose(reward[walks], plain_rewards(walkers.state, fell, task)[walks], atol=1e-12)
    assert not walkers.walking.all()


def test_action_0_is_home_and_1_the_ends_of_the_ranges():
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


def walk_alone(seed: int, steps: np.ndarray, mode: AutoresetMode, **task: Any) -> list[tuple]:
    """Return what a vector environment of a mode shows of one insect, from the single environment."""
    walking, seen, over = StickInsect(**task), [], False
    observed = walking.reset(seed=seed)[0]
    for action in steps:
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


FEEDBACK = hexmj.SensoryFeedback(LDVS)


@pytest.mark.parametrize(
    ("mode", "count", "threads", "controller"),
    [
        (AutoresetMode.NEXT_STEP, 3, 2, LDVS),
        (AutoresetMode.SAME_STEP, 3, 1, LDVS),
        (AutoresetMode.DISABLED, 1, 1, LDVS),
        (AutoresetMode.NEXT_STEP, 3, 2, FEEDBACK),
    ],
    ids=["next step", "same step", "disabled", "sensory feedback"],
)
def test_many_insects_are_single_ones_bit_for_bit(mode, count, threads, controller):
    """For any number and threads, in every autoreset mode, over falls and ends of time."""
    task: Any = TIPS | {"velocity": 0.8, "duration": 14.0, "controller": controller}
    actions = some_actions(160, count, seed=5, size=0.5)
    many = StickInsects(count, autoreset_mode=mode, threads=threads, **task)
    many.reset(seed=20)
    alone = [walk_alone(20 + i, actions[:, i], mode, **task) for i in range(count)]
    ends = 0
    for n, action in enumerate(actions):
        observed, reward, fell, late, infos = many.step(action)
        for i in range(count):
            expected, gain, falls, ends_now, last = alone[i][n]
            assert_same({name: values[i] for name, values in observed.items()}, expected)
            assert (reward[i], fell[i], late[i]) == (gain, falls, ends_now)
            if last is not None:
                assert infos["_final_obs"][i]
                assert_same(infos["final_obs"][i], last)
            ends += falls or ends_now
    assert ends > 0


def test_returned_arrays_are_never_changed():
    many = StickInsects(2, **TIPS)
    returned = [many.reset(seed=0)[0]] + [many.step(np.zeros((2, 18)))[0] for _ in range(3)]
    copies = [{name: values.copy() for name, values in observed.items()} for observed in returned]
    many.step(np.zeros((2, 18)))
    many.reset(seed=1)
    for observed, copy in zip(returned, copies, strict=True):
        assert_same(observed, copy)
    assert returned[1] in many.observation_space


def test_a_mask_resets_some_insects_and_the_others_continue():
    many = StickInsects(3, autoreset_mode="Disabled", **TIPS)
    many.reset(seed=0)
    before = many.step(np.zeros((3, 18)))[0]
    after = many.reset(seed=[5, 6, 7], options={"reset_mask": np.array([False, True, False])})[0]
    for i, reset in enumerate((False, True, False)):
        same = all(np.array_equal(before[name][i], after[name][i]) for name in before)
        assert same is not reset
    assert_same({name: values[1] for name, values in after.items()}, StickInsect(**TIPS).reset(seed=6)[0])
    assert many.np_random_seed == [0, 6, 2]


def test_a_step_after_the_end_needs_a_reset():
    walking = StickInsect(duration=1.0)
    walking.reset(seed=0)
    assert [walking.step(ZEROS)[3] for _ in range(10)] == [False] * 9 + [True]
    with pytest.raises(InputError):
        walking.step(ZEROS)
    walking.reset()
    walking.step(ZEROS)


def test_another_reset_settles_to_the_same_bits_and_compiles_nothing(monkeypatch):
    again = settling.Settling(Conditions(), Stride(), None)
    for starts in (hexmj.draw_starts(3, 1), hexmj.draw_starts(3, 0), hexmj.draw_starts(1, 0)):
        reused, fresh = again.at(starts), settling.settle(starts)
        for name in ("state", "ctrl", "load", "torques"):
            np.testing.assert_array_equal(getattr(reused, name), getattr(fresh, name))
    walking = StickInsect()
    walking.reset(seed=0)
    for name in ("compile_body", "MujocoBatch"):
        monkeypatch.setattr(settling, name, None)
    walking.reset()


@pytest.mark.parametrize("kind", [StickInsect, StickInsects])
def test_bad_actions_are_refused_or_clipped(kind):
    walking, clipped = kind(**TIPS), kind(**TIPS)
    zeros = np.zeros(walking.action_space.shape)
    with pytest.raises(InputError):  # before the first reset
        walking.step(zeros)
    for one in (walking, clipped):
        one.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        walking.step(zeros + np.nan)
    with pytest.raises(ValueError, match="shape"):
        walking.step(np.zeros(3))
    assert_same(walking.step(zeros + 1.5)[0], clipped.step(zeros + 1.0)[0])


@pytest.mark.parametrize("name", ["actions", "render_mode"])
def test_bad_settings_are_refused(name):
    wrong: Any = {name: "nothing"}
    with pytest.raises(InputError, match=name):
        StickInsects(**wrong)


def test_a_seed_is_a_number_or_one_number_for_each_insect():
    many = StickInsects(2)
    plain = many.reset(seed=3)[0]["tips"]
    for seed in (np.int64(3), [3, 4]):
        assert np.array_equal(many.reset(seed=seed)[0]["tips"], plain)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("walking", [StickInsect(**TIPS), StickInsects(1, **TIPS)], ids=["single", "vector"])
def test_divergence_is_an_error_with_its_state(walking: Any):
    walking.reset(seed=0)
    walking._walkers.bodies.qvel[0, 0] = 1e12
    with pytest.raises(SimulationError) as error:
        for _ in range(5):
            walking.step(np.zeros(walking.action_space.shape))
    assert set(error.value.state) >= {"qpos", "qvel", "qacc_warmstart"}


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("fault", ["diverges", "does not settle"])
def test_after_a_failure_all_insects_must_be_reset(mode, fault):
    """The third start with the seed 9 does not settle; the error names it."""
    task: Any = TILTING | {"autoreset_mode": mode, "duration": 0.2}
    walking, other, zeros = StickInsects(3, **task), StickInsects(3, **task), np.zeros((3, 18))
    walking.reset(seed=[2, 3, 9])
    if fault == "diverges":
        walking._walkers.bodies.qvel[1, 0] = 1e30
    with pytest.raises(SimulationError, match="start 1" if fault == "diverges" else "start 2"):
        for _ in range(10):
            over = walking.step(zeros)[3].all()
            if over and mode is AutoresetMode.DISABLED:
                walking.reset()
    with pytest.raises(InputError):
        walking.reset(options={"reset_mask": np.array([False, True, False])})
    with pytest.raises(InputError):
        walking.step(zeros)
    assert_same(walking.reset(seed=5)[0], other.reset(seed=5)[0])
    assert_same(walking.step(zeros)[0], other.step(zeros)[0])
