"""Laws of controllers: fast and general losses, plans that are refused, names, feedback on paper, and conformance."""

import itertools
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

import hexmj
from hexmj.controllers import Sensed, Step, named, stepwise
from hexmj.controllers.asking import advanced
from hexmj.controllers.conformance import FIRST, check_controller, findings
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.losses import first_losses, planned_losses
from hexmj.controllers.protocol import Controller, ReadingPlan, settings_of
from hexmj.legs import CENTRED
from hexmj.measures.physical import physical_walk_of_plan
from hexmj.physics.drive import drive
from hexmj.physics.settling import settle
from hexmj.walks import PlannedWalk, part_of

STRIDE = hexmj.Stride()
LDVS = hexmj.LDVS

Change = Callable[[PlannedWalk, int], dict[str, Any]]


@dataclass(frozen=True)
class Own:
    """LDVS by way of `stepwise`, or what a test makes of it."""

    change: Change | None = field(default=None, compare=False)
    name: str = "own"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        inner = LDVS.begin(starts, velocity, stride, acceleration)

        def step(v):
            walk = inner.advance(1)
            changed = self.change(walk, inner.done) if self.change else {}
            return Step(**({"x": walk.x[0], "stance": walk.stance[0]} | changed))

        return stepwise(step, starts, velocity, stride, acceleration)


def same(one: PlannedWalk, other: PlannedWalk) -> bool:
    names = ("time", "velocity", "x", "y", "stance", "aep", "height")
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=name == "height") for name in names)


@pytest.mark.parametrize("order", ["printed", "undelayed", "sequential"])
@pytest.mark.parametrize("name", hexmj.PRESETS)
def test_fast_losses_are_those_of_the_plan(name, order):
    """To the last bit, for every preset and order, with an acceleration and without."""
    controller = replace(hexmj.PRESETS[name], order=order)
    starts, rng = hexmj.draw_starts(70, seed=3), np.random.default_rng(3)
    velocity, steps = rng.uniform(0.1, 0.9, 70), rng.integers(1, 500, 70)
    for acceleration in (None, hexmj.Acceleration(rate=0.05)):
        begin = partial(controller.begin, starts, velocity, STRIDE, acceleration)
        fast, planned = begin().first_losses(steps), planned_losses(begin(), steps)
        assert np.array_equal(fast, planned)
        assert 0 < (fast > 0).sum() < 70


@pytest.mark.parametrize("held", [350, 49])
def test_a_foreign_controller_has_the_same_losses_whatever_is_held_at_a_time(held, monkeypatch):
    """Seven steps, or one, and none beyond what was asked for."""
    starts, velocity, steps = hexmj.draw_starts(50, 0), np.full(50, 0.5), np.full(50, 400)
    whole = first_losses(Own().begin(starts, velocity, STRIDE), steps)
    monkeypatch.setattr("hexmj.controllers.losses.HELD", held)
    plan = Own().begin(starts, velocity, STRIDE)
    assert np.array_equal(first_losses(plan, steps), whole)
    assert (whole == 0).any()
    assert plan.done == 400
    assert np.array_equal(whole, LDVS.begin(starts, velocity, STRIDE).first_losses(steps))
    assert hexmj.flss(Own(), [0.5], n_starts=50).equals(hexmj.flss(LDVS, [0.5], n_starts=50))


@dataclass
class AllStand:
    """A plan in which nothing happens, that keeps how many steps it was asked for each time."""

    starts: np.ndarray
    stride: hexmj.Stride = STRIDE
    done: int = 0
    asked: list[int] = field(default_factory=list)

    def advance(self, steps):
        """See `protocol.Plan`."""
        self.done += steps
        self.asked.append(steps)
        shape = steps, *self.starts.shape
        return PlannedWalk(
            time=np.arange(self.done - steps + 1, self.done + 1) * STRIDE.dt,
            velocity=np.zeros(shape[:2]),
            x=np.broadcast_to(self.starts, shape),
            y=np.broadcast_to(np.array(STRIDE.geometry.y), shape),
            stance=np.ones(shape, dtype=bool),
            aep=np.zeros(shape),
            height=np.zeros(shape),
        )


