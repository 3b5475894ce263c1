"""What a controller is, what its plans say, and what a plan that reads the legs is told.

Data goes one way: a controller begins a plan for many starts at once; the plan is advanced step by step and says where
the tips shall be; on paper nothing comes back, in physics a plan that has a method `sense` is told before each step
what a robot would know.
"""

from dataclasses import dataclass, is_dataclass
from inspect import getattr_static
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np

from hexmj.checks import printable, short
from hexmj.errors import InputError
from hexmj.plain import plain
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk


@runtime_checkable
class Plan(Protocol):
    """A walk of many starts, planned as far as asked for.  The starts do not know of each other.

    One that lifts the feet itself may tell the `Conditions` that it is `made_for`; others refuse it.
    """

    @property
    def starts(self) -> np.ndarray:
        """(start, leg) tips at time 0 on their own axes [mm]; all stand."""
        ...

    @property
    def stride(self) -> Stride:
        """The time step and the lines of the tips."""
        ...

    @property
    def done(self) -> int:
        """Steps planned so far."""
        ...

    def advance(self, steps: int) -> PlannedWalk:
        """The next `steps` steps of all starts; divided into calls anyhow, they are the same walk."""
        ...


@dataclass(frozen=True, eq=False)
class Sensed:
    """What a robot knows of itself at the end of a step, for the starts that still walk; contact, load and torques are
    those of the beginning of its last physics step."""

    ids: np.ndarray
    """(n,) which starts these are: rows of the plan's own arrays."""
    tips: np.ndarray
    """(n, leg, axis) where the joint angles put the tips in the root frame: forward, left, up of O [mm]."""
    contact: np.ndarray
    """(n, leg) whether the ground carried the foot within the last `Conditions.contact_gap`."""
    gained: np.ndarray
    """(n, leg) contact now, and none a step before."""
    lost: np.ndarray
    """(n, leg) contact a step before, and none now."""
    load: np.ndarray
    """(n, leg) force of the ground along its normal [g mm/s^2]; an insect of 1 g weighs 9810.  Adhesion is taken off:
    below 0 it holds a foot that pulls."""
    joints: np.ndarray
    """(n, leg, joint) angles [rad]."""
    torques: np.ndarray
    """(n, leg, joint) of the servos [g mm^2/s^2]."""
    tilt: np.ndarray
    """(n, 2) by how much the axes of the root that point ahead and to the left dip below the level [rad]."""
    velocity: np.ndarray
    """(n, 3) of the root, ahead, to the left and up as seen from its heading [mm/s]."""
    turning: np.ndarray
    """(n, 3) angular velocity of the root in its own frame [rad/s]."""


@runtime_checkable
class FeedbackPlan(Plan, Protocol):
    """A plan that reads the legs.  On paper nobody tells it anything, and it takes everything to be as ordered."""

    def sense(self, sensed: Sensed) -> None:
        """Take in what is known before the next step is planned."""
        ...


