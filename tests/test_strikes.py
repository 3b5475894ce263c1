"""Feet never sink in: steps in which one strikes the ground are taken finely, and no others."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller
from hexmj.measures.physical import outcomes_of_plan
from hexmj.physics import substeps as fine_steps
from hexmj.physics.engine import Diverged, Engine, Rolled
from hexmj.physics.outcomes import Outcomes
from hexmj.physics.pushes import Push
from hexmj.physics.rollout import Chunk, drive
from hexmj.physics.settle import Settled, settle
from hexmj.physics.substeps import FINER, FINEST, FineSteps, in_whole_steps, strikes
from hexmj.starts import draw_starts
from tiers import few_of

OBSTACLES = {
    ground: Conditions(ground=ground, ground_at=45.0, ground_length=8.0, ground_height=4.0)
    for ground in ("flat", "step", "gap", "hurdle", "rough")
}
CONDITIONS: dict[str, Conditions] = {
    **OBSTACLES,
    "slow": Conditions(vp=20.0),
    "fast": Conditions(vp=400.0),
    "hard landing": Conditions(lift_time=1.0, landing_time=1.0),
    "low": Conditions(standing_height=7.0),
    "closed loop": Conditions(),
}
FAR = 10.0
"""Depth from which on the nearest side of an obstacle may be one that only MuJoCo knows, as its lower one [mm]."""
PUSH = 60.0
"""In multiples of m V_p, as `disturb` has it: the insect slides and tips at up to 4.8 m/s."""


def walked(settled: Settled, velocity: float = 0.6) -> list[Chunk]:
    """80 time units; an obstacle is reached after 7 mm."""
    return list(drive(settled, begin(LDVS, settled.starts, velocity, settled.stride), 80.0))


def outcomes(
    settled: Settled, push: float = 0.0, threads: int | None = None, controller: Controller = LDVS
) -> Outcomes:
    """Of the same walks, or longer ones, pushed aside at 20 time units by a multiple of m V_p."""
    size = len(settled.starts)
    pushed = Push(np.full(size, push * STICK_INSECT.mass * settled.conditions.vp), np.full(size, 20.0))
    plan = begin(controller, settled.starts, 0.6, settled.stride)
    return outcomes_of_plan(
        settled, plan, 130.0 if push else 80.0, np.full(size, np.inf), pushes=[pushed], threads=threads
    )


def allowed(settled: Settled) -> float:
    """How deep a foot may be: 2 % of the standing height [mm]."""
    return 0.02 * settled.conditions.standing_height


def never_finely(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on no foot is ever too deep."""
    monkeypatch.setattr(fine_steps, "SINK", np.inf)


@pytest.mark.parametrize("ground", OBSTACLES)
def test_depth_is_that_of_mujocos_contacts(ground):
    """The insect in random postures among the obstacles, turned and tilted; a foot without contact is above ground."""
    compiled, rng = compile_body(OBSTACLES[ground]), np.random.default_rng(0)
    model, data = compiled.model, mujoco.MjData(compiled.model)
    geoms = [model.geom(foot).id for foot in STICK_INSECT.feet]
    in_contact = 0
    for _ in range(400):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[:3] += rng.uniform((30.0, -30.0, -2.0), (80.0, 30.0, 5.0))
        data.qpos[3:] += 0.1 * rng.normal(size=22)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        found = np.zeros(6)
        for contact in data.contact:
            for leg in (geoms.index(geom) for geom in contact.geom if geom in geoms):
                found[leg] = max(found[leg], -contact.dist)
        in_contact += (found > 0).sum()
        depth = np.maximum(compiled.depth(data.geom_xpos[geoms]), 0.0)
        far = (depth > FAR) & (found > FAR)
        assert_allclose(depth[~far], found[~far], atol=1e-6)
    assert in_contact > 200


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(CONDITIONS, "step", "fast", "hard landing"))
def test_feet_never_sink_in(name, monkeypatch):
    """By 2 % of the standing height, wherever and however fast the insect walks, until it has fallen."""
    controller = SensoryFeedback(LDVS) if name == "closed loop" else LDVS
    settled = settle(draw_starts(16, 4), CONDITIONS[name])
    assert (outcomes(settled, controller=controller).depth <= allowed(settled)).all()
    never_finely(monkeypatch)
    assert outcomes(settled, controller=controller).depth.max() > allowed(settled), "this test would notice nothing"


@pytest.mark.slow
def test_feet_never_sink_in_when_the_insect_is_pushed_off_them(monkeypatch):
    settled = settle(draw_starts(16, 4))
    assert (outcomes(settled, PUSH).depth <= allowed(settled)).all()
    never_finely(monkeypatch)
    assert outcomes(settled, PUSH).depth.max() > 5 * allowed(settled), "this test would notice nothing"


