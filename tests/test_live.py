"""Live walks: the bits of measured walks, changed on the way; sessions in real time."""

from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from hexmj.command import Command
from hexmj.conditions import Conditions
from hexmj.controllers import Step, stepwise
from hexmj.controllers.cruse1998 import HWS, LDVS, UNCOORDINATED
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import load_controller
from hexmj.controllers.steered import Steered
from hexmj.errors import InputError
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.starts import draw_starts
from hexmj.view import desktop
from hexmj.view.live import LiveWalk
from hexmj.view.session import LYING_TIME, LiveSession

STARTS = draw_starts(8, seed=1)


def begun(controller: Controller = LDVS, velocity: float = 0.4) -> LiveWalk:
    return LiveWalk(controller, velocity, STARTS[0])


CONTROLLERS = LDVS, SensoryFeedback(LDVS), load_controller("graham")


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda case: case.name)
def test_an_unchanged_walk_is_the_measured_one(controller):
    """To the last bit, for any division into frames."""
    live, shown = begun(controller), []
    for seconds in (0.03, 0.001, 0.1, 0.0333, 0.05):
        live.advance(seconds)
        shown += live.trace
    measured = physical_walk(STARTS[:1], controller, 0.4, 24.0)
    rows = np.rint(np.array([moment.seconds for moment in shown]) * 80.0 / 0.1).astype(int) - 1
    assert len(shown) > 150
    assert (np.diff(rows) == 1).all()
    for name, values in {
        "qpos": measured.qpos[:, 0],
        "centre_of_mass": measured.centre_of_mass[:, 0],
        "stance": measured.grounded.stance[:, 0],
        "planned_stance": measured.ordered.stance[:, 0],
    }.items():
        np.testing.assert_array_equal([getattr(moment, name) for moment in shown], values[rows])


def test_a_changed_velocity_and_controller_continue_from_the_current_legs():
    live = begun(velocity=0.2)
    live.advance(0.2)
    before, seconds = live.moment, live.moment.seconds
    assert live.steer(0.6)
    assert live.steer(controller=HWS)
    live.advance(0.02)
    after = live.trace
    assert after[0].seconds == pytest.approx(seconds + 0.00125)
    assert np.abs(after[0].qpos - before.qpos).max() < 1.0
    assert (live.moment.velocity, live.controller) == (0.6, HWS)


def test_a_plan_that_is_handed_over_is_the_new_controller_s():
    """At time 0, it is the kinematic walk of the new controller."""
    plan = Steered(UNCOORDINATED).begin_commanded(STARTS[:1], np.array([0.3, 0.0, 0.0]), begun().stride)
    plan.follow(np.array([0.5, 0.0, 0.0]))
    assert plan.hand_over(LDVS)
    np.testing.assert_array_equal(plan.advance(400).x, walk(STARTS[:1], LDVS, 0.5, 40.0).x)


def test_a_controller_that_cannot_continue_begins_again():
    live = begun(SensoryFeedback(LDVS))
    live.advance(0.1)
    assert live.steer(0.5)
    live.advance(0.1)
    assert not live.steer(controller=HWS)
    assert live.moment.seconds < 0.01
    assert live.command == Command(0.5)
    live.begin(conditions=Conditions(vp=160.0))
    assert live.moment.seconds < 0.01
    assert live.advance(0.1).qpos[0] > 3.0


def test_bad_arguments_change_nothing(monkeypatch):
    live = begun()
    live.advance(0.1)
    before = live.moment
    for change, argument in (
        (lambda: live.steer(1.5), "forward"),
        (lambda: live.advance(-1.0), "seconds"),
        (lambda: live.advance(np.nan), "seconds"),
        (lambda: live.push(1e9), "impulse"),
    ):
        with pytest.raises(InputError, match=argument):
            change()
    assert (live.command, live.controller) == (Command(0.4), LDVS)
    assert live.moment is before
    monkeypatch.setattr("hexmj.view.live.MOST_STEPS", 5)
    with pytest.raises(InputError, match="steps"):
        live.advance(1.0)


@dataclass(frozen=True)
class Stumbles:
    """Begins at any velocity, and fails at its first step above 0.5."""

    name: str = "stumbles"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        def step(v):
            if (v > 0.5).any():
                raise ValueError("too fast")
            return Step(starts, np.ones(6, dtype=bool))

        return stepwise(step, starts, velocity, stride, acceleration)


def test_after_a_failing_begin_the_last_walk_continues():
    live = begun()
    live.advance(0.1)
    before = live.moment
    with pytest.raises(ValueError, match="too fast"):
        live.steer(0.6, Stumbles())
    assert live.moment is before
    assert live.advance(0.1).seconds == pytest.approx(before.seconds + 0.1, abs=0.01)
    assert (live.command, live.controller) == (Command(0.4), LDVS)


def test_the_desktop_viewer_shows_why_a_key_is_refused(monkeypatch):
    """MuJoCo's viewer without its window."""
    shown, session = [], LiveSession(LiveWalk(Stumbles(), 0.5, STARTS[0]), 0, STARTS.__getitem__)

    @contextmanager
    def window(conditions, on_key):
        on_key(ord("W"))
        yield SimpleNamespace(is_running=lambda: len(shown) < 2)

    monkeypatch.setattr(desktop, "_window", window)
    monkeypatch.setattr(desktop, "_show", lambda *what: shown.append(what[-1]))
    desktop.view_live(session)
    assert all("too fast" in message for message in shown)
    assert session.walk.command == Command(0.55)


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


def test_pushes_in_flight_add_up():
    """The energy of earlier pushes does not make the walk an exploded one."""
    live = begun()
    for impulse in (80.0, 80.0, 80.0, 1.0):
        live.push(impulse)
        live.advance(0.06)
    assert live.advance(0.1).qpos[1] > 500.0


def test_a_fallen_insect_begins_at_the_next_start_after_a_while():
    session = LiveSession(LiveWalk(UNCOORDINATED, 0.9, STARTS[0]), 0, STARTS.__getitem__)
    for _ in range(100):
        session.tick(0.05)
        if session.walk.fell_on:
            break
    assert session.walk.fell_on in session.walk.conditions.body.trunk
    assert 0.0 < session.walk.lost_at <= session.walk.moment.seconds
    seen = session.walk.moment
    assert session.tick(0.5 * LYING_TIME) is seen
    session.tick(0.6 * LYING_TIME)
    assert session.start == 1
    assert not session.walk.fell_on
    session.speed = 0.0
    assert session.tick(0.05) is session.walk.moment


@dataclass(frozen=True)
class Choosy:
    """LDVS, except for two starts that it refuses."""

    name: str = "choosy"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        if np.isin(starts[:, 0], [STARTS[1][0], STARTS[2][0]]).any():
            raise InputError("choosy refuses")
        return LDVS.begin(starts, velocity, stride, acceleration, threads)


def test_starts_that_cannot_be_walked_are_skipped_with_a_message():
    session = LiveSession(LiveWalk(Choosy(), 0.5, STARTS[0]), 0, STARTS.__getitem__)
    for start, refused in ((0, True), (0, True), (3, False)):
        session.attempt(session.begin_next)
        session.tick(0.05)
        assert (session.start, "refuses" in session.message) == (start, refused)
    session.attempt(session.begin)
    assert session.start == 3
