"""Live walks: the same bits as measured ones, changed while they go."""

from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexmj.conditions import Conditions
from hexmj.controllers import Step, stepwise
from hexmj.controllers.cruse1998 import HWS, LDVS, UNCOORDINATED, Cruse1998
from hexmj.controllers.named import load_controller
from hexmj.controllers.protocol import Controller
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.errors import InputError
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.starts import draw_starts
from hexmj.view import desktop
from hexmj.view.live import LiveWalk
from hexmj.view.session import LiveSession

STARTS = draw_starts(8, seed=1)


def begun(controller: Controller = LDVS, velocity: float = 0.4) -> LiveWalk:
    """A live walk from one of the starts."""
    return LiveWalk(controller, velocity, STARTS[0])


@pytest.mark.parametrize("controller", [LDVS, SensoryFeedback(LDVS), load_controller("graham")], ids=lambda one: one.name)
def test_a_walk_that_is_left_alone_is_the_measured_one(controller):
    """To the last bit, however it is divided into pictures."""
    live, shown = begun(controller), []
    for seconds in (0.03, 0.001, 0.1, 0.0333, 0.05):
        live.advance(seconds)
        shown += live.trace
    measured = physical_walk(STARTS[:1], controller, 0.4, 24.0)
    rows = np.rint(np.array([one.seconds for one in shown]) * 80.0 / 0.1).astype(int) - 1
    assert len(shown) > 150
    assert (np.diff(rows) == 1).all()
    for name, values in {
        "qpos": measured.qpos[:, 0],
        "centre_of_mass": measured.centre_of_mass[:, 0],
        "stance": measured.measured.stance[:, 0],
        "planned_stance": measured.ordered.stance[:, 0],
    }.items():
        np.testing.assert_array_equal([getattr(one, name) for one in shown], values[rows])


def test_a_changed_velocity_and_changed_weights_go_on_from_the_legs_as_they_are():
    live = begun(velocity=0.2)
    live.advance(0.2)
    before, seconds = live.moment, live.moment.seconds
    assert live.steer(velocity=0.6)
    assert live.steer(controller=HWS)
    live.advance(0.02)
    after = live.trace
    assert after[0].seconds == pytest.approx(seconds + 0.00125)
    assert np.abs(after[0].qpos - before.qpos).max() < 1.0
    assert live.moment.velocity == 0.6
    assert live.controller == HWS
    stood = [one.planned_stance for one in after]
    assert (stood[1] == before.planned_stance).sum() >= 4


def test_a_handed_over_plan_is_walked_as_the_new_controller_plans_it():
    """On paper: from time 0 on it is just the walk of the new controller."""
    live = begun(UNCOORDINATED, 0.3)
    plan = live._plan
    fresh = type(plan)(UNCOORDINATED, STARTS[:1], 0.3, live.stride)
    assert fresh.hand_over(LDVS, 0.5)
    np.testing.assert_array_equal(fresh.advance(400).x, walk(STARTS[:1], LDVS, 0.5, 40.0).x)


def test_a_controller_that_cannot_go_on_begins_again():
    live = begun(SensoryFeedback(LDVS))
    live.advance(0.1)
    assert not live.steer(velocity=0.5)
    assert live.moment.seconds < 0.01
    assert live.velocity == 0.5


@dataclass(frozen=True)
class NeverAtSpeed(Cruse1998):
    """The network, of which no plan can be had that walks at once."""

    raises: bool = True

    def begin_at_speed(self, *given: Any, **how: Any) -> Any:
        if self.raises:
            raise ValueError("not at speed")


def test_a_plan_whose_tips_fail_is_a_sentence(monkeypatch):
    live = begun()
    monkeypatch.setattr(type(live._plan._plan), "tips", property(lambda plan: 1 / 0))
    with pytest.raises(InputError, match="a plan, tips and standing: ZeroDivisionError in "):
        live.steer(velocity=0.3)


def test_a_walk_that_has_come_to_its_end_is_a_sentence(monkeypatch):
    monkeypatch.setattr("hexmj.view.live.MOST_STEPS", 5)
    live = begun()
    with pytest.raises(InputError, match="a walk of 5 steps has come to its end; expected it to begin again"):
        live.advance(1.0)