@pytest.mark.slow
def test_fine_steps_depend_on_nothing_but_their_own_insect():
    """Pushed, so that nearly all take some: the same bits with one thread, and among fewer."""
    settled, few = settle(draw_starts(16, 4)), settle(draw_starts(16, 4)[5:9])
    one, two, part = outcomes(settled, PUSH, threads=1), outcomes(settled, PUSH, threads=2), outcomes(few, PUSH)
    for name in Outcomes.__dataclass_fields__:
        assert_array_equal(getattr(one, name), getattr(two, name))
        assert_array_equal(getattr(one, name)[5:9], getattr(part, name))


def test_a_dropped_insect_rebounds_as_from_fine_steps_and_hard_contacts_throughout(monkeypatch):
    """Dividing only the steps that strike neither adds energy nor takes it: within 2 %, from 50 mm.

    Measured: 16.2 mm, 16.3 mm with fine steps throughout, 17.3 mm with the usual steps alone.
    """
    usual, fine = (settle(draw_starts(12, 4), Conditions(longest_substep=ms)) for ms in (0.625, 0.15625))
    fine.compiled.model.pair_solref[:, 0] = 2 * fine.compiled.model.opt.timestep
    struck, reference = rebound(usual), rebound(fine)
    assert struck == pytest.approx(reference, rel=0.02)
    never_finely(monkeypatch)
    assert rebound(usual) != pytest.approx(reference, rel=0.02), "this test would notice nothing"


def rebound(settled: Settled) -> float:
    """Mean height to which the root comes back after a drop from 50 mm [mm]."""
    settled.qpos[:, 2] += 50.0
    heights = np.full((len(settled.starts), 0), np.nan)
    for one in drive(settled, begin(LDVS, settled.starts, 0.0, settled.stride), 24.0):
        shown = np.full((len(heights), one.qpos.shape[1]), np.nan)
        shown[one.ids] = np.where(np.arange(shown.shape[1]) < one.valid[:, None], one.qpos[:, :, 2], np.nan)
        heights = np.concatenate([heights, shown], axis=1)
    settled.qpos[:, 2] -= 50.0
    landing = round(0.2 / settled.compiled.model.opt.timestep)
    lowest = np.nanargmin(heights[:, :landing], axis=1)
    return float(np.mean([np.nanmax(one[i:]) for one, i in zip(heights, lowest, strict=True)]))


def test_nobody_else_takes_fine_steps(monkeypatch):
    """Insects walk by the usual steps, to the last bit, until the first in which a foot would strike the ground."""
    settled = settle(draw_starts(24, 4))
    fine = walked(settled, 0.4)
    never_finely(monkeypatch)
    usual = walked(settled, 0.4)
    monkeypatch.undo()
    columns, m = settled.compiled.columns, settled.conditions.substeps(settled.stride)
    parted = 0
    for start in np.intersect1d(fine[-1].ids, usual[-1].ids):
        one, other = (np.concatenate([x.qpos[x.ids == start][0] for x in walk]) for walk in (fine, usual))
        feet = np.concatenate([x.sensors[x.ids == start][0][:, columns.foot] for x in usual]).reshape(-1, 6, 3)
        depth = settled.compiled.depth(feet)
        struck = strikes(depth[np.newaxis], m, allowed(settled))[0]
        first = np.argmax(struck) // m * m + 1 if struck.any() else len(one)
        assert_array_equal(one[:first], other[:first])
        assert not struck.any() or (one[first] != other[first]).any()
        parted += struck.any()
    assert 0 < parted < 24


@pytest.mark.parametrize(
    ("moves", "struck"),
    [
        ((-1.0, -1.0, -1.0, -1.0, -1.0), (0, 0, 0, 0)),
        ((-1.0, -1.0, -1.0, 0.2, -1.0), (0, 0, 0, 0)),
        ((-1.0, -1.0, -1.0, 0.21, -1.0), (0, 0, 1, 0)),
        ((-1.0, -1.0, -1.0, -0.3, -0.04), (0, 0, 0, 1)),  # above ground, on at its speed
        ((-0.3, -0.04, -0.04, -0.04, -0.04), (0, 0, 0, 0)),  # not asked in the middle of a step of the network
        ((-1.0, -1.0, -1.0, 0.05, 0.16), (0, 0, 0, 1)),  # in the ground, on at half its speed
        ((-1.0, -1.0, -1.0, 0.13, 0.17), (0, 0, 0, 0)),
    ],
)
def test_a_step_is_fine_if_a_foot_is_too_deep_or_will_be_right_after_it(moves, struck):
    depth = np.full((2, 5, 6), -1.0)  # (start, 1 + step, leg); the limit is 0.2 mm
    depth[1, :, 4] = moves
    assert_array_equal(strikes(depth, 2, 0.2), [4 * (False,), struck])


