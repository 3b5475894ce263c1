"""What can be searched: forms of the network, fields of a controller, and what is refused of either."""

import math
from contextlib import nullcontext
from dataclasses import InitVar, dataclass, field, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import hexmj
from hexmj import FieldsForm, NetworkForm, Problem
from hexmj.controllers import Step, stepwise
from hexmj.errors import InputError, SimulationError
from hexmj.legs import MIRROR
from hexmj.search.forms import FORMS
from hexmj.search.problems import Sample
from hexmj.search.stages import Effort, search
from pace import Pace


@pytest.mark.parametrize("name", FORMS)
def test_forms_are_what_their_names_say(name):
    """Vectors and controllers turn into each other, and both sides are alike in every form but the general one."""
    form = NetworkForm(name)
    domain = Problem(form, 0.4, 0.4).domain(10.0)
    vector = domain.read(domain.draw(1, np.random.default_rng(3)))[0]
    controller = form.controller(vector)
    assert len(form.names) == len(vector) == {"hws": 9, "ldvs": 10, "mirrored": 29, "general": 58}[name]
    assert np.array_equal(form.vector(controller), vector)
    starts = hexmj.draw_starts(20, 5)
    walked, mirrored = (hexmj.walk(one, controller, 0.4, 60.0).x for one in (starts, starts[:, MIRROR]))
    assert np.array_equal(walked[:, :, MIRROR], mirrored) == (name != "general")


def test_the_fields_of_a_controller_are_searched():
    """Those that are floats, from their usual values, over 0 to a multiple of them; what it refuses costs all."""
    form = FieldsForm(Pace())
    problem = Problem(form, 0.4, 0.4, observation_time=5.0)
    domain = problem.domain(4.0)
    assert form.names == ("good", "idle")
    assert not domain.binary.any()
    assert (domain.low.tolist(), domain.high.tolist()) == ([0.0, -2.0], [8.0, 0.0])
    assert domain.begin is not None and domain.begin.tolist() == [2.0, -0.5]
    assert np.broadcast_to(domain.unit, 2).tolist() == [2.0, 0.5]
    assert problem.domain(4.0, Pace(good=1.0)).begin.tolist() == [1.0, -0.5]  # pyright: ignore[reportOptionalMemberAccess]
    assert form.controller(np.array([1.5, 0.25])) == Pace(good=1.5, idle=0.25)
    sample = Sample(problem, 50, 0)
    assert sample.costs(np.array([[-1.0, 0.0]])) == [1.0]
    expected = [hexmj.flss(Pace(good=good), [0.4], n_starts=50, observation_time=5.0).flss.item() for good in (2.0, 0.1)]
    assert sample.costs(np.array([[2.0, 0.0], [0.1, 7.0]])).tolist() == expected
    for algorithm in ("evolution", "cmaes"):
        found = search(problem, Effort(algorithm, domain=2.0, starts=40, budget=60, refine_starts=60, refine_budget=30))
        assert found.history.parameter.values.tolist() == ["good", "idle"]
        assert found.cost == 0.0 < expected[0]
        assert abs(found.vector[0] - 3.0) < 2.0


def test_a_controller_that_is_false_is_begun_with(monkeypatch):
    monkeypatch.setattr(Pace, "__bool__", lambda _: False, raising=False)
    domain = Problem(FieldsForm(Pace()), 0.4, 0.4, observation_time=5.0).domain(4.0, Pace(good=1.0))
    assert domain.begin is not None and domain.begin.tolist() == [1.0, -0.5]


@dataclass(frozen=True)
class Picky(Pace):
    """Refuses nearly all that is not usual."""

    least: int = 2

    def __post_init__(self):
        if not self.least <= self.good < 2.01:
            raise ValueError(f"good = {self.good} is out of the range that I allow")


def test_what_a_controller_refuses_is_counted_and_none_of_it_wins():
    problem = Problem(FieldsForm(Picky()), 0.4, 0.4, observation_time=5.0)
    found = search(problem, Effort(starts=20, budget=30, refine_budget=0))
    good = found.history.candidate.sel(parameter="good")
    refused = (good < 2) | (good >= 2.01)
    assert len(found.refused) == found.history.attrs["refused"] == refused.sum() > 0
    assert found.refused[0].startswith("ValueError: good = ")
    with pytest.raises(InputError, match="4 of 4 candidates were refused, the best one by: ValueError: good = "):
        search(problem, Effort("cmaes", population=4, budget=4, starts=5, refine_budget=0, seed=1))