@pytest.mark.parametrize(("size", "asked"), [(1, [200, 200, 50]), (2000, [200, 200, 50]), (4000, 4 * [100] + [50])])
def test_no_more_is_planned_at_a_time_than_is_to_be_held(size, asked):
    """400,000 steps of a start, and 200 steps."""
    plan = AllStand(np.zeros((size, 6)))
    assert not planned_losses(plan, np.array([450])).any()
    assert plan.asked == asked


def test_a_loss_in_the_last_step_that_is_looked_at_counts():
    starts, velocity = hexmj.draw_starts(40, 4), np.full(40, 0.6)
    lost = planned_losses(LDVS.begin(starts, velocity, STRIDE), np.array([300]))
    late = starts[lost > 1]
    assert len(late) > 10
    for less, expected in ((0, lost[lost > 1]), (1, np.zeros(len(late)))):
        plan = LDVS.begin(late, velocity[lost > 1], STRIDE)
        assert np.array_equal(planned_losses(plan, lost[lost > 1] - less), expected)


def test_a_centre_of_mass_on_the_edge_is_lost():
    """From the third step on L2 and R2, the last that stand, are exactly beside O; then they may be anywhere."""

    def on_the_edge(walk: PlannedWalk, done: int) -> dict[str, Any]:
        middle = {3: -4.0}.get(done, -5.0)
        return {"x": np.array([0.0, middle, 0.0, 0.0, middle, 0.0]), "stance": np.array(2 * [True, True, False])}

    plan = Own(on_the_edge).begin(np.zeros((2, 6)), np.zeros(2), STRIDE)
    assert np.array_equal(planned_losses(plan, np.array([9, 2])), [3, 0])


@pytest.mark.parametrize("steps", [(-1, 0), (0, 11), (0,), (0, np.nan), (0.0, 2.0), (True, False)])
def test_losses_that_make_no_sense_are_refused(steps, monkeypatch):
    plan = LDVS.begin(np.zeros((2, 6)), np.full(2, 0.5), STRIDE)
    monkeypatch.setattr(plan, "first_losses", lambda _: np.array(steps))
    with pytest.raises(hexmj.InputError, match="expected the number of a step, from 0 on, for each start"):
        first_losses(plan, np.array(10))


@pytest.fixture(scope="module")
def settled():
    return settle(hexmj.draw_starts(2, 0))


def plan_of(starts, stride=STRIDE, change=None):
    return Own(change).begin(starts, np.full(len(starts), 0.5), stride)


def advanced_plan(settled):
    plan = plan_of(settled.starts)
    plan.advance(3)
    return plan


class Short:
    """A plan that stops short of what it is asked for."""

    def __init__(self, starts):
        self._plan, self.starts, self.stride, self.done = plan_of(starts), starts, STRIDE, 0

    def advance(self, steps):
        self.done += steps
        return self._plan.advance(max(1, steps - 1))


