"""Six legs that a rule lifts: the common part of all baselines, which differ only in when legs are lifted.

A standing tip recedes at V_r and a swinging one moves ahead at V_p. A swing ends at AEP_0; it begins when the rule says
so, and at PEP_min at the latest, beyond which no leg reaches. So V, V_p, AEP_0 and PEP_min mean the same as for the
1998 network, and every baseline walks from the same random starts.
"""

from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Protocol, get_args, get_origin, get_type_hints

import numpy as np

from hexmj.controllers.protocol import Sensed
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import AT_SPEED, Acceleration, Stride, commanded_velocities
from hexmj.validate import choice, number
from hexmj.walks import PlannedWalk


@dataclass(frozen=True, eq=False)
class Legs:
    """The legs at the end of a step, as a rule knows them."""

    x: np.ndarray
    """(start, leg) tips on their own axes [mm]."""
    stands: np.ndarray
    """(start, leg) which legs stand."""
    load: np.ndarray
    """(start, leg) share of the weight on each foot: in a kinematic walk equal on all that stand, in a physical one
    measured."""
    v: np.ndarray
    """(start, 1) V_r."""
    stride: Stride
    """Step range, lines of the tips and time step."""

    @property
    def travel(self) -> np.ndarray:
        """(start, leg) distance of the tips behind AEP_0, as a fraction of AEP_0 - PEP_0: 1 at PEP_0."""
        return (self.stride.aep0 - self.x) / (self.stride.aep0 - self.stride.pep0)

    def copied(self) -> "Legs":
        """Return a copy that a rule may change."""
        return replace(self, x=self.x.copy(), stands=self.stands.copy(), v=self.v.copy())

    @property
    def stance_part(self) -> np.ndarray:
        """(start, 1) fraction of the period (AEP_0 - PEP_0) (1 + 1/V) for which a leg stands: 1 / (1 + V)."""
        return 1.0 / (1.0 + self.v)


def check_numbers(rule: Any) -> None:
    """Validate floats and `Literal`s of a frozen dataclass. Use as `__post_init__`."""
    hints = get_type_hints(type(rule))
    for name in (field.name for field in fields(rule)):
        if hints[name] is float:
            object.__setattr__(rule, name, number(name, getattr(rule, name), -MOST, MOST))
        elif get_origin(hints[name]) is Literal:
            choice(name, getattr(rule, name), get_args(hints[name]))


MOST = 1.7e308
"""Greatest finite number that a field may have."""


class LiftingRule(Protocol):
    """A controller that only decides which legs are lifted. Both methods treat every start independently."""

    def at_start(self, legs: Legs) -> Any:
        """Return the state at time 0, when all legs stand: a named tuple of arrays whose first axis is the start."""
        ...

    def lifts(self, state: Any, legs: Legs) -> tuple[Any, np.ndarray]:
        """Return the state after the step that moved the legs, and which legs are lifted now, (start, leg) of bool."""
        ...