@runtime_checkable
class SteerablePlan(Plan, Protocol):
    """A plan that can go on from other legs than its own, and begin anew.  What it is given is its own to keep."""

    @property
    def tips(self) -> np.ndarray:
        """(start, leg) where the tips are now, on their own axes [mm]."""
        ...

    @property
    def standing(self) -> np.ndarray:
        """(start, leg) which legs retract now."""
        ...

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Go on from these tips [mm] and states, both (start, leg)."""
        ...

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """Put some starts, (start,) of bool, at time 0 again, all legs standing at `tips`, (start, leg) [mm].

        They go on as a plan of `begin` does that begins there, to the last bit.
        """
        ...

    def slow_down(self, which: np.ndarray) -> None:
        """Let some starts, (start,) of bool, begin at V_r(0) of the acceleration again, their legs as they are; without
        one nothing changes."""
        ...


@runtime_checkable
class KnowsItsLimits(Protocol):
    """A controller whose `begin` refuses some velocities with some time steps, and that says so before any work."""

    def check_velocity(self, velocity: float, stride: Stride) -> None:
        """Refuse a V_r, a fraction of V_p, at which the stride's time step is too long.

        Raises:
            InputError: it is.
        """
        ...


def limits_within(wrapper: Any) -> Any:
    """`KnowsItsLimits.check_velocity` of the controller around which another one is; None where that knows of none."""
    return getattr(wrapper.controller, "check_velocity", None)


@runtime_checkable
class FastLosses(Plan, Protocol):
    """A plan with a faster way to its first losses of static stability than being advanced."""

    def first_losses(self, steps: np.ndarray) -> np.ndarray:
        """The first of each start's `steps`, (start,), that is statically unstable, counted from 1; 0 where none is.

        Asked of a plan at time 0, which nobody goes on with.  The same bits as `losses.planned_losses` finds.
        """
        ...


@runtime_checkable
class Controller(Protocol):
    """A frozen dataclass: its fields are its settings, plain data that tell two controllers apart.

    One that says `mirrored`, an attribute or property of its own that is True, claims that starts mirrored in the body
    axis give mirrored walks to the last bit; `conformance` holds it to that.
    """

    @property
    def name(self) -> str:
        """What it is called in tables and titles."""
        ...

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> Plan:
        """A new plan, as often as asked for; what it plans depends on nothing but these arguments.

        Args:
            starts: tips at time 0 on their own axes, all standing, (start, leg) [mm].
            velocity: V_r, or its final value when accelerating, (start,), 0 <= V_r < 1: a standing tip moves V_r mm to
                the rear, and a swinging one 1 mm ahead, in a time unit.
            stride: step range, lines of the tips and time step.
            acceleration: Eq. 11; `timing.commanded_velocities` gives V_r at each step.
            threads: one per core unless given; the plan does not depend on it.
        """
        ...


@runtime_checkable
class SteerableController(Controller, Protocol):
    """A controller whose plans are `SteerablePlan`s, which feedback and disturbances need."""

    def begin_at_speed(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> SteerablePlan:
        """A plan that walks at its final velocity at once; an acceleration takes place only after `slow_down` or
        `restart`."""
        ...


def is_steerable(controller: object) -> TypeGuard[SteerableController]:
    """Whether a controller is a `SteerableController` itself: not one that hands on `begin_at_speed` of another, or
    whose class has changed `begin` alone."""
    return isinstance(controller, SteerableController) and goes_with(type(controller), "begin_at_speed", "begin")


def goes_with(kind: type, method: str, other: str) -> bool:
    """Whether a class has a method that was made for its other one: no heir has changed the other one alone.

    Classes that have the method without the other one are passed over; where all do, it goes with any.
    """
    having = [one for one in kind.__mro__ if method in vars(one)]
    knowing = next((one for one in having if hasattr(one, other)), None)
    return bool(having) and (knowing is None or getattr_static(knowing, other) is getattr_static(kind, other))


def check_steerable(controller: Controller) -> None:
    """Refuse a controller that is no `SteerableController`.

    Raises:
        InputError: it is none.
    """
    if is_steerable(controller):
        return
    alone = ", in a class that defines its begin, too" if hasattr(type(controller), "begin_at_speed") else ""
    raise InputError(
        f"{controller.name} cannot be disturbed; expected a controller whose plans can go on from other legs, with"
        f" begin_at_speed{alone}, as the 1998 network has"
    )


def check_controller_type(controller: object) -> None:
    """Refuse what is no controller.

    Raises:
        InputError: no frozen dataclass with a name and a method `begin`.
    """
    try:
        well = is_dataclass(controller) and not isinstance(controller, type) and isinstance(controller, Controller)
    except Exception:  # of a property of a user's own
        well = False
    if not well:
        raise InputError(
            f"controller = {short(controller)}; expected a controller, a frozen dataclass with a name and a method"
            " begin, as a preset or hexmj.load_controller gives one"
        )
    printable("a controller's name", controller.name)  # pyright: ignore[reportAttributeAccessIssue]


def claims_mirrored(controller: Controller) -> bool:
    """Whether a controller claims that mirrored starts give mirrored walks, see `Controller`."""
    return bool(getattr(controller, "mirrored", False))


def settings_of(controller: Controller) -> dict[str, Any]:
    """A controller's settings as plain data: numbers, texts, lists and dicts.

    Raises:
        InputError: no controller, or a field that is no plain data.
    """
    check_controller_type(controller)
    return _without_classes(plain(controller))


def _without_classes(value: Any) -> Any:
    """Plain settings without the names of their classes; a member of an enumeration as its name."""
    if isinstance(value, dict):
        if value.keys() == {"class", "member"}:
            return value["member"]
        return {key: _without_classes(item) for key, item in value.items() if key != "class"}
    return [_without_classes(item) for item in value] if isinstance(value, list) else value
