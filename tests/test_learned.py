"""What was learned walks as a controller, and the examples that train do so, made small."""

import importlib
import shutil
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hexmj.user_code.loaded import importable

import hexmj
from hexmj.conditions import Conditions
from hexmj.controllers.conformance import check_controller
from hexmj.controllers.leg_lost import LegLost
from hexmj.controllers.poor_senses import PoorSenses
from hexmj.environments.gym import StickInsect
from hexmj.environments.learned import FELT, MOST, TILT, TIPS, VELOCITY, OffsetPlan, WithOffsets, felt, felt_in
from hexmj.errors import InputError
from hexmj.view.live import LiveWalk

ROOT = Path(__file__).parents[1]


@pytest.fixture
def example(monkeypatch, tmp_path):
    """One that trains, and writes into a folder of this test."""
    monkeypatch.syspath_prepend(str(ROOT / "examples"))

    def load(name: str) -> ModuleType:
        sys.modules.pop(name, None)
        module = importlib.import_module(name)
        monkeypatch.setattr(module, "FOUND", tmp_path / "found")
        return module

    return load


def some_reflexes(module: ModuleType) -> WithOffsets:
    weights = np.random.default_rng(0).uniform(-0.1, 0.1, (3, 5))
    weights[:, 4:] = 0.0
    return WithOffsets(module.Reflexes(tuple(map(tuple, weights.tolist()))))


def test_no_offsets_plan_what_the_controller_plans(example):
    starts = hexmj.draw_starts(5, 0)
    still = WithOffsets(example("train_cma").Reflexes())
    planned, own = (hexmj.walk(starts, one, 0.5, 60.0) for one in (still, hexmj.LDVS))
    np.testing.assert_allclose(planned.x, own.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(planned.y, own.y, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(planned.stance, own.stance)


@dataclass(frozen=True)
class Ahead:
    """Every tip further ahead, by a part of the largest offset."""

    part: float

    def __call__(self, felt):
        return np.tile([self.part, 0.0, 0.0], (len(felt), 6))


@pytest.mark.parametrize("part", [0.3, -1.0])
def test_offsets_keep_to_where_legs_step(part):
    """Plans do; in the environment nothing is cut off."""
    starts = hexmj.draw_starts(5, 0)
    planned, own = (hexmj.walk(starts, one, 0.5, 60.0).x for one in (WithOffsets(Ahead(part)), hexmj.LDVS))
    expected = np.clip(own + 5.0 * part, np.minimum(own, -20.0), np.maximum(own, 10.0))
    np.testing.assert_allclose(planned, expected, rtol=0, atol=1e-9)
    assert (expected != own + 5.0 * part).any()


@pytest.mark.parametrize("values", [{}, {"step_height": 8.0, "lift_time": 40.0, "standing_height": 12.0}, {"vp": 40.0}])
def test_no_offsets_walk_nearly_as_the_controller_does(example, values):
    """Heights come in evenly over a step, so not to the last bit."""
    conditions, still = Conditions(**values), example("train_cma").Reflexes()
    walks = [
        hexmj.physical_walk(hexmj.draw_starts(1, 3), one, 0.3, 10.0, conditions=conditions, threads=1)
        for one in (WithOffsets(still, conditions=conditions), hexmj.LDVS)
    ]
    np.testing.assert_allclose(walks[0].qpos, walks[1].qpos, rtol=0, atol=0.02)


def test_a_policy_around_another_is_of_its_conditions(example):
    policy = example("train_cma").Reflexes()
    outer = WithOffsets(policy, controller=WithOffsets(policy), conditions=Conditions(vp=40.0))
    with pytest.raises(InputError, match=r"the plan is made for vp = 80\.0; expected that of the conditions, 40\.0"):
        hexmj.physical_walk(hexmj.draw_starts(1, 3), outer, 0.3, 1.0, conditions=outer.conditions)
    live = LiveWalk(outer.controller, 0.3, hexmj.draw_starts(1, 3)[0])
    live.advance(0.1)
    before = live.moment
    with pytest.raises(InputError, match=r"the plan is made for vp = 80\.0; expected that of the conditions, 40\.0"):
        live.begin(conditions=outer.conditions)
    assert live.moment is before and live.advance(0.1).seconds > before.seconds


@pytest.mark.parametrize(
    ("values", "told"), [({"step_height": 8.0}, "step_height = 12.0; .* 8.0"), ({"vp": 40.0}, "vp = 80.0; .* 40.0")]
)
def test_a_walk_under_conditions_that_it_was_not_told_is_refused(example, values, told):
    conditions, still = Conditions(**values), WithOffsets(example("train_cma").Reflexes())
    for one in (still, LegLost(still, 2), PoorSenses(still)):
        with pytest.raises(InputError, match=f"the plan is made for {told}"):
            hexmj.physical_walk(hexmj.draw_starts(1, 3), one, 0.3, 1.0, conditions=conditions)
    with pytest.raises(InputError, match=f"the plan is made for {told}"):
        StickInsect(controller=still, conditions=conditions).reset(seed=0)
    body = hexmj.STICK_INSECT
    other = replace(body, lengths=replace(body.lengths, largest_tip_offset=1.0))
    with pytest.raises(InputError, match="the plan is made for another body that is called stick_insect"):
        hexmj.physical_walk(hexmj.draw_starts(1, 3), still, 0.3, 1.0, conditions=Conditions(body=other))
    hexmj.physical_walk(hexmj.draw_starts(1, 3), still, 0.3, 1.0, conditions=Conditions(load=1.0))


@dataclass(frozen=True)
class Odd:
    """Answers something."""

    rows: int
    columns: int
    value: float = 0.0

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        return np.full((self.rows, self.columns), self.value)


@pytest.mark.parametrize("odd", [Odd(18, 2), Odd(1, 36), Odd(2, 18, np.nan)])
def test_a_policy_that_answers_something_else_is_refused(odd):
    with pytest.raises(InputError, match=r"a policy answers .* expected numbers, .*\(2, 18\)"):
        hexmj.walk(hexmj.draw_starts(2, 0), WithOffsets(odd), 0.5, 1.0)
    assert hexmj.walk(hexmj.draw_starts(2, 0), WithOffsets(Odd(2, 18)), 0.5, 1.0)


@pytest.mark.thorough
def test_it_obeys_the_laws_of_controllers(example):
    check_controller(some_reflexes(example("train_cma")))


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "learned"), [("train_cma", "REFLEXES"), ("train_ppo", "RIGHTING")])
def test_what_was_learned_obeys_them_too(example, name, learned):
    check_controller(vars(example(name))[learned])