@dataclass(frozen=True)
class Late(Pace):
    """Refuses as it begins, if it is not usual."""

    least: int = 2

    def __post_init__(self):
        """Refuses nothing."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        if not self.least <= self.good < 2.01:
            raise InputError(f"good = {self.good} is too late")
        return super().begin(starts, velocity, stride, acceleration, threads)


def test_a_candidate_that_refuses_to_walk_costs_as_one_that_loses_all_and_none_of_it_is_found():
    problem = Problem(FieldsForm(Late()), 0.4, 0.4, observation_time=5.0)
    assert Sample(problem, 5, 0).costs(np.array([[1.5, -0.5]])).tolist() == [1.0]
    found = search(problem, Effort(starts=20, budget=30, refine_budget=0))
    assert 2 <= found.vector[0] < 2.01 and found.cost < 1
    with pytest.raises(
        InputError, match=r"best candidate of the population, with good = .* 5 starts: good = .* is too late"
    ):
        search(problem, Effort("cmaes", population=4, budget=4, starts=5, refine_budget=0, seed=1))


def test_a_candidate_whose_simulation_fails_costs_as_one_that_loses_all_and_is_not_found(monkeypatch):
    """A start that does not settle is no candidate's fault."""

    def outcomes(settled, controller, *args, **how):
        if controller.good < 2:
            raise SimulationError("start 0 diverged")
        return SimpleNamespace(fall=np.full(len(settled.starts), np.inf))

    monkeypatch.setattr("hexmj.measures.physical.physical_outcomes", outcomes)
    problem = Problem(FieldsForm(Pace()), 0.3, 0.3, observation_time=5.0, conditions=hexmj.Conditions())
    assert Sample(problem, 2, 0).costs(np.array([[1.5, -0.5], [2.5, -0.5]])).tolist() == [1.0, 0.0]
    found = search(problem, Effort(starts=2, budget=10, refine_budget=0))
    assert found.vector[0] >= 2 and found.cost == 0 and (found.history.cost == 1).any()
    restless = replace(problem, conditions=hexmj.Conditions(settling_time=1.0))
    with pytest.raises(SimulationError, match="did not settle"):
        Sample(restless, 2, 0).costs(np.array([[2.5, -0.5]]))
    with pytest.raises(SimulationError, match=r"with good = 1, .* does not walk from its 2 starts: start 0 diverged"):
        Sample(problem, 2, 0).check_walks(np.array([1.0, -0.5]), "population")


class TooFast(InputError):
    """Of a user's own."""

    def __init__(self, v):
        super().__init__()
        self.v = v

    def __str__(self):
        return f"too fast: {self.v}"


@dataclass(frozen=True)
class Fast(Pace):
    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        raise TooFast(velocity.max())


def test_an_error_of_ones_own_stays_what_it_is():
    with pytest.raises(TooFast, match=r"^too fast: 0\.4$"):
        hexmj.flss(Fast(), 0.4, n_starts=3, observation_time=5.0)


@dataclass(frozen=True)
class Odd(Pace):
    """A step of it makes no sense."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        return stepwise(lambda v: Step(np.zeros(5), True), starts, velocity, stride, acceleration)


def test_a_candidate_whose_steps_make_no_sense_is_named():
    problem = Problem(FieldsForm(Odd()), 0.4, 0.4, observation_time=5.0)
    with pytest.raises(InputError, match=r"with good = 1.5, idle = -0.5: .*x of a step"):
        Sample(problem, 5, 0).costs(np.array([[1.5, -0.5]]))


@dataclass(frozen=True)
class Far(Pace):
    """Stands still, far beside its lines."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        y = (4.0 + abs(self.good)) * np.array(stride.geometry.y)
        return stepwise(lambda v: Step(starts, np.ones(6, dtype=bool), y=y), starts, velocity, stride, acceleration)


def test_what_no_leg_reaches_is_never_found():
    problem = Problem(FieldsForm(Far()), 0.3, 0.3, observation_time=5.0, conditions=hexmj.Conditions())
    with pytest.raises(InputError, match="out of reach"):
        search(problem, Effort(starts=2, budget=10, refine_budget=0, domain=2.0))


def test_starts_that_cannot_stand_are_refused_before_a_candidate_walks():
    stride = hexmj.Stride(aep0=11.0)
    problem = Problem(FieldsForm(Fast()), 0.4, 0.4, observation_time=5.0, conditions=hexmj.Conditions(), stride=stride)
    with pytest.raises(InputError, match=r"^of the 8 starts of seed 0, start 4, leg 3: the tip at 10.9 mm is out of"):
        search(problem, Effort(starts=4, budget=10, refine_starts=8))


