"""With zero offsets an episode is the physical walk, to the last bit; and the same seed is the same episode."""

import numpy as np
import pytest

from episodes import KINDS, ZEROS, episode, run_steps
from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import begin
from hexmj.controllers.cruse1998 import HWS, LDVS
from hexmj.controllers.protocol import Controller
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.environments import dm
from hexmj.legs import CENTRED, FIG1
from hexmj.measures.physical import physical_walk
from hexmj.physics.drive import drive
from hexmj.physics.settling import settle
from hexmj.stability import walk_margin
from hexmj.starts import draw_starts
from hexmj.timing import Stride


@pytest.mark.parametrize("velocity", [0.3, 0.5])
def test_zero_offsets_are_the_physical_walk_to_the_last_bit(velocity: float):
    """Until the end or the fall, which is seen at the end of its step."""
    starts, duration = draw_starts(2, 0), 100.0
    walked = physical_walk(starts, LDVS, velocity, duration)
    settled, m = settle(starts), Conditions().substeps(Stride())
    standing = np.zeros((2, 1000 * m + 1, 6), dtype=bool)
    for chunk in drive(settled, begin(LDVS, settled.starts, velocity, settled.stride), duration):
        standing[chunk.ids, chunk.first : chunk.first + chunk.standing.shape[1]] = chunk.standing
    margins = walk_margin(walked.measured)
    walking = dm.load(velocity, actions="tips", duration=duration)
    physics = walking.physics
    for start in range(2):
        qpos, seen = [], []
        step = walking.reset()
        while not step.last():
            step = walking.step(ZEROS)
            qpos.append(physics.position())
            seen.append(step.observation)
        count = len(qpos) - int(step.discount == 0)
        np.testing.assert_array_equal(qpos[:count], walked.qpos[:count, start])
        planned = walked.planned
        np.testing.assert_array_equal([o["planned_stance"] for o in seen], planned.stance[: len(seen), start])
        tips = np.array([o["planned_tips"] for o in seen])
        np.testing.assert_allclose(tips[..., :2], planned.feet[: len(seen), start], rtol=0, atol=1e-12)
        contact = np.array([o["contact"] for o in seen])[:count]
        np.testing.assert_array_equal(contact, standing[start, m - 1 : m * count : m])
        same = (contact == walked.measured.stance[:count, start]).all(axis=1)
        assert same.mean() > 0.95
        margin = np.array([o["margin"][0] for o in seen])[:count]
        np.testing.assert_allclose(margin[same], margins[:count, start][same], rtol=0, atol=1e-9)
        assert sum(o["out_of_reach"].sum() for o in seen) == walked.outcomes.unreachable[start]
        fall = walked.outcomes.fall[start]
        assert step.discount == float(np.isinf(fall))
        assert len(qpos) == (1000 if np.isinf(fall) else np.ceil(fall / Stride().dt - 1e-6))
    assert np.isinf(walked.outcomes.fall).all() == (velocity == 0.3)


@pytest.mark.parametrize(
    ("controller", "conditions", "stride"),
    [
        (HWS, Conditions(vp=200.0, friction=0.5), Stride()),
        (HWS, Conditions(vp=40.0, standing_height=12.0), Stride(dt=0.5, geometry=CENTRED)),
        (SensoryFeedback(LDVS), Conditions(), Stride()),
        (SensoryFeedback(HWS), Conditions(vp=160.0, grasp=0.5, load=0.5), Stride(dt=0.2)),
    ],
    ids=["slippery", "slow and centred", "reads the legs", "reads the legs, loaded"],
)
def test_other_controllers_and_conditions_are_those_of_the_physical_walk(
    controller: Controller, conditions: Conditions, stride: Stride
):
    """To the last bit, and until the fall; a controller that reads the legs is told the same."""
    walked = physical_walk(draw_starts(1, 7, stride), controller, 0.3, 40.0, conditions=conditions, stride=stride)
    walking = dm.load(
        0.3, actions="tips", controller=controller, conditions=conditions, stride=stride, duration=40.0, seed=7
    )
    step, qpos = walking.reset(), []
    while not step.last():
        step = walking.step(ZEROS)
        qpos.append(walking.physics.position())
    assert np.isinf(walked.outcomes.fall[0])
    np.testing.assert_array_equal(qpos, walked.qpos[:, 0])
    assert len(qpos) == round(40.0 / stride.dt)


def test_what_is_read_from_the_legs_is_felt():
    """Or the test above would notice nothing."""
    seen = []
    for controller in (LDVS, SensoryFeedback(LDVS)):
        walking = dm.load(0.3, actions="tips", controller=controller, duration=40.0, seed=7)
        run_steps(walking, 300)
        seen.append(walking.physics.position())
    assert (seen[0] != seen[1]).all()


def test_rows_of_control_are_taken_one_after_the_other():
    """However many substeps are taken at once; the last row stays."""
    walking = dm.load(actions="joints", duration=5.0)
    walking.reset()
    one, rows = walking.physics, np.linspace(0.0, 0.3, 3)[:, None] + walking.physics.control()
    other = one.copy()
    one.set_control(rows)
    other.set_control(rows)
    one.step(4)
    for _ in range(4):
        other.step()
    np.testing.assert_array_equal(one.control(), rows[2])
    np.testing.assert_allclose(other.position(), one.position(), rtol=0, atol=1e-12)


@KINDS
def test_same_seed_same_bits(actions):
    def episodes(seed: int) -> list[np.ndarray]:
        walking = dm.load(actions=actions, duration=3.0, seed=seed)
        bits = []
        for _ in range(2):
            action = ZEROS if actions == "tips" else walking.reset().observation["joint_angles"]
            bits += [value for step in episode(walking, action) for value in step.observation.values()]
        return bits

    first, second, other = episodes(3), episodes(3), episodes(4)
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
    assert not all(np.array_equal(a, b) for a, b in zip(first, other, strict=True))


def test_episodes_take_the_drawn_starts_one_after_the_other():
    walking = dm.load(seed=5)
    tips = np.array([walking.reset().observation["planned_tips"] for _ in range(18)])
    np.testing.assert_allclose(tips[..., 0] - FIG1.origin, draw_starts(18, 5), atol=1e-12)