REFUSED = {
    "other starts": (lambda s: plan_of(s.starts[::-1]), r"the plan is of other starts, \(2, 6\); expected the 2"),
    "too few starts": (lambda s: plan_of(s.starts[:1]), r"the plan is of other starts, \(1, 6\); expected the 2"),
    "another stride": (lambda s: plan_of(s.starts, hexmj.Stride(dt=0.2)), "the plan's stride is Stride"),
    "not at time 0": (advanced_plan, "the plan is at step 3; expected one at time 0"),
    "too few steps": (
        lambda s: Short(s.starts),
        r"asked for 4 steps, and gave \(3, 2, 6\); expected \(4, 2, 6\)",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_plan_that_does_not_fit_is_refused(settled, case):
    make, words = REFUSED[case]
    with pytest.raises(hexmj.InputError, match=words) as refused:
        list(drive(settled, make(settled), 0.4))
    assert "\n" not in str(refused.value)
    planned = hexmj.walk(settled.starts, LDVS, 0.5, 0.4)
    with pytest.raises(hexmj.InputError, match=words):
        physical_walk_of_plan(settled, make(settled), planned)


def test_a_step_is_broadcast_to_starts_and_legs():
    starts = hexmj.draw_starts(3, 0)
    plan = stepwise(lambda v: Step(x=np.zeros((3, 1)), stance=True, y=np.arange(6), aep=4), starts, 0.5, STRIDE)
    walk = plan.advance(2)
    assert walk.x.shape == walk.stance.shape == walk.height.shape == (2, 3, 6)
    assert walk.stance.all()
    assert walk.stance.dtype == bool
    assert (walk.y == np.arange(6)).all()
    assert (walk.aep == 4.0).all()
    assert np.isnan(walk.height).all()
    assert plan.done == 2
    assert not isinstance(plan, ReadingPlan)


def test_what_a_step_leaves_out_is_as_usual():
    walk = plan_of(hexmj.draw_starts(2, 0)).advance(5)
    assert same(walk, hexmj.walk(hexmj.draw_starts(2, 0), LDVS, 0.5, 0.5))


def test_a_step_may_be_worked_on_in_place():
    """What was planned stays as it was."""
    x = np.zeros((1, 6))

    def step(v):
        np.subtract(x, 1.0, out=x)
        return Step(x, True)

    walk = stepwise(step, np.zeros((1, 6)), 0.5, STRIDE).advance(3)
    assert np.array_equal(walk.x[:, 0, 0], [-1.0, -2.0, -3.0])


def test_a_stepwise_plan_hears_what_it_is_told():
    told = []
    plan = stepwise(lambda v: Step(0.0, True), np.zeros((1, 6)), 0.5, STRIDE, sense=told.append)
    assert isinstance(plan, ReadingPlan)
    sensed: Any = object()
    plan.sense(sensed)
    assert told == [sensed]


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (Step(np.zeros((2, 6)), True), r"x of a step has the shape \(2, 6\); expected \(start, leg\), \(3, 6\)"),
        (Step(0.0, np.ones(5, dtype=bool)), r"stance of a step has the shape \(5,\)"),
        (Step(0.0, 1.0), "stance of a step is of type float64; expected booleans"),
        (Step(True, True), "x of a step is of type bool; expected numbers"),
        (Step(None, True), "x of a step is of type object; expected numbers"),  # pyright: ignore[reportArgumentType]
        (Step(0.0, True, height="high"), "height of a step is of type"),  # pyright: ignore[reportArgumentType]
        (Step([[0.0], [0.0, 1.0]], True), "x of a step is .* expected one array"),  # pyright: ignore[reportArgumentType]
        ((0.0, True), r"a step gave \(0.0, True\); expected a Step"),
    ],
)
def test_a_step_that_makes_no_sense(step, words):
    plan = stepwise(lambda v: step, np.zeros((3, 6)), 0.5, STRIDE)
    with pytest.raises(hexmj.InputError, match=words):
        plan.advance(1)


def test_stepwise_checks_what_it_begins_with():
    with pytest.raises(hexmj.InputError, match="step range"):
        plan_of(np.full((1, 6), 50.0))
    with pytest.raises(hexmj.InputError, match="steps = 0"):
        plan_of(np.zeros((1, 6))).advance(0)


