"""Live walk in real time, for the browser and MuJoCo's viewer."""

import time
from collections.abc import Callable, Iterator

import numpy as np

from hexmj.view.live import LiveWalk, Moment

FRAME_RATE = 30.0
"""Frames per second."""

LONGEST_STEP = 0.1
"""Maximum simulated time per frame [s]; on a slow computer, the walk runs slower than real time."""

IMPULSE = 8.0
"""Default impulse of a push [body mass times V_p]; it moves the insect 20 mm to the side."""

LYING_TIME = 1.5
"""Time between a fall and the next start [s]."""


def ticks() -> Iterator[float]:
    """Yield the time since the last frame [s], at `FRAME_RATE`, forever."""
    last = time.perf_counter()
    while True:
        time.sleep(max(0.0, last + 1.0 / FRAME_RATE - time.perf_counter()))
        now = time.perf_counter()
        yield now - last
        last = now


class LiveSession:
    """A live walk in real time; after a fall it begins again at the next start.

    Attributes:
        walk: the live walk.
        start: number of its start.
        speed: speed of the view as a fraction of real time; viewers set it. 0 pauses the walk.
        message: error message of the last change, or "".
    """

    def __init__(self, walk: LiveWalk, start: int, starts: Callable[[int], np.ndarray]) -> None:
        """Show `walk`, which has the number `start`; `starts` returns a start, (leg,) [mm], by its number."""
        self.walk, self.start, self.speed, self.message = walk, start, 1.0, ""
        self._starts, self._tried, self._lying = starts, start, 0.0

    def tick(self, passed: float) -> Moment:
        """Advance the walk by `speed` times `passed` [s], and return its state."""
        self.walk.trace = []
        if not self.speed:
            return self.walk.moment
        if not self.walk.fell_on:
            if not self._succeeds(lambda: self.walk.advance(self.speed * min(passed, LONGEST_STEP))):
                self._succeeds(self.begin)
        elif (lying := self._lying + passed) < LYING_TIME:
            self._lying = lying
        else:
            self._succeeds(self.begin_next)
        return self.walk.moment

    def begin(self) -> None:
        """Restart the walk at the same start."""
        self._begin(self.start)

    def begin_next(self) -> None:
        """Restart the walk at the next start; if that fails, the next call tries the start after it."""
        self._begin(self._tried + 1)

    def attempt(self, change: Callable[[], object]) -> None:
        """Change the walk; if the change raises an error, `message` holds its text."""
        self.message = ""
        self._succeeds(change)

    def _begin(self, start: int) -> None:
        self._tried, self._lying = start, 0.0
        self.walk.begin(self._starts(start))
        self.start = start

    def _succeeds(self, change: Callable[[], object]) -> bool:
        try:
            change()
        except Exception as error:  # a controller can raise any error
            self.message = str(error)
            return False
        return True
