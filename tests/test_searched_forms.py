"""Forms of the network and fields of a controller; candidates that are refused or fail are never found."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

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
    expected = [
        hexmj.flss(Pace(good=good), [0.4], n_starts=50, observation_time=5.0).flss.item() for good in (2.0, 0.1)
    ]
    assert sample.costs(np.array([[2.0, 0.0], [0.1, 7.0]])).tolist() == expected
    for algorithm in ("evolution", "cmaes"):
        found = search(problem, Effort(algorithm, domain=2.0, starts=40, budget=60, refine_starts=60, refine_budget=30))
        assert found.history.parameter.values.tolist() == ["good", "idle"]
        assert found.cost == 0.0 < expected[0]
        assert abs(found.vector[0] - 3.0) < 2.0


@dataclass(frozen=True)
class Picky(Pace):
    """Refuses nearly all that is not usual."""

    least: int = 2

    def __post_init__(self):
        if not self.least <= self.good < 2.01:
            raise InputError(f"good = {self.good} is out of the range that I allow")


def test_what_a_controller_refuses_costs_as_one_that_loses_all_and_none_of_it_wins():
    problem = Problem(FieldsForm(Picky()), 0.4, 0.4, observation_time=5.0)
    found = search(problem, Effort(starts=20, budget=30, refine_budget=0))
    good = found.history.candidate.sel(parameter="good")
    refused = (good < 2) | (good >= 2.01)
    assert refused.any() and (found.history.cost[refused.values] == 1.0).all() and 2 <= found.vector[0] < 2.01
    with pytest.raises(InputError, match="out of the range"):
        search(problem, Effort("cmaes", population=4, budget=4, starts=5, refine_budget=0, seed=1))


@dataclass(frozen=True)
class Late(Pace):
    """Refuses as it begins, if it is not usual."""

    def __post_init__(self):
        """Refuses nothing."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        Picky(self.good)
        return super().begin(starts, velocity, stride, acceleration, threads)


def test_a_candidate_that_refuses_to_walk_costs_as_one_that_loses_all_and_none_of_it_is_found():
    problem = Problem(FieldsForm(Late()), 0.4, 0.4, observation_time=5.0)
    assert Sample(problem, 5, 0).costs(np.array([[1.5, -0.5]])).tolist() == [1.0]
    found = search(problem, Effort(starts=20, budget=30, refine_budget=0))
    assert 2 <= found.vector[0] < 2.01 and found.cost < 1
    with pytest.raises(InputError, match="out of the range"):
        search(problem, Effort("cmaes", population=4, budget=4, starts=5, refine_budget=0, seed=1))


def test_a_candidate_whose_simulation_fails_costs_as_one_that_loses_all_and_is_not_found(monkeypatch):
    """A start that does not settle is no candidate's fault."""

    def outcomes(settled, controller, *args, **how):
        if controller.good < 2:
            raise SimulationError("start 0 diverged")
        return SimpleNamespace(fall=np.full(len(settled.starts), np.inf))

    monkeypatch.setattr("hexmj.measures.physical.physical_outcomes", outcomes)
    problem = Problem(FieldsForm(Pace()), 0.3, 0.3, observation_time=5.0, measure="physical")
    assert Sample(problem, 2, 0).costs(np.array([[1.5, -0.5], [2.5, -0.5]])).tolist() == [1.0, 0.0]
    found = search(problem, Effort(starts=2, budget=10, refine_budget=0))
    assert found.vector[0] >= 2 and found.cost == 0 and (found.history.cost == 1).any()
    restless = replace(problem, conditions=hexmj.Conditions(settling_time=1.0))
    with pytest.raises(SimulationError):
        Sample(restless, 2, 0).costs(np.array([[2.5, -0.5]]))
    with pytest.raises(SimulationError, match="start 0 diverged"):
        Sample(problem, 2, 0).check_walks(np.array([1.0, -0.5]))


@dataclass(frozen=True)
class Far(Pace):
    """Stands still, far beside its lines."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        y = (4.0 + abs(self.good)) * np.array(stride.geometry.y)
        return stepwise(lambda v: Step(starts, np.ones(6, dtype=bool), y=y), starts, velocity, stride, acceleration)


def test_what_no_leg_reaches_is_never_found():
    problem = Problem(FieldsForm(Far()), 0.3, 0.3, observation_time=5.0, measure="physical")
    with pytest.raises(InputError, match="out of reach"):
        search(problem, Effort(starts=2, budget=10, refine_budget=0, domain=2.0))


def test_controllers_without_such_parameters_are_refused():
    with pytest.raises(InputError, match="float"):
        FieldsForm(hexmj.UNCOORDINATED)
    for begin in (hexmj.LDVS, Picky(least=1)):
        with pytest.raises(InputError, match="begin"):
            FieldsForm(Picky()).vector(begin)
    assert FieldsForm(Picky()).vector(Picky(good=2.005, name="begun")).tolist() == [2.005, -0.5]