MINE = '''
from dataclasses import dataclass
import numpy as np
from hexmj.controllers import Step, stepwise

@dataclass(frozen=True)
class Still:
    """Stands."""
    name: str = "still"
    height: float = 0.0

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        return stepwise(lambda v: Step(starts, True), starts, velocity, stride, acceleration)

@dataclass(frozen=True)
class Needy(Still):
    legs: int = None

    def __post_init__(self):
        if self.legs is None:
            raise ValueError("legs is missing")

taller = Still("taller", 3.0)
number = 6
'''


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A file of a user's own, which is also a module."""
    path = tmp_path / "mine_of_a_user.py"
    path.write_text(MINE)
    (tmp_path / "broken.py").write_text("import nothing_of_this_name\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield path
    sys.modules.pop("mine_of_a_user", None)


def test_controllers_by_name(mine, tmp_path, monkeypatch):
    assert hexmj.load_controller("ldvs") is LDVS
    (tmp_path / "set.toml").write_text(network_toml(hexmj.HWS))
    assert hexmj.load_controller("set.toml") == replace(hexmj.HWS, name="set")
    for where in (mine.name, str(mine), "mine_of_a_user"):
        assert settings_of(hexmj.load_controller(f"{where}:Still")) == {"name": "still", "height": 0.0}
        assert settings_of(hexmj.load_controller(f"{where}:taller")) == {"name": "taller", "height": 3.0}
    point = EntryPoint("robot", "mine_of_a_user:taller", named.ENTRY_POINTS)
    monkeypatch.setattr(named, "entry_points", lambda name="robot", **_: [point] if name == "robot" else [])
    assert hexmj.load_controller("robot").name == "taller"
    assert "robot" in named.known_names()
    (tmp_path / "tall.toml").write_text('controller = "robot"\n[fields]\nheight = 4.0\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "taller", "height": 4.0}


def test_a_file_may_name_a_controller_and_its_fields(mine, tmp_path):
    path = tmp_path / "tall.toml"
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4.0\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "still", "height": 4.0}
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = 4\n')
    assert repr(settings_of(hexmj.load_controller("tall.toml"))["height"]) == "4.0", "the same setting"
    path.write_text('controller = "mine_of_a_user.py:Still"\n')
    assert settings_of(hexmj.load_controller("tall.toml")) == {"name": "still", "height": 0.0}
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nheight = "4.0"\n')
    with pytest.raises(hexmj.InputError, match=r"\[fields\]: height = '4.0'; expected a number"):
        hexmj.load_controller("tall.toml")
    path.write_text('controller = "mine_of_a_user.py:Still"\n[fields]\nwidth = 4.0\n')
    with pytest.raises(hexmj.InputError, match=r"width.*expected fields of mine_of_a_user.py:Still"):
        hexmj.load_controller("tall.toml")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("lvds", "controller 'lvds' is neither one of hws, ldvs, uncoordinated, .* nor a TOML file"),
        ("", "controller '' is neither one of hws"),
        ("x" * 5000, "is neither one of"),
        ("nowhere.toml", "nor a TOML file that exists"),
        ("nowhere.py:Still", "nowhere.py is no file; expected one that ends in .py"),
        ("nothing_of_this_name:Still", "nothing_of_this_name cannot be imported: ModuleNotFoundError"),
        ("broken.py:Still", "broken.py cannot be loaded"),
        ("mine_of_a_user.py:Stil", "no Stil there; controllers there: Still, Needy"),
        ("mine_of_a_user.py:number", "controller = 6; expected a controller, a frozen dataclass"),
        ("mine_of_a_user.py:np", "expected a controller, a frozen dataclass"),
        ("mine_of_a_user.py:Needy", "Needy cannot be made: legs is missing; expected a class with defaults"),
    ],
)
def test_wrong_names_get_one_sentence(mine, name, words):
    with pytest.raises(hexmj.InputError, match=words) as wrong:
        hexmj.load_controller(name)
    assert "\n" not in str(wrong.value)


def test_feedback_needs_plans_that_can_be_steered():
    reading = hexmj.ReadsLegs(Own())
    with pytest.raises(hexmj.InputError, match="feedback around own; expected a controller whose plans can go on"):
        reading.begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)
    with pytest.raises(
        hexmj.InputError, match=r"feedback around .*; expected another: this one reads the legs already"
    ):
        hexmj.ReadsLegs(hexmj.ReadsLegs(LDVS)).begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)


@pytest.mark.parametrize("acceleration", [None, hexmj.Acceleration(rate=0.01)])
@pytest.mark.parametrize("name", ["hws", "ldvs", "own"])
def test_on_paper_reading_the_legs_changes_nothing(name, acceleration):
    """Neither the plan nor its losses, by either way to them."""
    controller, starts = hexmj.PRESETS[name], hexmj.draw_starts(20, 5)
    velocity, steps = np.linspace(0.1, 0.9, 20), np.full(20, 300)
    inner, outer = (one.begin(starts, velocity, STRIDE, acceleration) for one in (controller, reads(controller)))
    one, other = inner.advance(300), outer.advance(300)
    assert same(one, replace(other, aep=one.aep))
    begin = partial(reads(controller).begin, starts, velocity, STRIDE, acceleration)
    fast, general = first_losses(begin(), steps), planned_losses(begin(), steps)
    assert np.array_equal(fast, general)
    assert np.array_equal(fast, first_losses(controller.begin(starts, velocity, STRIDE, acceleration), steps))


def reads(controller: Controller) -> hexmj.ReadsLegs:
    return hexmj.ReadsLegs(controller)