def test_what_makes_no_sense_changes_nothing():
    live = begun()
    live.advance(0.1)
    before = live.moment
    with pytest.raises(InputError, match="expected 0 <= V < 1"):
        live.steer(velocity=1.5)
    with pytest.raises(InputError, match="velocity = "):
        live.steer(velocity=[0.3])  # pyright: ignore[reportArgumentType]
    for wrong in (np.nan, -1.0, 1e9, "a", None):
        with pytest.raises(InputError, match="seconds = "):
            live.advance(wrong)  # pyright: ignore[reportArgumentType]
    for wrong in (np.nan, np.inf, 1e9, "a", None):
        with pytest.raises(InputError, match="impulse = "):
            live.push(wrong)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="begin_at_speed: ValueError"):
        live.steer(velocity=0.3, controller=NeverAtSpeed(LDVS.weights))
    with pytest.raises(InputError, match="begin_at_speed of network gave None; expected a plan that can be steered"):
        live.steer(velocity=0.3, controller=NeverAtSpeed(LDVS.weights, name="network", raises=False))
    with pytest.raises(InputError, match=r"velocity = \[0.3\]; expected"):
        LiveWalk(LDVS, [0.3], live.start)  # pyright: ignore[reportArgumentType]
    nothing: Any
    for nothing in ("", 0, [], np.ones(2)):
        with pytest.raises(InputError, match=r"controller = .*; expected a controller"):
            live.steer(controller=nothing)
        with pytest.raises(InputError, match=r"conditions = .*; expected a Conditions"):
            live.begin(conditions=nothing)
    assert (live.velocity, live.controller) == (0.4, LDVS)
    assert live.moment is before


@dataclass(frozen=True)
class Stumbles:
    """Begins at any velocity, and fails at its first step above 0.5."""

    name: str = "stumbles"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        def step(v):
            if velocity > 0.5:
                raise ValueError("too fast")
            return Step(starts, np.ones(6, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)


def test_a_walk_that_fails_as_it_begins_leaves_the_one_before():
    live = begun()
    live.advance(0.1)
    before = live.moment
    with pytest.raises(InputError, match="too fast"):
        live.steer(controller=Stumbles(), velocity=0.6)
    assert live.moment is before
    assert live.advance(0.1).seconds == pytest.approx(before.seconds + 0.1, abs=0.01)
    assert (live.velocity, live.controller) == (0.4, LDVS)


def test_a_key_that_asks_for_what_is_refused_is_told(monkeypatch):
    """MuJoCo's viewer without its observation time."""
    shown, session = [], LiveSession(LiveWalk(Stumbles(), 0.5, STARTS[0]), 0, STARTS.__getitem__)

    @contextmanager
    def observation_time(conditions, on_key):
        on_key(desktop.UP)
        yield SimpleNamespace(is_running=lambda: len(shown) < 2)

    monkeypatch.setattr(desktop, "_window", observation_time)
    monkeypatch.setattr(desktop, "_show", lambda *what: shown.append(what[-1]))
    desktop.view_live(session)
    assert all("too fast" in told for told in shown)
    assert session.walk.velocity == 0.5


def test_a_push_that_is_taken_back_ends():
    walk = LiveWalk(LDVS, 0.5, STARTS[0])
    walk.push(10.0)
    while not (force := walk._insects._batch.push).any():
        walk.advance(0.00125)
    walk.push(0.0)
    walk.advance(0.00125)
    assert not force.any()


@pytest.mark.parametrize("pushes", [(80.0, 1.0), (80.0, 80.0, 80.0)])
def test_pushes_in_flight_add_up(pushes):
    """No walk is called exploded since the last of its pushes alone is too weak for it."""
    live = begun()
    for impulse in pushes:
        live.push(impulse)
        live.advance(0.06)
    assert live.advance(0.1).qpos[1] > 500.0


def test_a_push_moves_the_insect_to_its_side():
    aside = []
    for impulse in (0.0, 6.0, -6.0):
        live = begun()
        live.advance(0.05)
        live.push(impulse)
        live.advance(0.1)
        aside.append(live.moment.qpos[1])
    assert aside[1] > aside[0] + 0.3
    assert aside[2] < aside[0] - 0.3


def test_other_conditions_begin_again():
    live = begun()
    live.advance(0.1)
    live.begin(conditions=Conditions(vp=160.0))
    assert live.moment.seconds < 0.01
    live.advance(0.1)
    assert live.moment.qpos[0] > 3.0
