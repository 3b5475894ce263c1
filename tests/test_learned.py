"""Learned policies as controllers, stable-baselines3, and the examples that train, at a small size."""

import importlib
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import hexmj
from hexmj.conditions import Conditions
from hexmj.controllers.conformance import check_controller
from hexmj.environments.gym import StickInsect
from hexmj.environments.learned import FELT, MOST, TIPS, VELOCITY, OffsetPlan, WithOffsets, felt, felt_in
from hexmj.errors import InputError

STARTS = hexmj.draw_starts(5, 0)


@pytest.fixture
def example(monkeypatch, tmp_path):
    """Load an example that trains and writes into a folder of this test."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "examples"))

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


@dataclass(frozen=True)
class Ahead:
    """Every tip further ahead, by a part of the largest offset."""

    part: float = 0.0

    def __call__(self, felt):
        return np.tile([self.part, 0.0, 0.0], (len(felt), 6))


@pytest.mark.parametrize("part", [0.0, 0.3, -1.0])
def test_offsets_move_planned_tips_within_the_step_range(part):
    planned, own = (hexmj.walk(STARTS, plan, 0.5, 60.0) for plan in (WithOffsets(Ahead(part)), hexmj.LDVS))
    expected = np.clip(own.x + 5.0 * part, np.minimum(own.x, -20.0), np.maximum(own.x, 10.0))
    np.testing.assert_allclose(planned.x, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(planned.y, own.y, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(planned.stance, own.stance)
    assert (expected != own.x + 5.0 * part).any() == (part != 0.0)


@pytest.mark.parametrize("values", [{}, {"step_height": 8.0, "lift_time": 40.0, "standing_height": 12.0}, {"vp": 40.0}])
def test_without_offsets_the_walk_is_nearly_the_controllers(values):
    """Not bit for bit, because heights change evenly over a step."""
    conditions = Conditions(**values)
    walks = [
        hexmj.physical_walk(hexmj.draw_starts(1, 3), controller, 0.3, 10.0, conditions=conditions, threads=1)
        for controller in (WithOffsets(Ahead(), conditions=conditions), hexmj.LDVS)
    ]
    np.testing.assert_allclose(walks[0].qpos, walks[1].qpos, rtol=0, atol=0.02)


def test_a_walk_under_other_conditions_is_refused():
    """A policy's conditions say when feet are lifted; a load does not matter to them."""
    start, policy = hexmj.draw_starts(1, 3), WithOffsets(Ahead())
    lengths = replace(hexmj.STICK_INSECT.lengths, largest_tip_offset=1.0)
    for other in (
        Conditions(step_height=8.0),
        Conditions(vp=40.0),
        Conditions(body=replace(hexmj.STICK_INSECT, lengths=lengths)),
    ):
        with pytest.raises(InputError):
            hexmj.physical_walk(start, policy, 0.3, 1.0, conditions=other)
        with pytest.raises(InputError):
            StickInsect(controller=policy, conditions=other).reset(seed=0)
        with pytest.raises(InputError):
            outer = WithOffsets(Ahead(), controller=policy, conditions=other)
            hexmj.physical_walk(start, outer, 0.3, 1.0, conditions=other)
    hexmj.physical_walk(start, policy, 0.3, 1.0, conditions=Conditions(load=1.0))


@pytest.mark.parametrize("answer", [np.zeros((18, 2)), np.zeros((1, 36)), np.full((2, 18), np.nan)])
def test_a_bad_answer_of_a_policy_is_refused(answer):
    with pytest.raises(InputError, match="policy"):
        hexmj.walk(STARTS[:2], WithOffsets(lambda felt: answer), 0.5, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "learned"), [("train_cma", "REFLEXES"), ("train_ppo", "RIGHTING")])
def test_what_was_learned_passes_the_interface_checks(example, name, learned):
    check_controller(vars(example(name))[learned])