def test_settings_are_plain_data():
    settings = settings_of(hexmj.ReadsLegs(hexmj.PRESETS["own-0.1"]))
    assert set(settings) == {"controller"}
    assert isinstance(settings["controller"]["weights"]["p1"][0], list)
    with pytest.raises(hexmj.InputError, match="expected a controller"):
        settings_of(Own)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("order", ["printed", "undelayed", "sequential"])
@pytest.mark.parametrize("name", ["ldvs", "uncoordinated", "own-0.1", "own"])
def test_the_network_conforms(name, order):
    controller = replace(hexmj.PRESETS[name], order=order)
    check_controller(controller)
    assert controller.mirrored == (order != "sequential" and name != "own-0.1")


def test_other_controllers_conform():
    check_controller(hexmj.ReadsLegs(LDVS))
    check_controller(replace(LDVS, name="fine"), hexmj.Stride(dt=0.05, geometry=hexmj.CENTRED))
    assert all(finding.well and finding.found for finding in findings(Own()))


def steps_changed(**changed: Callable[[PlannedWalk], Any]) -> Own:
    """A controller that changes every step of LDVS."""
    return Own(lambda walk, _: {name: one(walk) for name, one in changed.items()})


def spoilt(spoil: Callable[..., Any]) -> Any:
    """LDVS with plans that are spoilt, or replaced, as they begin: by plan, starts, velocity and threads."""

    @dataclass(frozen=True)
    class Spoilt(Own):
        def begin(self, starts, velocity, stride, acceleration=None, threads=None):
            plan = Own.begin(self, starts, velocity, stride, acceleration)
            return spoil(plan, starts, velocity, threads) or plan

    return Spoilt()


def walks_changed(change: Callable[[PlannedWalk], dict[str, Any]]) -> Any:
    """A controller whose plans give other walks than they should."""

    def spoil(plan, *_):
        inner = plan.advance
        plan.advance = lambda steps: replace(walk := inner(steps), **change(walk))

    return spoilt(spoil)


COUNT = itertools.count()


@dataclass
class Melting:
    """Not frozen."""

    change: Change | None = None
    name: str = "melting"
    begin = Own.begin


@dataclass(frozen=True)
class Hiding(Own):
    """With a setting that is no plain data."""

    thing: Any = object()  # noqa: RUF009  # one for all


@dataclass(frozen=True)
class MirroredInVain(Own):
    """Claims what it does not keep."""

    mirrored = True


@dataclass(frozen=True)
class OfOneMind(Own):
    """Its plans forget how far they are as soon as another one begins."""

    mind: list[int] = field(default_factory=list, compare=False)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        """See `protocol.Controller`."""
        self.mind[:] = [0]

        def forgetful(walk, _):
            self.mind[0] += 1
            return {"x": walk.x[0] + 1e-6 * self.mind[0]}

        return Own(forgetful).begin(starts, velocity, stride, acceleration, threads)


def moved_by_all(plan, *_):
    """Whoever is told something, all move."""
    inner, told = plan.advance, []
    plan.advance = lambda steps: replace(walk := inner(steps), x=walk.x - 0.001 * len(told))
    plan.sense = told.append


def written_on(plan, *_):
    def sense(sensed: Sensed) -> None:
        sensed.tips[:] = 0.0

    plan.sense = sense


def one_step_on(plan, *_):
    plan.advance(1)


def one_step_on_with_two_threads(plan, starts, velocity, threads):
    if threads == 2:
        plan.advance(1)
        plan.done = 0


def losses_of_its_own(plan, *_):
    """Its fast way finds other losses than the plan has."""
    plan.first_losses = np.ones_like


def starts_halved(plan, starts, *_):
    starts *= 0.5


def left_leg_ahead(walk: PlannedWalk, _: int) -> dict[str, Any]:
    return {"x": walk.x[0] + np.array([1e-6, 0.0, 0.0, 0.0, 0.0, 0.0])}


