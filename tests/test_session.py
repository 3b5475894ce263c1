"""What every viewer shows: when a live walk begins again, and what is told of a wish that makes no sense."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.errors import InputError
from hexmj.starts import draw_starts
from hexmj.view.live import LiveWalk
from hexmj.view.session import LIES, LiveSession

STARTS = draw_starts(8, seed=1)


def test_a_fallen_insect_lies_for_a_while_and_begins_at_the_next_start():
    session = LiveSession(LiveWalk(UNCOORDINATED, 0.9, STARTS[0]), 0, STARTS.__getitem__)
    for _ in range(100):
        session.tick(0.05)
        if session.walk.fell_on:
            break
    assert session.walk.fell_on in session.walk.conditions.body.trunk
    seen = session.walk.moment
    assert session.tick(0.5 * LIES) is seen
    session.tick(0.6 * LIES)
    assert session.start == 1
    assert not session.walk.fell_on


@dataclass(frozen=True)
class Choosy:
    """LDVS, but for starts that it does not take, and velocities at which its plans end."""

    name: str = "choosy"

    def begin(self, starts, velocity, *how):
        return self.begin_at_speed(starts, velocity, *how)

    def begin_at_speed(self, starts, velocity, *how):
        if np.isin(starts[:, 0], [STARTS[1][0], STARTS[2][0]]).any() or (np.asarray(velocity) > 0.8).any():
            raise InputError("choosy does not take that")
        return LDVS.begin_at_speed(starts, velocity, *how)


def test_a_start_that_cannot_be_walked_is_told_and_passed_over():
    choosy: Any = Choosy()
    session = LiveSession(LiveWalk(choosy, 0.5, STARTS[0]), 0, STARTS.__getitem__)
    for start, told in ((0, "choosy does not take that"), (0, "choosy does not take that"), (3, "")):
        session.attempt(session.begin_next)
        session.tick(0.05)
        assert (session.start, session.told) == (start, told)
    session.attempt(session.begin)
    assert session.start == 3


def test_a_fallen_insect_whose_next_start_cannot_be_walked_lies_for_longer():
    choosy: Any = Choosy()
    session = LiveSession(LiveWalk(choosy, 0.5, STARTS[0]), 0, STARTS.__getitem__)
    session.walk.fell_on = "thorax"
    for start in (0, 0, 3):
        session.tick(1.1 * LIES)
        assert session.start == start
    assert not session.walk.fell_on


def test_a_paused_walk_stands_still():
    session = LiveSession(LiveWalk(LDVS, 0.4, STARTS[0]), 0, STARTS.__getitem__)
    session.paused = True
    before = session.walk.moment
    assert session.tick(0.05) is before