def test_a_policy_senses_the_same_in_a_walk_as_in_the_environment(example, monkeypatch):
    """So it walks nearly alike; in a walk an offset grows over a step, in the environment it changes at once."""
    received, controller = [], some_reflexes(example("train_cma"))
    step = OffsetPlan._step

    def recorded(plan: OffsetPlan):
        if plan._sensed.all():
            received.append(plan._felt.copy())
        return step(plan)

    monkeypatch.setattr(OffsetPlan, "_step", recorded)
    walked = hexmj.physical_walk(hexmj.draw_starts(1, 0), controller, 0.3, 10.0)
    walking = StickInsect(actions="tips", velocity=0.3)
    observed = walking.reset(seed=0)[0]
    sensed = felt_in({name: values[None] for name, values in observed.items()})
    assert sensed.shape == (1, FELT) and np.array_equal(felt_in(observed), sensed[0])
    np.testing.assert_allclose(received[0], sensed, rtol=0, atol=1e-9)
    for _ in range(99):
        observed = walking.step(controller.policy(felt_in(observed)[None])[0])[0]
    assert np.abs(walking.data.qpos - walked.qpos[98, 0]).max() < 0.5


def test_a_larger_body_senses_the_same():
    """Lengths and velocities scale with it, angles and contacts do not."""
    draw, insect = np.random.default_rng(0), hexmj.STICK_INSECT
    tilt, velocity, turning, contact, stance, tips = (draw.normal(size=(5, n)) for n in (2, 3, 3, 6, 6, 18))
    large = replace(insect, standing_height=4 * insect.standing_height)
    scaled = felt(large, tilt, 80 * velocity, turning, contact, stance, 40 * tips)
    np.testing.assert_array_equal(scaled, felt(insect, tilt, 20 * velocity, turning, contact, stance, 10 * tips))
    assert np.abs(felt(insect, tilt, 1e4 * velocity, turning, contact, stance, 1e4 * tips)).max() == MOST


def test_a_kinematic_walk_is_upright_at_the_commanded_velocity():
    plan = WithOffsets(Ahead()).begin(np.zeros((2, 6)), np.array([0.5, 0.2]), hexmj.Stride())
    upright = plan._upright(np.array([0.5, 0.2]))  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(upright[:, VELOCITY] * 50.0, [[40.0, 0.0, 0.0], [16.0, 0.0, 0.0]])
    assert np.abs(upright[:, TIPS]).max() < 5.0


def test_the_policy_of_ppo_is_mirror_symmetric(example):
    policy, sensed = example("train_ppo").RIGHTING.policy, np.random.default_rng(0).normal(size=(3, FELT))
    assert np.abs(policy(sensed)).max() > 0.1
    mirrored = sensed.copy()
    mirrored[:, [1, 5, 7]] *= -1.0  # lean to the left, and turning about the axes ahead and up
    legs = policy(sensed).reshape(3, 2, 3, 3)[:, ::-1] * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(policy(mirrored), legs.reshape(3, 18), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_cma_trains(example, monkeypatch, capsys):
    module = example("train_cma")
    for name, small in {"POPULATION": 4, "STARTS": 2, "GENERATIONS": 2, "DURATION": 5.0, "FRESH": 3}.items():
        monkeypatch.setattr(module, name, small)
    module.main()
    assert "reflexes: physical FLSS" in capsys.readouterr().out
    assert np.any(np.array(module.found().policy.weights) != 0.0)


@pytest.mark.slow
def test_ppo_trains(example, monkeypatch, capsys):
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    module = example("train_ppo")
    for name, small in {"INSECTS": 4, "ROLLOUTS": 2, "HELD": 10, "DURATION": 5.0, "STARTS": 3}.items():
        monkeypatch.setattr(module, name, small)
    module.main()
    printed = capsys.readouterr().out
    assert "16 actions" in printed and "righting: " in printed
    assert module.found().policy != module.Righting()


@pytest.fixture
def insects():
    """The interface of stable-baselines3; tests of it are skipped without it."""
    pytest.importorskip("stable_baselines3", exc_type=ImportError)
    return importlib.import_module("hexmj.environments.stable_baselines")


@pytest.mark.slow
def test_attributes_and_methods_are_those_of_all_insects(insects):
    felt_insects = insects.FeltInsects(3)
    assert len(felt_insects.env_method("reset")) == len(felt_insects.get_attr("task")) == 3


def test_without_stable_baselines_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "hexmj.environments.stable_baselines", raising=False)
    with pytest.raises(InputError, match=r"\[rl\]"):
        importlib.import_module("hexmj.environments.stable_baselines")
