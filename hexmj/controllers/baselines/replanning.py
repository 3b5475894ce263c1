"""A gait on five legs, and a controller that changes to it when the loss of a leg is announced.

The planner searches step lengths and phases of periodic gaits on the five remaining legs, whose steps end at AEP_0, for
the greatest minimum of the stability margin over a period. It then plans two periods of the best gaits from the present
posture, beginning at several moments of the gait, and chooses the plan that is least unstable. From then on, a clock
lifts the legs. Stick insects that lose a leg also change the phases of the others (Graham 1977, J. comp. Physiol. 116,
91); their gaits are not copied. Fitted by us: nothing. Sensed: nothing.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from hexmj.controllers.baselines.lifted import Legs, Lifted, LiftedPlan
from hexmj.controllers.protocol import check_steerable
from hexmj.controllers.wrappers import WrappedSteerablePlan, Wrapper
from hexmj.stability import margins, walk_margin
from hexmj.timing import AT_SPEED, Acceleration, Stride
from hexmj.validate import number, whole
from hexmj.walks import PlannedWalk, joined

PHASES = 13
"""Number of phases of each leg that are searched; a swing at V = 0.3 lasts three thirteenths of the period."""

LENGTHS = (1.0, 0.8, 0.6)
"""Step lengths that are searched, as fractions of AEP_0 - PEP_0."""

GAITS = 60
"""Number of gaits of each length, those with the widest margins, from which the plan of a start is chosen."""

MOMENTS = 26
"""Number of moments of a period at which the margin of a gait is computed; it can begin at every second one."""

LEAST = 0.02
"""V_r below which the clock runs as at this velocity."""

TIE = 0.01
"""Weight of the least margin beside the sum of negative margins; it decides between stable plans."""

COARSE = 1.0
"""Time step of the plans that compare all beginnings [time units]."""

FINALISTS = 30
"""Number of beginnings of each start that are compared with the time step of the plan."""

AHEAD = 175.0
"""Duration of these plans [time units]: two periods at V = 0.3."""


class Beat(NamedTuple):
    """State of a clock with its own gait for each start."""

    time: np.ndarray
    """(start, 1) time of the clock [periods]."""
    swings: np.ndarray
    """(start, leg) number of the swing that began last."""
    lag: np.ndarray
    """(start, leg) lag of the swings behind the clock [periods]."""
    length: np.ndarray
    """(start, 1) step length as a fraction of AEP_0 - PEP_0."""


@dataclass(frozen=True)
class FiveLegs(Lifted):
    """A clock that lifts the remaining legs with the phases of a stable gait on five legs."""

    lost: int = 0
    """Index of the lost leg."""
    name: str = "five-legs"

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("lost", self.lost, 0, 5)

    def at_start(self, legs: Legs) -> Beat:
        """Choose the gait, and the moment at which it begins, of the least unstable of many plans."""
        time, lag, length = np.zeros_like(legs.v), np.zeros(legs.x.shape), np.ones_like(legs.v)
        for v in np.unique(legs.v).tolist():
            own = legs.v[:, 0] == v
            posture = legs.x[own].tobytes(), legs.stands[own].tobytes()
            time[own], lag[own], length[own] = _best_beginnings(self.lost, v, legs.stride, *posture)
        return Beat(time, np.floor(time - lag), lag, length)

    def lifts(self, state: Beat, legs: Legs) -> tuple[Beat, np.ndarray]:
        """See `Lifted.lifts`."""
        time = state.time + legs.stride.dt / legs.stride.periods(np.maximum(legs.v, LEAST)) / state.length
        swings = np.floor(time - state.lag)
        return state._replace(time=time, swings=np.maximum(swings, state.swings)), swings > state.swings


@dataclass(frozen=True, eq=False)
class _Begun(FiveLegs):
    """A gait on five legs that begins with a given state."""

    beat: Any = None

    def at_start(self, legs: Legs) -> Beat:
        """See `Lifted.at_start`."""
        return self.beat


@dataclass(frozen=True)
class Replanning(Wrapper):
    """A controller that changes to a gait on five legs when the loss of a leg is announced."""

    lost: int | None = None
    """Index of the lost leg; None for none."""
    lost_at: float = 0.0
    """Time of the loss [time units]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_steerable(self.controller)
        if self.lost is not None:
            whole("lost", self.lost, 0, 5)
        number("lost_at", self.lost_at, 0.0)

    @property
    def name(self) -> str:
        """Name of the wrapped controller, followed by ', re-plans'."""
        return f"{self.controller.name}, re-plans"

    def after_loss(self, leg: int, time: float) -> "Replanning":
        """See `protocol.Controller`."""
        return replace(self, lost=leg, lost_at=time)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> Any:
        """See `protocol.Controller.begin`."""
        plan = self.controller.begin(starts, velocity, stride, acceleration, threads)
        return self._replanned(plan, velocity, acceleration, 0)

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> Any:
        """See `protocol.SteerableController.begin_at_speed`."""
        controller: Any = self.controller
        plan = controller.begin_at_speed(starts, velocity, stride, acceleration, threads)
        return self._replanned(plan, velocity, acceleration, AT_SPEED)

    def _replanned(self, plan: Any, velocity: np.ndarray, acceleration: Acceleration | None, age: int) -> Any:
        if self.lost is None:
            return plan
        return ReplannedPlan(plan, FiveLegs(self.lost), self.lost_at, velocity, acceleration, age)