def test_forces_of_a_fine_step_are_means():
    sensors = np.arange(24.0).reshape(8, 3)  # (part, column)
    assert_array_equal(in_whole_steps(sensors, 4, np.array([1])), [[0.0, 5.5, 2.0], [12.0, 17.5, 14.0]])


class PointMasses:
    """An `Engine` of its own: feet that fall freely, on ground of any depth, with one number to control each body.

    Their state is height and speed.  A control above 0 stops them at that height.
    """

    GRAVITY, STEP = -9810.0, 0.001  # mm/s^2, s

    def __init__(self, height: np.ndarray, speed: np.ndarray) -> None:
        self.now = np.stack([height, speed], axis=1)
        self.rolled: list[tuple[list[int], int, int]] = []

    def put(self, ids: np.ndarray, states: np.ndarray) -> None:
        self.now[ids] = states

    def roll(self, ids: np.ndarray, control: np.ndarray, parts: int = 1) -> Rolled:
        """Contact acts once a part has begun in the ground: what is there is put to its floor, and stays."""
        self.rolled.append((ids.tolist(), control.shape[1], parts))
        step, before = self.STEP / parts, self.now[ids].copy()
        feet, after, sensors = [self._feet(ids)], [], []
        for column in control.swapaxes(0, 1):
            height, speed = self.now[ids].T
            stands = height <= 0.0
            sensors.append(np.stack([np.full(len(ids), float(parts)), stands], axis=1))
            if (column < 0).any():
                raise Diverged(int(ids[np.argmax(column[:, 0] < 0)]), "told to", {})
            speed = np.where(stands, 0.0, speed + self.GRAVITY * step)
            self.now[ids] = np.stack([np.where(stands, 0.0, height + speed * step), speed], axis=1)
            feet.append(self._feet(ids))
            after.append(self.now[ids])
        rows = np.array(after).swapaxes(0, 1)
        seen = np.array(sensors).swapaxes(0, 1)
        return Rolled(before, np.array(feet).swapaxes(0, 1), seen, control.copy(), seen[:, :, 1:], rows)

    def _feet(self, ids: np.ndarray) -> np.ndarray:
        feet = np.full((len(ids), 6, 3), 100.0)
        feet[:, 3, 2] = self.now[ids, 0]
        return feet


def falling(speed: list[float], steps: int = 8, control: float = 0.0) -> tuple[PointMasses, dict[str, np.ndarray]]:
    """Bodies that begin 1 mm up, and what 8 physics steps show of them; two of these are one of the plan."""
    engine = PointMasses(np.ones(len(speed)), np.array(speed))
    loop = FineSteps(engine, 2, lambda feet: -feet[..., 2], 0.02, np.array([1]))
    return engine, loop.take(np.arange(len(speed)), np.full((len(speed), steps, 1), control))


def test_any_engine_takes_strikes_again_finely():
    """Masses that fall fast are taken again in parts, as many as it takes; the others by usual steps alone."""
    engine, shown = falling([0.0, -400.0, 5000.0, -2130.0])
    _: Engine = engine
    assert_array_equal(engine.now[[1, 3]], 0.0)  # they lie on the ground
    assert engine.rolled == [
        ([0, 1, 2, 3], 8, 1),
        ([1, 3], 8, FINER),  # one strikes, and one would right after this step of the plan
        ([3], 32, FINER**2),
        ([3], 128, FINEST),
        ([1, 3], 6, 1),
        ([1], 8, FINER),  # now it strikes
        ([1], 32, FINER**2),
        ([1], 4, 1),
    ]
    parts, force = shown["sensors"][:, :, 0], shown["sensors"][:, :, 1]
    assert_array_equal(parts, [8 * [1], [4, 4, 16, 16, 1, 1, 1, 1], 8 * [1], [64, 64, 1, 1, 1, 1, 1, 1]])
    assert_allclose(force[1], [0, 0, 9 / 16, 1, 1, 1, 1, 1])  # means over the parts of a step
    assert_array_equal(shown["torque"][:, :, 0], force)  # so are these
    assert (shown["depth"][:3] <= 0.02).all()
    assert 0.02 < shown["depth"][3].max() <= 2140.0 * PointMasses.STEP / FINEST  # no finer than this
    alone = PointMasses(np.ones(1), np.array([5000.0]))
    assert_array_equal(shown["after"][2], alone.roll(np.array([0]), np.zeros((1, 8, 1)), 1).after[0])


def test_a_body_that_diverges_says_from_which_step_on():
    """That of the roll in which it did, the one that was taken again included."""
    engine = PointMasses(np.ones(2), np.array([0.0, -400.0]))
    loop = FineSteps(engine, 2, lambda feet: -feet[..., 2], 0.02, np.array([1]))
    control = np.zeros((2, 8, 1))
    control[1, 6:] = -1.0
    with pytest.raises(Diverged) as error:
        loop.take(np.arange(2), control)
    assert (error.value.start, error.value.substep) == (1, 0)
