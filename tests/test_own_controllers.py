"""The examples' controllers: interface, both measures, and bodies that follow the plan."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj.controllers import Sensed, Step, stepwise
from hexmj.controllers.conformance import check_controller
from hexmj.gaits import CYCLES, steady_state_gait
from hexmj.measures.physical import PhysicalWalk
from hexmj.physics.rollout import drive
from hexmj.physics.settle import settle
from hexmj.search.problems import Sample
from hexmj.walks import PlannedWalk
from tiers import few_of

EXAMPLES = Path(__file__).parents[1] / "examples"
OWN = {
    "tripod": f"{EXAMPLES / 'tripod.py'}:Tripod",
    "feeler": f"{EXAMPLES / 'contact_controller.py'}:Feeler",
}
STRIDE = hexmj.Stride()


@pytest.fixture(scope="module", params=few_of(OWN, "feeler"))
def own(request):
    """A controller from a file outside the package."""
    return hexmj.load_controller(OWN[request.param])


@pytest.mark.slow
def test_it_keeps_the_protocol(own):
    check_controller(own)


@pytest.mark.slow
def test_both_measures_beside_ldvs(own):
    """At V = 0.4 each of them loses less than LDVS in kinematic walks, and no more of them fall."""
    table = hexmj.flss(own, [0.1, 0.4], n_starts=200)
    papers = hexmj.flss(hexmj.LDVS, [0.1, 0.4], n_starts=200)
    assert (table.flss <= papers.flss).all()
    assert table.flss[1] < papers.flss[1] - 0.1
    both = hexmj.compare({"own": own, "ldvs": hexmj.LDVS}, [0.4], n_starts=12, observation_time=80.0)
    kinematic, physical = both.kinematic.values[:, 0], both.physical.values[:, 0]
    assert kinematic[0] <= kinematic[1]
    assert physical[0] <= physical[1]
    assert both.tracking.sel(controller="own").max() < 3.0
    assert both.speed.sel(controller="own").min() > 0.8
    alone = hexmj.physical_flss(own, [0.4], n_starts=12, observation_time=80.0)
    assert alone.flss.item() == physical[0]
    assert hexmj.settings(alone)["controllers"][own.name]["name"] == own.name


@pytest.mark.slow
def test_oscillators_reach_the_tripod():
    found = steady_state_gait(
        hexmj.load_controller(OWN["tripod"]), 0.5, n_starts=20, stride=STRIDE, periods=CYCLES + 10
    )
    assert found.periodic.all()
    assert found.stable.all()
    assert found.phase == pytest.approx(np.full((20, 7), 0.5), abs=0.01)
    assert found.duty_factor == pytest.approx(np.full((20, 6), 1 / 1.5), abs=0.01)


@pytest.mark.slow
def test_a_swing_ends_where_the_foot_meets_the_ground():
    """On a step of 3 mm, which the plan knows nothing of, feet come to stand higher, and the paper's plan does not."""
    feeler, starts = hexmj.load_controller(OWN["feeler"]), hexmj.draw_starts(6, 0)
    ground = hexmj.Conditions(ground="step", ground_height=3.0)
    settled = settle(starts, ground, STRIDE)
    begun = feeler.begin(starts, np.full(6, 0.5), STRIDE)
    plans = [chunk.plan for chunk in drive(settled, begun, 120.0)]
    height, stance = (np.concatenate([getattr(part, name) for part in plans]) for name in ("height", "stance"))
    lands = stance[1:] & ~stance[:-1]
    assert (height[1:][lands] > 2.0).any(axis=0).any()
    paper = hexmj.walk(starts, feeler, 0.5, 120.0)
    assert (paper.height[1:][paper.stance[1:] & ~paper.stance[:-1]] <= 0.0).all()
    assert np.array_equal(paper.x[0], plans[0].x[0])
    assert not np.array_equal(paper.stance, stance)


def test_a_foot_that_loses_the_ground_searches():
    """If a standing foot has no contact, the plan lowers it as deep as it may."""
    feeler, starts = hexmj.load_controller(OWN["feeler"]), np.zeros((2, 6))
    plan = feeler.begin(starts, np.full(2, 0.1), STRIDE)
    contact = np.ones((1, 6), dtype=bool)
    contact[0, 4] = False
    heights = []
    for _ in range(40):
        plan.sense(sensed_contact(contact))  # pyright: ignore[reportAttributeAccessIssue]
        heights.append(plan.advance(1).height[0, :, 4])
    mine, other = np.transpose(heights)
    assert mine[0] == pytest.approx(-0.2)
    assert mine[-1] == -4.0
    assert (np.diff(mine) <= 0).all()
    assert (other == 0.0).all()