def test_a_policy_feels_the_same_in_a_walk_as_in_the_environment(example, monkeypatch):
    """And so it walks nearly alike: an offset comes in over a step there, and at once here."""
    felt, controller = [], some_reflexes(example("train_cma"))
    step = OffsetPlan._step
    monkeypatch.setattr(
        OffsetPlan, "_step", lambda plan: (felt.append((plan._told.all(), plan._felt.copy())), step(plan))[1]
    )
    walked = hexmj.physical_walk(hexmj.draw_starts(1, 0), controller, 0.3, 10.0)
    walking = StickInsect(actions="tips", velocity=0.3)
    observed = walking.reset(seed=0)[0]
    here = felt_in({name: values[None] for name, values in observed.items()})
    assert here.shape == (1, FELT) and np.array_equal(felt_in(observed), here[0])
    with pytest.raises(hexmj.InputError, match=r"^observations of .*; expected contact, too$"):
        felt_in({name: values for name, values in observed.items() if name != "contact"})
    with pytest.raises(hexmj.InputError, match=r"^observations = .*; expected a dict$"):
        felt_in(np.zeros(38))  # pyright: ignore
    for name, values in (("contact", np.ones(5)), ("orientation", np.ones((1, 4))), ("planned_tips", None)):
        with pytest.raises(hexmj.InputError, match=r" of the shape \(.*\); expected \(.*\)$|planned_tips = None; exp"):
            felt_in(observed | {name: values})  # pyright: ignore
    np.testing.assert_allclose(next(one for told, one in felt if told), here, rtol=0, atol=1e-9)
    for _ in range(99):
        action = controller.policy(felt_in({name: values[None] for name, values in observed.items()}))[0]
        observed = walking.step(action)[0]
    assert np.abs(walking.data.qpos - walked.qpos[98, 0]).max() < 0.5


def test_a_larger_body_feels_as_a_small_one_does():
    """Lengths and velocities grow with it, angles and contacts do not."""
    draw, insect = np.random.default_rng(0), hexmj.STICK_INSECT
    tilt, velocity, turning, contact, stance, tips = (draw.normal(size=(5, n)) for n in (2, 3, 3, 6, 6, 18))
    large = replace(insect, standing_height=4 * insect.standing_height)
    seen = felt(large, tilt, 80 * velocity, turning, contact, stance, 40 * tips)
    np.testing.assert_array_equal(seen, felt(insect, tilt, 20 * velocity, turning, contact, stance, 10 * tips))
    assert np.abs(felt(insect, tilt, 1e4 * velocity, turning, contact, stance, 1e4 * tips)).max() == MOST