@pytest.mark.parametrize(
    ("form", "sentence"),
    [
        (
            lambda: FieldsForm(Pace(good=math.nan)),
            "the form's box of good is nan to nan; expected a least",
        ),
        (
            lambda: FieldsForm(Pace(good=math.inf)),
            r"form's box of good is 0 to inf; expected .*, each within 1e\+30",
        ),
        (lambda: FieldsForm(Pace(good=1e308)), "the form's box of good is"),
        (lambda: FieldsForm(Pace(idle="3")), "idle = '3'; expected a number"),  # pyright: ignore[reportArgumentType]
        (lambda: FieldsForm(Pace(idle=True)), "idle = True; expected a number"),
        (lambda: Askew(box_is=([0.0, 0.0], [1.0])), "box of the form = .*; expected numbers"),
        (lambda: Askew(box_is=([1.0, 1.0], [0.0, 1.0])), "the form's box of good is 1 to 0"),
        (lambda: Askew(begin=np.zeros(3)), "a search begins at .*; expected 2 finite numbers"),
        (lambda: Askew(binary=np.zeros(3, dtype=bool)), "the form's binary = .*; expected True or False for 2"),
        (lambda: Askew(binary=[False, False]), "binary of the form = .*; expected an array"),
    ],
)
def test_forms_that_make_no_sense_are_refused(form, sentence):
    with pytest.raises(InputError, match=sentence):
        search(Problem(form(), 0.4, 0.4, observation_time=5.0), Effort(starts=2, budget=10))


@dataclass(frozen=True)
class Askew:
    """A form of a user's own in which something does not fit."""

    names: tuple[str, ...] = ("good", "idle")
    binary: Any = field(default_factory=lambda: np.zeros(2, dtype=bool))
    begin: Any = None
    box_is: Any = ([0.0, 0.0], [1.0, 1.0])

    def box(self, reach):
        return self.box_is

    def controller(self, vector):
        return Pace(*vector.tolist())

    def vector(self, controller):
        return np.array([controller.good, controller.idle])


def test_switches_alone_are_searched_without_a_simplex():
    problem = Problem(Askew(binary=np.ones(2, dtype=bool), box_is=([0.0, 0.0], [1.0, 1.0])), 0.4, 0.4, observation_time=5.0)
    found = search(problem, Effort(starts=5, budget=12, population=4, refine_budget=20))
    assert not found.history.stage.any()
    assert found.starts == 5
    assert set(found.vector.tolist()) <= {0.0, 1.0}


@dataclass(frozen=True)
class Doubled(Pace):
    """Whose speed comes of what is no field."""

    pull: InitVar[float] = 1.0
    speed: float = field(init=False)

    def __post_init__(self, pull: float) -> None:
        object.__setattr__(self, "speed", 2.0 * pull)


@dataclass(frozen=True)
class DoubledAlways(Doubled):
    """The same, which has to be told it."""

    pull: InitVar[float] = field(kw_only=True)


@pytest.mark.parametrize("controller", [Doubled(pull=5.0), DoubledAlways(pull=5.0)])
def test_fields_are_searched_of_a_controller_that_they_tell_alone(controller):
    with pytest.raises(InputError, match="pace is made of pull, too; expected one that its fields alone tell"):
        FieldsForm(controller)


@dataclass(frozen=True, eq=False)
class Unequal(Pace):
    """Which equals itself alone."""


def test_fields_are_searched_of_a_controller_without_equality():
    assert FieldsForm(Unequal()).names == FieldsForm(Pace()).names


@dataclass(frozen=True)
class Twice(Pace):
    """With a field that follows the searched ones."""

    twice: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "twice", 2.0 * self.good)


def test_a_search_begins_with_any_of_the_fields_that_it_chooses():
    assert FieldsForm(Twice()).vector(Twice(good=3.0)).tolist() == [3.0, -0.5]


@pytest.mark.parametrize(
    ("least", "sentence"), [(1, r"to begin with has least = 1; expected 2, as of what is"), (2, None)]
)
def test_a_search_begins_with_the_fields_that_it_does_not_choose(least, sentence):
    """Another name is no other field."""
    begin = Picky(good=2.005, least=least, name="begun")
    with pytest.raises(InputError, match=sentence) if sentence else nullcontext():
        assert FieldsForm(Picky()).vector(begin).tolist() == [2.005, -0.5]


class Gains(NamedTuple):
    a: float = 1.0


@dataclass(frozen=True)
class Gained(Pace):
    """With a record."""

    gains: Gains = field(default_factory=Gains)


def test_a_field_that_does_not_fit_is_shown_as_python_writes_it():
    with pytest.raises(InputError, match=r"has gains = Gains\(a=2\.0\); expected Gains\(a=1\.0\), as of"):
        FieldsForm(Gained()).vector(Gained(gains=Gains(2.0)))


@dataclass(frozen=True)
class Unlimited(Pace):
    """With a field that equals nothing."""

    limit: float | None = float("nan")


def test_a_search_begins_with_fields_that_are_no_numbers():
    assert FieldsForm(Unlimited()).begin.tolist() == [2.0, -0.5]
