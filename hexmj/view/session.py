"""What every viewer shows: a live walk or a recording, in the time on the wall."""

import time
from collections import deque
from collections.abc import Callable, Iterator

import numpy as np

from hexmj.errors import InputError, SimulationError
from hexmj.replay.take import Take
from hexmj.view.live import LiveWalk, Moment

HZ = 30.0
"""Pictures in a second."""

LONGEST = 0.1
"""Most time that is made up for at once [s]; who is slower than that falls behind the time on the wall."""

IMPULSE = 8.0
"""Of a push, unless another is asked for, in multiples of mass times V_p: it shoves the insect 20 mm aside."""

LIES = 1.5
"""How long a fallen insect lies until it begins at the next start [s]."""

RECENT = 60
"""Pictures over which the factor is measured."""


def ticks() -> Iterator[float]:
    """Seconds since the last picture, whenever one is due, for ever."""
    last = time.perf_counter()
    while True:
        time.sleep(max(0.0, last + 1.0 / HZ - time.perf_counter()))
        now = time.perf_counter()
        yield now - last
        last = now


class LiveSession:
    """A live walk in the time on the wall; one that has fallen begins again, at the next start."""

    def __init__(self, walk: LiveWalk, start: int, starts: Callable[[int], np.ndarray]) -> None:
        """Around a walk from the start of this number; `starts` tells a start, (leg,) [mm], by its number."""
        self.walk, self._starts, self._lies = walk, starts, 0.0
        self.start = self._tried = start
        self._recent: deque[tuple[float, float]] = deque(maxlen=RECENT)
        self.paused, self.told = False, ""

    @property
    def factor(self) -> float:
        """Seconds walked for a second on the wall, lately."""
        wall = sum(one for one, _ in self._recent)
        return sum(one for _, one in self._recent) / wall if wall else 1.0

    def tick(self, passed: float) -> Moment:
        """Let so much time pass [s]."""
        self.walk.trace = []
        if self.paused:
            return self.walk.moment
        before = self.walk.moment.seconds
        if not self.walk.fell_on:
            if not self._done(lambda: self.walk.advance(min(passed, LONGEST))):
                self._done(self.begin)
            self._recent.append((passed, max(0.0, self.walk.moment.seconds - before)))
        elif (lies := self._lies + passed) < LIES:
            self._lies = lies
        else:
            self._done(self.begin_next)
        return self.walk.moment

    def begin(self) -> None:
        """Begin again at the same start."""
        self._begin(self.start)

    def begin_next(self) -> None:
        """Begin at the next start; one that cannot be walked is passed over when this is called again."""
        self._begin(self._tried + 1)

    def attempt(self, wish: Callable[[], object]) -> None:
        """Do to the walk what somebody wishes, and tell why where that makes no sense."""
        self.told = ""
        self._done(wish)

    def _begin(self, start: int) -> None:
        self._tried, self._lies = start, 0.0
        self.walk.begin(self._starts(start))
        self.start = start
        self._recent.clear()

    def _done(self, change: Callable[[], object]) -> bool:
        try:
            change()
        except (InputError, SimulationError) as error:
            self.told = str(error)
            return False
        return True


class ReplaySession:
    """A recording, again and again, at half the speed of the time on the wall."""

    def __init__(self, take: Take) -> None:
        """About to begin."""
        self.take, self._seconds, self.paused = take, 0.0, False

    def tick(self, passed: float) -> int:
        """Let so much time pass [s]; tells the step that is seen."""
        if not self.paused:
            self._seconds = (self._seconds + passed / 2) % (self.take.end - self.take.begin + LIES)
        return self.take.row(self.take.begin + self._seconds)