class LiftedPlan:
    """A `protocol.SteerablePlan` whose legs a rule lifts."""

    def __init__(
        self,
        rule: LiftingRule,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None,
        age: int = 0,
    ) -> None:
        """Begin at time 0; an acceleration began `age` steps earlier."""
        self.starts, self.stride, self.done = checked_starts(starts, stride), stride, 0
        self._rule, self._acceleration = rule, acceleration
        self._final = checked_velocities(velocity, len(self.starts), acceleration)
        self._age = np.full(len(self.starts), age)
        self._legs = self._at_rest(self.starts)
        self._state: Any = rule.at_start(self._legs.copied())

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps."""
        stride, shape = self.stride, (steps, *self.starts.shape)
        velocity = np.array(commanded_velocities(self._final, self._age, steps, stride, self._acceleration))
        x, stance = np.empty(shape), np.empty(shape, dtype=bool)
        for n in range(steps):
            self._step(velocity[n][:, None])
            x[n], stance[n] = self._legs.x, self._legs.stands
        self.done += steps
        self._age = self._age + steps
        time = np.arange(self.done - steps + 1, self.done + 1) * stride.dt
        y, aep, height = (np.broadcast_to(value, shape) for value in (stride.geometry.y, stride.aep0, np.nan))
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
        fresh = self._rule.at_start(rest.copied())
        self._state = type(self._state)(*(_chosen(which, a, b) for a, b in zip(fresh, self._state, strict=True)))
        self.see(_chosen(which, tips, self.tips), _chosen(which, rest.stands, self.standing))

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._age = np.where(which, 0, self._age)

    def _at_rest(self, tips: np.ndarray) -> Legs:
        """Return legs that all stand and carry equal parts of the weight."""
        v = commanded_velocities(self._final, self._age, 1, self.stride, self._acceleration)[0]
        stands = np.ones(tips.shape, dtype=bool)
        return Legs(tips, stands, _equal_parts(stands), v[:, None], self.stride)

    def _step(self, v: np.ndarray) -> None:
        legs, dt = self._legs, self.stride.dt
        x = legs.x + np.where(legs.stands, -v * dt, dt)
        stands = legs.stands | (x > self.stride.aep0 - dt / 2)
        moved = Legs(x, stands, self._load(stands), v, self.stride)
        self._state, lifted = self._rule.lifts(self._state, moved.copied())
        self._legs = replace(moved, stands=stands & ~(lifted | (x - v * dt < self.stride.pep_min)))

    def _load(self, stands: np.ndarray) -> np.ndarray:
        """Return the share of the weight on each foot, as planned."""
        return _equal_parts(stands)


class LoadedPlan(LiftedPlan):
    """The same with the measured load as sensory feedback, a `protocol.FeedbackPlan`; nothing else is sensed."""

    _felt: np.ndarray | None = None

    def sense(self, sensed: Sensed) -> None:
        """Receive the loads; a start whose feet are all in the air has none."""
        if self._felt is None:
            self._felt = np.full(self.starts.shape, np.nan)
        pressed = np.maximum(sensed.load, 0.0)  # a foot that pulls and is held by adhesion carries no weight
        total = pressed.sum(axis=1, keepdims=True)
        self._felt[sensed.ids] = np.divide(pressed, total, out=np.zeros_like(pressed), where=total > 0)

    def _load(self, stands: np.ndarray) -> np.ndarray:
        planned = _equal_parts(stands)
        return planned if self._felt is None else np.where(np.isnan(self._felt), planned, self._felt)


class Lifted:
    """Base class that makes a `LiftingRule` a `protocol.SteerableController`."""

    reads_load = False
    """Whether the rule uses the load."""

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> LiftedPlan:
        """See `protocol.Controller.begin`."""
        return self._plan(starts, velocity, stride, acceleration)

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> LiftedPlan:
        """See `protocol.SteerableController.begin_at_speed`."""
        return self._plan(starts, velocity, stride, acceleration, AT_SPEED)

    def _plan(self, *arguments: Any) -> LiftedPlan:
        kind = LoadedPlan if self.reads_load else LiftedPlan
        return kind(self, *arguments)  # pyright: ignore[reportArgumentType]


def from_neighbour(table: tuple[tuple[int, ...], ...], values: np.ndarray) -> np.ndarray:
    """Return the value of each leg's only neighbour in a table, `legs.N2` or `legs.N4`, (start, leg); 0 without one."""
    received = np.zeros(values.shape)
    for leg, near in enumerate(table):
        for neighbour in near:
            received[:, leg] = values[:, neighbour]
    return received


def sum_of_legs(values: np.ndarray) -> np.ndarray:
    """Return the sum over legs, (..., leg) to (...), side by side, so that mirrored starts give mirrored bits."""
    return (values[..., 0] + values[..., 1] + values[..., 2]) + (values[..., 3] + values[..., 4] + values[..., 5])


def _equal_parts(stands: np.ndarray) -> np.ndarray:
    """Return the share of the weight on each foot if all standing feet carry the same; 0 where none stands."""
    return stands / np.maximum(stands.sum(axis=1, keepdims=True), 1)


def _chosen(which: np.ndarray, chosen: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return `chosen` for the starts in `which`, (start,), and `other` elsewhere."""
    return np.where(which.reshape(-1, *[1] * (chosen.ndim - 1)), chosen, other)
