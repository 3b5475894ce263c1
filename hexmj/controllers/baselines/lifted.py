"""The common part of all baselines, which differ only in the rule that decides when a leg is lifted.

A standing tip recedes at V_r, a swinging tip moves ahead at V_p. A swing ends at AEP_0; it begins when the rule lifts
the leg, at the latest at PEP_min, the end of the leg's reach. So V, V_p, AEP_0 and PEP_min mean the same as for the
1998 network, and every baseline walks from the same random starts.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from hexmj.controllers.protocol import Sensed
from hexmj.controllers.stepwise import Step, StepwisePlan
from hexmj.starts import checked_starts, checked_velocities
from hexmj.timing import AT_SPEED, Stride, commanded_velocities
from hexmj.validate import choice, number


@dataclass(frozen=True, eq=False)
class Legs:
    """The legs at the end of a step: all that a rule can use."""

    x: np.ndarray
    """(start, leg) tips on their own axes [mm]."""
    stands: np.ndarray
    """(start, leg) True for legs that stand."""
    load: np.ndarray
    """(start, leg) share of the weight on each foot: equal for all standing feet in a kinematic walk, measured in a
    physical walk."""
    v: np.ndarray
    """(start, 1) V_r during the step."""
    stride: Stride
    """Step range, lines of the tips and time step."""

    @property
    def travel(self) -> np.ndarray:
        """(start, leg) distance of the tips behind AEP_0 as a fraction of AEP_0 - PEP_0: 0 at AEP_0, 1 at PEP_0."""
        return (self.stride.aep0 - self.x) / (self.stride.aep0 - self.stride.pep0)

    @property
    def stance_part(self) -> np.ndarray:
        """(start, 1) duty factor 1 / (1 + V): fraction of the period (AEP_0 - PEP_0) (1 + 1/V) when a leg stands."""
        return 1.0 / (1.0 + self.v)


class LiftedPlan(StepwisePlan):
    """A `protocol.SteerablePlan` whose legs a rule lifts; also a `protocol.FeedbackPlan` if the rule uses the load."""

    def __init__(self, rule: "Lifted", starts, velocity, stride, acceleration, age=0, stands=None) -> None:
        """Begin at time 0, see `protocol.Controller.begin`, with an acceleration that began `age` steps before.

        By default all legs stand; `stands`, (start, leg), are those that do.
        """
        x = checked_starts(starts, stride)
        v = checked_velocities(velocity, len(x), acceleration)
        super().__init__(self._step, x, v, stride, acceleration, np.full(len(x), age))
        self._rule, self._felt = rule, np.full(x.shape, np.nan)
        self._legs = self._at_rest(x) if stands is None else replace(self._at_rest(x), stands=stands)
        self._state: Any = rule.at_start(self._legs)
        if rule.reads_load:
            self.sense = self._feel

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
        self._state = _chosen(which, self._rule.at_start(rest), self._state)
        self.see(_chosen(which, tips, self.tips), _chosen(which, rest.stands, self.standing))

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self.age = np.where(which, 0, self.age)

    def _at_rest(self, tips: np.ndarray) -> Legs:
        """Return legs that all stand at `tips` and carry equal shares of the weight."""
        v = commanded_velocities(self.velocity, self.age, 1, self.stride, self.acceleration)[0]
        stands = np.ones(tips.shape, dtype=bool)
        return Legs(tips, stands, _equal_parts(stands), v[:, None], self.stride)

    def _step(self, velocity: np.ndarray) -> Step:
        legs, dt, v = self._legs, self.stride.dt, velocity[:, None]
        x = legs.x + np.where(legs.stands, -v * dt, dt)
        stands = legs.stands | (x > self.stride.aep0 - dt / 2)
        load = np.where(np.isnan(self._felt), _equal_parts(stands), self._felt)
        moved = Legs(x, stands, load, v, self.stride)
        self._state, lifted = self._rule.lifts(self._state, moved)
        self._legs = replace(moved, stands=stands & ~(lifted | (x - v * dt < self.stride.pep_min)))
        return Step(self._legs.x, self._legs.stands)

    def _feel(self, sensed: Sensed) -> None:
        """Receive the sensed loads as shares of the weight; all are 0 if all feet of a start are in the air."""
        pressed = np.maximum(sensed.load, 0.0)  # a foot that pulls carries no weight
        total = pressed.sum(axis=1, keepdims=True)
        self._felt[sensed.ids] = np.divide(pressed, total, out=np.zeros_like(pressed), where=total > 0)


class Lifted:
    """Base class that turns a rule for lifting legs into a `protocol.SteerableController`.

    The rule's methods, `at_start` and `lifts`, treat every start independently and do not change their arguments.
    """

    reads_load = False
    """Whether the rule uses the load on the feet, the only sense that rules can have."""

    def __post_init__(self) -> None:
        """Validate the fields of the dataclass that are floats or `Literal`s."""
        for name, kind in get_type_hints(type(self)).items():
            if kind is float:
                object.__setattr__(self, name, number(name, getattr(self, name)))
            elif get_origin(kind) is Literal:
                choice(name, getattr(self, name), get_args(kind))

    def at_start(self, legs: Legs) -> Any:
        """Return the state at time 0, when all legs stand: an array whose first axis is the start, or a named tuple."""
        raise NotImplementedError

    def lifts(self, state: Any, legs: Legs) -> tuple[Any, np.ndarray]:
        """Return the state after the step, and which legs are lifted at its end, (start, leg) of bool."""
        raise NotImplementedError

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> LiftedPlan:
        """See `protocol.Controller.begin`."""
        return LiftedPlan(self, starts, velocity, stride, acceleration)

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> LiftedPlan:
        """See `protocol.SteerableController.begin_at_speed`."""
        return LiftedPlan(self, starts, velocity, stride, acceleration, AT_SPEED)


def from_neighbour(table: tuple[tuple[int, ...], ...], values: np.ndarray) -> np.ndarray:
    """Return the value of each leg's neighbour in `legs.N2` or `legs.N4`, (start, leg); 0 without a neighbour."""
    received = np.zeros(values.shape)
    for leg, near in enumerate(table):
        for neighbour in near:
            received[:, leg] = values[:, neighbour]
    return received


def sum_of_legs(values: np.ndarray) -> np.ndarray:
    """Return the sum over the last axis, leg; it sums each side first, so that mirrored starts give mirrored bits."""
    return (values[..., 0] + values[..., 1] + values[..., 2]) + (values[..., 3] + values[..., 4] + values[..., 5])


def _equal_parts(stands: np.ndarray) -> np.ndarray:
    """Return the share of the weight on each foot if all standing feet carry the same; 0 if no foot stands."""
    return stands / np.maximum(stands.sum(axis=1, keepdims=True), 1)


def _chosen(which: np.ndarray, chosen: Any, other: Any) -> Any:
    """Return `chosen` where `which`, (start,), is True, else `other`; both are arrays or named tuples of arrays."""
    if isinstance(chosen, tuple):
        return type(chosen)(*(_chosen(which, *pair) for pair in zip(chosen, other, strict=True)))
    return np.where(which.reshape(-1, *[1] * (chosen.ndim - 1)), chosen, other)
