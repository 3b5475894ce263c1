"""Six legs that a rule lifts: what all rivals share, so that nothing differs between them but when legs are lifted.

A standing tip recedes at V_r and a swinging one goes ahead at V_p.  A swing ends at AEP_0; it begins when the rule says
so, and at PEP_min at the latest, beyond which no leg reaches.  So V, V_p, AEP_0 and PEP_min mean what they mean for the
1998 network, and every rival meets the same random starts.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from hexmj.checks import check_types, short
from hexmj.controllers.protocol import Sensed
from hexmj.errors import InputError
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import AT_SPEED, Acceleration, Stride, commanded_velocities
from hexmj.walks import PlannedWalk


@dataclass(frozen=True, eq=False)
class Legs:
    """What a rule knows of the legs at the end of a step."""

    x: np.ndarray
    """(start, leg) tips on their own axes [mm]."""
    stands: np.ndarray
    """(start, leg) which legs stand."""
    load: np.ndarray
    """(start, leg) share of the weight on each foot: on paper equal parts on all that stand, in physics as felt."""
    v: np.ndarray
    """(start, 1) V_r."""
    stride: Stride
    """Step range, lines of the tips and time step."""

    @property
    def travel(self) -> np.ndarray:
        """(start, leg) how far the tips are behind AEP_0, in ranges AEP_0 - PEP_0: 1 at PEP_0."""
        return (self.stride.aep0 - self.x) / (self.stride.aep0 - self.stride.pep0)

    def copied(self) -> "Legs":
        """The same, in arrays of which a rule may make what it likes."""
        return replace(self, x=self.x.copy(), stands=self.stands.copy(), v=self.v.copy())

    @property
    def stance_part(self) -> np.ndarray:
        """(start, 1) part of the period (AEP_0 - PEP_0) (1 + 1/V) for which a leg stands: 1 / (1 + V)."""
        return 1.0 / (1.0 + self.v)


def check_numbers(rule: Any) -> None:
    """Refuse a rule, a frozen dataclass, with a field of another type or a number that is not finite; its
    `__post_init__`.

    Raises:
        InputError: such a field.
    """
    check_types(rule)
    for one in fields(rule):
        if isinstance(value := getattr(rule, one.name), float) and not np.isfinite(value):
            raise InputError(f"{rule.name}: {one.name} = {value}; expected a finite number")


State = tuple[np.ndarray, ...]
"""What a rule remembers, a named tuple of arrays whose first axis is the start."""


class LiftingRule(Protocol):
    """A controller that only says which legs are lifted.  Both methods do every start by itself."""

    def at_start(self, legs: Legs) -> Any:
        """The `State` at time 0, when all legs stand."""
        ...

    def lifts(self, state: Any, legs: Legs) -> tuple[Any, np.ndarray]:
        """The state after a step in which the tips came to where they are, and which legs are lifted, (start, leg) of
        bool."""
        ...


class LiftedPlan:
    """A `protocol.SteerablePlan` of legs that a rule lifts."""

    def __init__(
        self,
        rule: LiftingRule,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None,
        age: int = 0,
    ) -> None:
        """At time 0; an acceleration has been going on for `age` steps."""
        self.starts, self.stride, self.done = checked_starts(starts, stride), stride, 0
        self._rule, self._acceleration = rule, acceleration
        self._final = checked_velocities(velocity, len(self.starts), acceleration)
        self._age = np.full(len(self.starts), age)
        self._legs = self._at_rest(self.starts)
        self._state: Any = _checked("at_start", rule.at_start(self._legs.copied()), len(self.starts))

    def advance(self, steps: int) -> PlannedWalk:
        """The next `steps` steps."""
        stride, shape = self.stride, (steps, *self.starts.shape)
        velocity = np.array(commanded_velocities(self._final, self._age, steps, stride, self._acceleration))
        x, stance = np.empty(shape), np.empty(shape, dtype=bool)
        for n in range(steps):
            self._step(velocity[n][:, None])
            x[n], stance[n] = self._legs.x, self._legs.stands
        self.done += steps
        self._age = self._age + steps
        time = np.arange(self.done - steps + 1, self.done + 1) * stride.dt
        y, aep, height = (np.broadcast_to(one, shape) for one in (stride.geometry.y, stride.aep0, np.nan))
        return PlannedWalk(time, velocity, x, y, stance, stride.geometry, aep=aep, height=height)

    @property
    def tips(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._legs.x

    @property
    def standing(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._legs.stands

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._legs = replace(self._legs, x=tips, stands=standing)

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self.slow_down(which)
        rest = self._at_rest(tips)
        fresh = _checked("at_start", self._rule.at_start(rest.copied()), len(tips))
        self._state = type(self._state)(*(_chosen(which, a, b) for a, b in zip(fresh, self._state, strict=True)))
        self.see(_chosen(which, tips, self.tips), _chosen(which, rest.stands, self.standing))

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._age = np.where(which, 0, self._age)

    def _at_rest(self, tips: np.ndarray) -> Legs:
        """All legs stand, and carry equal parts."""
        v = commanded_velocities(self._final, self._age, 1, self.stride, self._acceleration)[0]
        stands = np.ones(tips.shape, dtype=bool)
        return Legs(tips, stands, _equal_parts(stands), v[:, None], self.stride)

    def _step(self, v: np.ndarray) -> None:
        legs, dt = self._legs, self.stride.dt
        x = legs.x + np.where(legs.stands, -v * dt, dt)
        stands = legs.stands | (x > self.stride.aep0 - dt / 2)
        moved = Legs(x, stands, self._load(stands), v, self.stride)
        state, lifted = self._rule.lifts(self._state, moved.copied())
        self._state = _checked("lifts", state, len(x))
        if not (type(lifted) is np.ndarray and lifted.dtype == bool and lifted.shape == x.shape):
            raise InputError(
                f"lifts gave {short(lifted)} as lifted legs; expected True and False, (start, leg), {x.shape}"
            )
        self._legs = replace(moved, stands=stands & ~(lifted | (x - v * dt < self.stride.pep_min)))

    def _load(self, stands: np.ndarray) -> np.ndarray:
        """Share of the weight on each foot, as planned."""
        return _equal_parts(stands)


class LoadedPlan(LiftedPlan):
    """The same as a `protocol.FeedbackPlan`, whose rule knows how the weight is spread; nothing else is read."""

    _felt: np.ndarray | None = None

    def sense(self, sensed: Sensed) -> None:
        """Take in the loads; a start whose feet all hang in the air has none."""
        if self._felt is None:
            self._felt = np.full(self.starts.shape, np.nan)
        pressed = np.maximum(sensed.load, 0.0)  # where adhesion holds a foot that pulls there is no weight on it
        whole = pressed.sum(axis=1, keepdims=True)
        self._felt[sensed.ids] = np.divide(pressed, whole, out=np.zeros_like(pressed), where=whole > 0)

    def _load(self, stands: np.ndarray) -> np.ndarray:
        planned = _equal_parts(stands)
        return planned if self._felt is None else np.where(np.isnan(self._felt), planned, self._felt)


class Lifted:
    """What a `LiftingRule` needs to be a `protocol.SteerableController`."""

    reads_load = False
    """Whether the rule asks for the load."""

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> LiftedPlan:
        """See `protocol.Controller.begin`."""
        return self._plan(starts, velocity, stride, acceleration)

    def begin_at_speed(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> LiftedPlan:
        """See `protocol.SteerableController.begin_at_speed`."""
        return self._plan(starts, velocity, stride, acceleration, AT_SPEED)

    def _plan(self, *asked: Any) -> LiftedPlan:
        kind = LoadedPlan if self.reads_load else LiftedPlan
        return kind(self, *asked)  # pyright: ignore[reportArgumentType]


def from_neighbour(table: tuple[tuple[int, ...], ...], values: np.ndarray) -> np.ndarray:
    """(start, leg) the value of each leg's only neighbour in a table, `legs.N2` or `legs.N4`; 0 without one."""
    heard = np.zeros(values.shape)
    for leg, near in enumerate(table):
        for neighbour in near:
            heard[:, leg] = values[:, neighbour]
    return heard


def sum_of_legs(values: np.ndarray) -> np.ndarray:
    """Sum over (..., leg), (...); each side by itself, so that mirrored starts give mirrored bits."""
    return (values[..., 0] + values[..., 1] + values[..., 2]) + (values[..., 3] + values[..., 4] + values[..., 5])


def _equal_parts(stands: np.ndarray) -> np.ndarray:
    """Share of the weight on each foot if all that stand carry the same; none where none stands."""
    return stands / np.maximum(stands.sum(axis=1, keepdims=True), 1)


def _checked(method: str, state: Any, count: int) -> Any:
    """What a rule's method gave as its state if it is a `State` of so many starts."""
    named = isinstance(state, tuple) and hasattr(state, "_fields")
    if not (named and all(isinstance(one, np.ndarray) and one.shape[:1] == (count,) for one in state)):
        raise InputError(
            f"{method} gave {short(state)}; expected a named tuple of arrays whose first axis is the start, {count}"
        )
    return state


def _chosen(which: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Arrays of starts: `one` where `which`, (start,), says so, `other` elsewhere."""
    return np.where(which.reshape(-1, *[1] * (one.ndim - 1)), one, other)