BROKEN: list[tuple[str, Any, str]] = [
    ("settings", Melting(), "not frozen"),
    ("settings", Hiding(), "object.*is no setting"),
    ("begin", spoilt(lambda *_: 3), "begin gave 3; expected a plan"),
    ("begin", spoilt(one_step_on), "the plan is at step 1; expected one at time 0"),
    ("begin", spoilt(lambda plan, *_: setattr(plan, "starts", plan.starts + 1e-9)), "the plan is of other starts"),
    ("begin", spoilt(lambda plan, *_: setattr(plan, "stride", hexmj.Stride(dt=0.2))), "the plan's stride is Stride"),
    ("steps", spoilt(starts_halved), "starts are changed as it goes on; expected the plan to work on a copy"),
    ("steps", walks_changed(lambda walk: {"x": walk.x[:, :1]}), r"x is float64 of the shape \(600, 1, 6\); expected"),
    ("steps", walks_changed(lambda walk: {"stance": 1.0 * walk.stance}), "stance is float64 .* expected bool"),
    ("steps", walks_changed(lambda walk: {"geometry": CENTRED}), "geometry = .*; expected that of the stride"),
    ("steps", walks_changed(lambda walk: {"time": walk.time - 0.1}), "expected k dt"),
    ("times", walks_changed(lambda walk: {"time": walk.time * (1 + 1e-12)}), "expected k dt"),
    ("times", walks_changed(lambda walk: {"velocity": np.full_like(walk.velocity, 0.5)}), "expected V_r as commanded"),
    ("steps", steps_changed(x=lambda walk: np.where(walk.stance[0], walk.x[0], np.nan)), "x is nan in step"),
    ("steps", steps_changed(height=lambda walk: np.inf), "height is inf in step 0, start 0 .V = 0., leg L1"),
    ("reach", steps_changed(x=lambda walk: walk.x[0] + 5.0), "x is .* mm in step .*; expected -21 to 11 mm"),
    ("reach", steps_changed(y=lambda walk: 1.6 * walk.y[0]), "y is 28.8 mm in .*; expected 9 to 27 mm"),
    ("reach", steps_changed(height=lambda walk: 30.0), "height is 30 mm in .*; expected -10 to 20 mm"),
    ("begun again", steps_changed(x=lambda walk: walk.x[0] + 1e-9 * next(COUNT)), "begun alike differ: x is"),
    ("begun again", spoilt(one_step_on_with_two_threads), "with 1 and 2 threads differ: x is"),
    ("side by side", OfOneMind(), "a plan alone, and beside another of the same controller, differ: x is"),
    ("batch", steps_changed(x=lambda walk: walk.x[0] + 1e-6 * walk.x[0].mean()), "or among others differ: x"),
    ("divided", walks_changed(lambda walk: {"x": walk.x + 1e-9 * len(walk.x)}), "in parts of .* differ: x is"),
    ("first losses", spoilt(losses_of_its_own), r"first_losses gives the steps \[1 1 .* expected those of the plan"),
    ("mirrored", MirroredInVain(left_leg_ahead), "mirrored starts, mirrored back, differ: x is"),
    ("sense", spoilt(moved_by_all), "starts it is told nothing of differ: x is"),
    ("sense", spoilt(written_on), "sense changes what it is told, tips"),
    ("steps", steps_changed(x=lambda walk: np.zeros((2, 2))), "x of a step has the shape"),
]


@pytest.mark.parametrize(("law", "controller", "words"), BROKEN)
def test_what_breaks_a_law_is_found_in_one_sentence(law, controller, words):
    finding = next(one for one in findings(controller) if one.name == law)
    assert not finding.well
    assert re.search(words, finding.found), finding.found
    assert "\n" not in finding.found


@pytest.mark.parametrize("law", FIRST)
def test_one_cause_is_found_once(law):
    """What the laws after one rest on; they would say the same again."""
    for broken, controller, _ in BROKEN:
        if broken == law:
            *kept, finding = findings(controller)
            assert finding.name == law
            assert finding.found.endswith("; the laws after this one were not tried")
            assert all(one.well for one in kept if one.name != "settings")


def test_feet_that_slide_are_told():
    """No law forbids it; tips that stand still slide with V_r, at most."""
    *_, last = findings(Own())
    assert (last.name, last.found) == (
        "sliding",
        "feet that stand stay where they are on the ground: their tips recede at V_r",
    )
    *_, last = findings(steps_changed(x=lambda walk: np.zeros(6), stance=lambda walk: True))
    assert last.well
    assert last.found.startswith("feet that stand would slide: ")
    assert "but one is off by 0.95 V_p, in step 1, start 3 (V = 0.95), leg L1" in last.found
    *_, last = findings(steps_changed(y=lambda walk: walk.y[0] + 1e-3 * walk.time[0]))
    assert "but one is off by 0.001 V_p" in last.found