class ReplannedPlan(WrappedSteerablePlan):
    """A `protocol.SteerablePlan` that another plan continues from a time on."""

    def __init__(
        self,
        plan: Any,
        next_gait: FiveLegs,
        time: float,
        velocity: np.ndarray,
        acceleration: Acceleration | None,
        age: int,
    ) -> None:
        """Wrap a plan at time 0 that walks at `velocity`, (start,); the acceleration began `age` steps before."""
        super().__init__(plan)
        self._next_gait, self._step = next_gait, round(time / plan.stride.dt)
        self._velocity, self._acceleration, self._age = velocity, acceleration, age

    def set_velocity(self, velocity: np.ndarray) -> None:
        """See `protocol.Plan`."""
        self._velocity = velocity
        super().set_velocity(velocity)

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        before, parts = max(0, min(steps, self._step - self.done)), []
        if before:
            parts.append(self._plan.advance(before))
        if self._step == self.done + before and steps > before:
            tips, standing = self._plan.tips.copy(), self._plan.standing.copy()
            age = self._age + self._step
            how = self._velocity, self.stride, self._acceleration, age
            self._plan = LiftedPlan(self._next_gait, tips, *how, stands=standing)
        if steps > before:
            parts.append(self._plan.advance(steps - before))
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt
        return replace(joined(parts), time=time)


@lru_cache(maxsize=16)
def _best_beginnings(lost: int, velocity: float, stride: Stride, tips: bytes, stands: bytes) -> tuple[np.ndarray, ...]:
    """Return time, (start, 1), lags, (start, leg), and step lengths, (start, 1), that suit each start best."""
    posture, v = (np.frombuffer(tips).reshape(-1, 6), np.frombuffer(stands, bool).reshape(-1, 6)), max(velocity, LEAST)
    lengths, gaits = five_legged_gaits(lost, v, stride)
    moments = np.arange(0, MOMENTS, 2) / MOMENTS
    every = np.arange(len(gaits))[None]
    scores = [_scores(lost, v, replace(stride, dt=COARSE), posture, m, lengths[every], gaits[every]) for m in moments]
    chosen = np.argsort(-np.concatenate(scores, axis=1), axis=1, kind="stable")[:, :FINALISTS]
    time, gait = moments[chosen // len(gaits)], chosen % len(gaits)
    best = _scores(lost, v, stride, posture, time, lengths[gait], gaits[gait]).argmax(axis=1)
    each = np.arange(len(gait))
    gait = gait[each, best]
    return time[each, best, None], gaits[gait], lengths[gait, None]


def _scores(
    lost: int,
    velocity: float,
    stride: Stride,
    posture: tuple[np.ndarray, np.ndarray],
    time: Any,
    length: np.ndarray,
    lag: np.ndarray,
) -> np.ndarray:
    """Return how stable plans are, (start, plan): the sum of their negative margins, and a share of the least margin.

    Args:
        lost: index of the lost leg.
        velocity: V_r.
        stride: step range, lines of the tips and time step.
        posture: tips of the starts, (start, leg) [mm], and whether the legs stand.
        time: time of the clock at the beginning, one number or (start, plan) [periods].
        length: step lengths, (start, plan) or (1, plan).
        lag: lags of the gaits, (start, plan, leg) or (1, plan, leg).
    """
    shape = len(posture[0]), length.shape[1]
    time, length = (np.broadcast_to(values, shape).reshape(-1, 1) for values in (time, length))
    lag, (x, stands) = (
        np.broadcast_to(lag, (*shape, 6)).reshape(-1, 6),
        (np.repeat(part, shape[1], axis=0) for part in posture),
    )
    beat = Beat(time, np.floor(time - lag), lag, length)
    plan = LiftedPlan(_Begun(lost, beat=beat), x, np.full(len(x), velocity), stride, None, stands=stands)
    unstable, least = np.zeros(len(x)), np.full(len(x), np.inf)
    for _ in range(int(AHEAD)):
        walk = plan.advance(max(1, round(1.0 / stride.dt)))
        margin = walk_margin(replace(walk, stance=walk.stance & (np.arange(6) != lost)), threads=1)
        unstable += np.minimum(margin, 0.0).sum(axis=0)
        least = np.minimum(least, margin.min(axis=0))
    return (unstable + TIE * least).reshape(shape)


@lru_cache(maxsize=64)
def five_legged_gaits(lost: int, velocity: float, stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Return the `GAITS` gaits on five legs with the widest margins, for each step length.

    Args:
        lost: index of the lost leg.
        velocity: V_r of the walk, above 0.
        stride: step range and lines of the tips.

    Returns:
        Step lengths as fractions of AEP_0 - PEP_0, (gait,), and lags of the swings behind a clock [periods],
        (gait, leg); the lag of the lost leg is 0.
    """
    legs = [leg for leg in range(6) if leg != lost]
    lags = np.insert(np.array(list(product(range(PHASES), repeat=4))) / PHASES, 0, 0.0, axis=1)
    swing = velocity / (1.0 + velocity)
    phase = (np.arange(MOMENTS)[:, None] / MOMENTS - lags[:, None]) % 1.0  # (gait, moment, leg); 0 is lift-off
    back = np.where(phase < swing, 1.0 - phase / swing, (phase - swing) / (1.0 - swing))
    feet, stance = np.zeros((*phase.shape[:2], 6, 2)), np.zeros((*phase.shape[:2], 6), dtype=bool)
    feet[..., 1], stance[..., legs] = stride.geometry.y, phase >= swing
    front, span, found = np.array(stride.geometry.origin)[legs] + stride.aep0, stride.aep0 - stride.pep0, []
    for length in LENGTHS:
        feet[..., legs, 0], margin = front - length * span * back, np.empty(len(lags) * MOMENTS)
        margins(feet.reshape(-1, 6, 2), stance.reshape(-1, 6), margin)
        found.append(lags[np.argsort(-margin.reshape(-1, MOMENTS).min(axis=1), kind="stable")[:GAITS]])
    return np.repeat(LENGTHS, GAITS), np.insert(np.concatenate(found), lost, 0.0, axis=1)