def test_on_paper_it_walks_upright_at_its_velocity(example):
    plan = some_reflexes(example("train_cma")).begin(np.zeros((2, 6)), np.array([0.5, 0.2]), hexmj.Stride())
    upright = plan._upright(np.array([0.5, 0.2]))
    np.testing.assert_allclose(upright[:, VELOCITY] * 50.0, [[40.0, 0.0, 0.0], [16.0, 0.0, 0.0]])
    assert np.abs(upright[:, TIPS]).max() < 5.0


@pytest.mark.slow
def test_cma_trains(example, monkeypatch, capsys):
    module = example("train_cma")
    for name, small in {"POPULATION": 4, "STARTS": 2, "GENERATIONS": 2, "WINDOW": 5.0}.items():
        monkeypatch.setattr(module, name, small)
    compare = hexmj.compare
    monkeypatch.setattr(hexmj, "compare", lambda *args, **options: compare(*args, **options | {"n_starts": 3}))
    module.main()
    assert "reflexes: physical FLSS of the start at V = 0.6 is" in capsys.readouterr().out
    assert np.any(np.array(module.found().policy.weights) != 0.0)


@pytest.mark.slow
def test_ppo_trains(example, monkeypatch, capsys):
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    module = example("train_ppo")
    for name, small in {"INSECTS": 4, "ROLLOUTS": 2, "HELD": 10, "WINDOW": 5.0, "STARTS": 3}.items():
        monkeypatch.setattr(module, name, small)
    module.main()
    said = capsys.readouterr().out
    assert "16 actions" in said and "righting: " in said and "fall at V = 0.6, of 3 fresh starts" in said
    assert module.found().policy != module.Righting()


@pytest.mark.slow
def test_an_action_is_held_and_rewarded_until_the_first_end():
    """An episode of 3 steps ends within an action of 4; the fourth is another's, and nobody pays for it."""
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    face, counted = importlib.import_module("hexmj.environments.stable_baselines"), []

    def still(actions: np.ndarray, felt: np.ndarray) -> np.ndarray:
        counted.append(actions)
        return np.zeros((len(felt), 18))

    insects = face.FeltInsects(2, velocity=0.3, duration=0.3)
    held = face.HeldInsects(insects, 5, 4, still, lambda walked, felt, fell: np.ones(len(walked)))
    assert held.reset().shape == (2, 1)
    seen, reward, done, infos = held.step(np.full((2, 5), 0.5))
    assert len(counted) == 4 and counted[0].shape == (2, 5) and seen.shape == (2, 1)
    np.testing.assert_array_equal(reward, 0.75)
    assert done.all() and all(one["TimeLimit.truncated"] and one["terminal_observation"] == 1 for one in infos)


@pytest.mark.slow
def test_what_all_insects_share_is_not_asked_of_some_or_set():
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    insects = importlib.import_module("hexmj.environments.stable_baselines").FeltInsects(3)
    assert len(insects.env_method("reset")) == len(insects.get_attr("task")) == 3
    assert len(insects.env_method("reset", indices=[0, -2, -1])) == 3
    with pytest.raises(InputError, match=r"indices = \[0\]; expected all 3"):
        insects.env_method("reset", indices=[0])
    with pytest.raises(InputError, match=r"velocity = 0.9 cannot be set; expected new insects"):
        insects.set_attr("velocity", 0.9)
    insects.set_options({"reset_mask": None})
    with pytest.raises(InputError, match=r"options = .*; expected none"):
        insects.reset()
    insects.reset()