def sensed_contact(contact: np.ndarray) -> Sensed:
    """What start 0 knows, of which only contact matters."""
    none = np.zeros((1, 6))
    return Sensed(
        ids=np.array([0]), tips=np.zeros((1, 6, 3)), contact=contact, gained=none, lost=none, load=none,
        joints=np.zeros((1, 6, 3)), torques=np.zeros((1, 6, 3)), tilt=np.zeros((1, 2)), velocity=np.zeros((1, 3)),
        turning=np.zeros((1, 3)),
    )  # fmt: skip


Change = Callable[[PlannedWalk, int], dict[str, np.ndarray]]


@dataclass(frozen=True)
class Changed:
    """LDVS, its steps changed by a function of them and of the number of steps; keeps where the tips were sensed."""

    change: Change
    tips: list[np.ndarray] = field(default_factory=list)
    name: str = "changed"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        inner = hexmj.LDVS.begin(starts, velocity, stride, acceleration)

        def step(v):
            walk = inner.advance(1)
            return Step(**({"x": walk.x[0], "stance": walk.stance[0]} | self.change(walk, inner.done)))

        return stepwise(step, starts, velocity, stride, acceleration, lambda sensed: self.tips.append(sensed.tips))


def walked_by(change: Change) -> tuple[PhysicalWalk, np.ndarray]:
    """A physical walk, and where its tips were before each step, (step, start, leg, 3) [mm]."""
    controller = Changed(change)
    walked = hexmj.physical_walk(hexmj.draw_starts(2, 0), controller, 0.3, 60.0)
    return walked, np.array(controller.tips)


@pytest.fixture(scope="module")
def unchanged():
    return walked_by(lambda walk, _: {})


def test_a_plan_that_is_told_and_does_not_listen_walks_as_ldvs(unchanged):
    usual = hexmj.physical_walk(hexmj.draw_starts(2, 0), hexmj.LDVS, 0.3, 60.0)
    assert np.array_equal(unchanged[0].qpos, usual.qpos)


def test_tips_beside_their_lines_are_honoured(unchanged):
    """Feet 30 % farther from the body axis: in the plan, in the recording, in the targets and under the body."""
    walked, tips = walked_by(lambda walk, done: {"y": walk.y[0] * (1.0 + 0.3 * min(1.0, done / 200))})
    line, late = np.array(STRIDE.geometry.y), slice(250, None)
    assert not np.array_equal(walked.qpos, unchanged[0].qpos)
    assert np.isinf(walked.outcomes.fall).all()
    recording = hexmj.record(walked)
    assert recording.planned_y.values[late] == pytest.approx(np.broadcast_to(1.3 * line, (350, 6)))
    assert tips[late, ..., 1] == pytest.approx(np.broadcast_to(1.3 * line, (350, 2, 6)), abs=1.5)
    assert unchanged[1][late, ..., 1] == pytest.approx(np.broadcast_to(line, (350, 2, 6)), abs=1.5)
    puppet = hexmj.record_plan(walked.planned, walked.conditions, STRIDE)
    beside = puppet.planned_tip.values[..., 1] - puppet.qpos.values[:, None, 1]
    assert beside == pytest.approx(puppet.planned_y.values)


def test_heights_are_honoured(unchanged):
    """A swinging foot is lifted to 5 mm, as the plan prescribes, not to the body's 12 mm; none is lowered early."""
    walked, tips = walked_by(lambda walk, _: {"height": np.where(walk.stance[0], 0.0, 5.0)})
    assert not np.array_equal(walked.qpos, unchanged[0].qpos)
    swings = ~walked.planned.stance
    swung = swings[2:-1] & swings[1:-2] & swings[:-3]  # for three steps, as sensed after them
    height = tips[3:, ..., 2] + walked.conditions.standing_height
    assert np.median(height[swung]) == pytest.approx(5.0, abs=0.5)
    assert height[swung].max() < 6.0
    usual = unchanged[1][3:, ..., 2] + walked.conditions.standing_height
    assert usual[swung].max() > 11.0
    puppet = hexmj.record_plan(walked.planned, walked.conditions, STRIDE)
    up = puppet.planned_tip.values[..., 2] - puppet.qpos.values[:, None, 2]
    foot = up[walked.planned.stance[:, 0]].max()
    assert up == pytest.approx(np.where(walked.planned.stance[:, 0], foot, foot + 5.0))


@dataclass(frozen=True)
class Far:
    """All tips stand at x."""

    x: float = 1e6
    name: str = "far"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        return stepwise(lambda v: Step(self.x, True), starts, velocity, stride, acceleration)


def test_a_walk_whose_tips_no_leg_reaches_is_no_outcome():
    with pytest.raises(hexmj.InputError, match="reach"):
        hexmj.physical_flss(Far(), [0.5], n_starts=2, observation_time=5.0)
    problem = hexmj.Problem(hexmj.FieldsForm(Far()), 0.5, 0.5, observation_time=5.0, measure="physical")
    assert Sample(problem, 2, 0).costs(np.array([[1e6], [5.0]])).tolist() == [1.0, 0.0]