def test_the_first_law_that_is_broken_is_raised():
    with pytest.raises(AssertionError, match=r"^settings: the dataclass is not frozen; expected"):
        check_controller(Melting())


def test_what_is_no_controller_is_refused():
    for thing in (3, Own, hexmj.Symmetric()):
        with pytest.raises(hexmj.InputError, match="expected a controller, a frozen dataclass"):
            check_controller(thing)
    with pytest.raises(hexmj.InputError, match="a controller's name = 3; expected a text"):
        check_controller(Own(name=3))  # pyright: ignore[reportArgumentType]


LIES = {
    "a tip that is NaN": lambda walk: replace(walk, x=np.full_like(walk.x, np.nan)),
    "a tip beside that is inf": lambda walk: replace(walk, y=np.full(walk.x.shape, np.inf)),
    "a height that is inf": lambda walk: replace(walk, height=np.full(walk.x.shape, np.inf)),
    "too few steps": lambda walk: part_of(walk, slice(1, None)),
    "states as numbers": lambda walk: replace(walk, stance=walk.stance.astype(float)),
    "no walk": lambda walk: [walk],
}


@dataclass(frozen=True)
class Liar:
    """LDVS by way of `stepwise`, whose plans say something else."""

    lie: str
    name: str = "liar"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        plan = Own().begin(starts, velocity, stride, acceleration, threads)
        true = plan.advance
        plan.advance = lambda steps: LIES[self.lie](true(steps))
        return plan


def test_a_plan_that_goes_on_by_other_steps_is_refused():
    plan = LDVS.begin(np.zeros((1, 6)), np.array([0.5]), STRIDE)
    true, plan.advance = plan.advance, lambda steps: true(steps + 1)
    with pytest.raises(hexmj.InputError, match="a plan is at step 4 after it was asked for 3 more; expected 3"):
        advanced(plan, 3)


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("physical", [False, True])
def test_a_plan_that_makes_no_sense_is_never_an_outcome(lie, physical):
    starts = hexmj.draw_starts(2, 0)
    with pytest.raises(hexmj.InputError, match=r"a plan|a walk's"):
        if physical:
            hexmj.physical_walk(starts, Liar(lie), 0.3, 5.0)
        else:
            hexmj.first_loss(starts, Liar(lie), 0.3, 5.0)


@dataclass(frozen=True)
class Raises:
    """Raises something in its third step."""

    what: type[BaseException]
    name: str = "raises"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        done = 0

        def step(v):
            nonlocal done
            done += 1
            if done == 3:
                raise self.what("no more")
            return Step(starts, True)

        return stepwise(step, starts, velocity, stride, acceleration)


@pytest.mark.parametrize("what", [ZeroDivisionError, SystemExit])
def test_what_a_controller_raises_is_said_in_one_sentence(what):
    with pytest.raises(hexmj.InputError, match=rf"{what.__name__} in .*test_controllers.py, line \d+: no more"):
        hexmj.first_loss(hexmj.draw_starts(2, 0), Raises(what), 0.3, 5.0)


def test_toml_that_names_itself_is_refused(tmp_path):
    path = tmp_path / "ring.toml"
    path.write_text(f"controller = '{path}'\n[fields]\n")
    with pytest.raises(hexmj.InputError, match="expected module:object"):
        hexmj.load_controller(str(path))


def test_arguments_that_nobody_knows_are_refused():
    with pytest.raises(hexmj.InputError, match="argument 'condition'; valid names: executor"):
        hexmj.compare(LDVS, [0.3], n_starts=2, window=5.0, condition=1)  # pyright: ignore[reportCallIssue]


@pytest.mark.parametrize("name", ["evolved", "walknet-reacog-without-2"])
def test_a_file_may_name_a_rival_by_its_name(name, tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(f'controller = "{name}"\n[fields]\nname = "found"\n')
    usual: Any = hexmj.load_controller(name)
    assert hexmj.load_controller(str(path)) == replace(usual, name="found")
    path.write_text(f'controller = "{path}"\n[fields]\n')
    with pytest.raises(hexmj.InputError, match=r"expected module:object, file.py:object, a rival or an entry point"):
        hexmj.load_controller(str(path))