@pytest.mark.slow
def test_held_actions_without_sense_are_refused():
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    face = importlib.import_module("hexmj.environments.stable_baselines")
    insects, told = face.FeltInsects(2, duration=1.0), list[Any]([np.ones(2)])

    def held(numbers: object = 1, steps: object = 2) -> Any:
        return face.HeldInsects(insects, numbers, steps, lambda *_: np.zeros((2, 18)), lambda *_: told[0])

    for steps in (0, -1, 2.5, True, "2"):
        with pytest.raises(InputError, match=r"steps = .*; expected a whole number of at least 1"):
            held(steps=steps)
    with pytest.raises(InputError, match=r"numbers = 0; expected a whole number"):
        held(numbers=0)
    with pytest.raises(InputError, match=r"insects = 3; expected a VecEnv"):
        face.HeldInsects(3, 1, 2, lambda *_: 0, lambda *_: 0)
    with pytest.raises(InputError, match=r"reward = None; expected a function"):
        face.HeldInsects(insects, 1, 2, lambda *_: 0, None)
    walked = held()
    with pytest.raises(InputError, match="a step before the first reset"):
        walked.step(np.zeros((2, 1)))
    walked.reset()
    with pytest.raises(InputError, match="or without an action"):
        walked.step_wait()
    for actions, sentence in (
        (np.zeros((2, 7)), r"an action has the shape \(2, 7\); expected \(2, 1\)"),
        ([[0.0], [5.0]], "an action has 5.0; expected -1 to 1"),
        ([[0.0], [np.nan]], "an action has nan; expected -1 to 1"),
        ("ab", "action = 'ab'; expected numbers"),
        (1j * np.ones((2, 1)), "action = .*; expected numbers"),
    ):
        with pytest.raises(InputError, match=sentence):
            walked.step(actions)
    for reward in (np.ones((2, 1)), np.array([0.0, np.nan]), 1.0, "no"):
        told[0] = reward
        with pytest.raises(InputError, match=r"reward = .*; expected"):
            walked.step(np.zeros((2, 1)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("actions", "sentence"),
    [("abc", "expected numbers"), (np.full((2, 18), 1j), "expected numbers"), (np.zeros((1, 18)), "has the shape")],
)
def test_actions_that_are_none_are_refused_by_felt_insects(actions, sentence):
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    face = importlib.import_module("hexmj.environments.stable_baselines")
    insects = face.FeltInsects(2, duration=1.0)
    insects.reset()
    assert len(insects.get_attr("num_envs", -1)) == 1
    assert insects.get_attr("action_space")[0].shape == (18,)
    with pytest.raises(InputError, match=sentence):
        insects.step(actions)
    with pytest.raises(InputError, match="action = None; expected numbers"):
        insects.step_wait()
    for index in (9, 1.5):
        with pytest.raises(InputError, match=f"index = {index}; expected a whole number of at least -2 and at most 1"):
            insects.get_attr("task", index)
    with pytest.raises(InputError, match="actions = 'joints'; expected none: it is settled here"):
        face.FeltInsects(2, actions="joints")


@pytest.mark.slow
def test_a_fall_is_rewarded_by_what_was_felt_as_it_fell_and_every_insect_is_drawn():
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    face, fallen = importlib.import_module("hexmj.environments.stable_baselines"), []
    insects = face.FeltInsects(2, velocity=0.5, render_mode="rgb_array")

    def leaning(felt: np.ndarray) -> list[float]:
        return np.abs(felt[:, TILT]).max(axis=1).tolist()

    def reward(walked: np.ndarray, felt: np.ndarray, fell: np.ndarray) -> np.ndarray:
        fallen.extend(leaning(felt[fell]))
        return walked

    def front_up_hind_down(actions: np.ndarray, felt: np.ndarray) -> np.ndarray:
        return np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(felt), 2))

    held = face.HeldInsects(insects, 1, 100, front_up_hind_down, reward)
    held.reset()
    for _ in range(5):
        held.step(np.zeros((2, 1)))
    assert fallen and min(fallen) > max(leaning(insects.reset()))
    assert len(frames := insects.get_images()) == 2 and all(frame.std() > 1 for frame in frames)
    insects.close()


def test_what_ppo_found_is_there_and_is_the_same_in_every_leg_mirrored(example):
    module = example("train_ppo")
    policy, seen = module.RIGHTING.policy, np.random.default_rng(0).normal(size=(3, FELT))
    assert np.abs(policy(seen)).max() > 0.1
    mirrored = seen.copy()
    mirrored[:, [1, 5, 7]] *= -1.0  # lean to the left, and turning about the axes ahead and up
    legs = policy(seen).reshape(3, 2, 3, 3)[:, ::-1] * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(policy(mirrored), legs.reshape(3, 18), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name, learned", [("train_cma", "REFLEXES"), ("train_ppo", "RIGHTING")])
def test_without_what_was_found_there_is_no_controller(name, learned, tmp_path):
    copy = shutil.copy(ROOT / "examples" / f"{name}.py", tmp_path)
    assert not hasattr(importable(copy), learned)


def test_without_stable_baselines_it_is_said_what_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "hexmj.environments.stable_baselines", raising=False)
    with pytest.raises(hexmj.InputError, match=r'pip install "\.\[rl\]"'):
        importlib.import_module("hexmj.environments.stable_baselines")
