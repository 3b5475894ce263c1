"""The interface of controllers: what a controller, its plans and the sensed state of the legs are.

Data goes one way. A controller begins a plan for many starts at once, the plan is advanced step by step and returns the
tips. In a kinematic walk nothing comes back. In a physical walk a plan with a method `sense` receives the state of the
legs before each step.
"""

from dataclasses import dataclass, is_dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from hexmj.errors import InputError
from hexmj.plain import plain
from hexmj.timing import Acceleration, Stride
from hexmj.validate import short
from hexmj.walks import PlannedWalk


@runtime_checkable
class Plan(Protocol):
    """A walk of many independent starts, planned as far as it was advanced.

    A plan that lifts the feet itself may have an attribute `made_for`, the `Conditions` it fits; physical walks under
    other conditions are then refused. A plan may have a method `first_losses(steps)`, called once at time 0: a faster
    way to the result of `planning.planned_losses`.
    """

    starts: np.ndarray
    """(start, leg) tips at time 0 on their own axes, all standing [mm]."""
    stride: Stride
    """Time step and lines of the tips."""
    done: int
    """Number of steps planned so far."""

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps of all starts; the walk does not depend on how steps are divided into calls."""
        ...


@dataclass(frozen=True, eq=False)
class Sensed:
    """What a robot can sense at the end of a step, for the n starts that still walk.

    Contact, load and torques are those at the beginning of the last physics step.
    """

    ids: np.ndarray
    """(n,) indices of these starts in the plan."""
    tips: np.ndarray
    """(n, leg, axis) tips by the joint angles, in the root frame: forward, left and up of O [mm]."""
    contact: np.ndarray
    """(n, leg) whether the ground carried the foot within the last `Conditions.contact_gap`."""
    gained: np.ndarray
    """(n, leg) contact now, but not one step before."""
    lost: np.ndarray
    """(n, leg) contact one step before, but not now."""
    load: np.ndarray
    """(n, leg) normal force of the ground [g mm/s^2]; an insect of 1 g weighs 9810. Adhesion is subtracted: the load is
    negative where adhesion holds a foot that pulls."""
    joints: np.ndarray
    """(n, leg, joint) angles [rad]."""
    torques: np.ndarray
    """(n, leg, joint) of the servos [g mm^2/s^2]."""
    tilt: np.ndarray
    """(n, 2) angles by which the root's forward and left axes point below the horizontal [rad]."""
    velocity: np.ndarray
    """(n, 3) velocity of the root along its heading, to its left and up [mm/s]."""
    turning: np.ndarray
    """(n, 3) angular velocity of the root in its own frame [rad/s]."""


@runtime_checkable
class FeedbackPlan(Plan, Protocol):
    """A plan with sensory feedback. In a kinematic walk `sense` is never called, and all goes as planned."""

    def sense(self, sensed: Sensed) -> None:
        """Receive the state of the legs before the next step is planned."""
        ...


@runtime_checkable
class SteerablePlan(Plan, Protocol):
    """A plan that can continue from other legs than its own, and restart. It owns the arrays it receives."""

    @property
    def tips(self) -> np.ndarray:
        """(start, leg) present tips on their own axes [mm]."""
        ...

    @property
    def standing(self) -> np.ndarray:
        """(start, leg) which legs retract now."""
        ...

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Continue from these tips [mm] and states, both (start, leg)."""
        ...

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """Put some starts, (start,) of bool, at time 0 again, all legs standing at `tips`, (start, leg) [mm].

        They walk to the last bit like those of a plan from `begin` with these starts.
        """
        ...

    def slow_down(self, which: np.ndarray) -> None:
        """Let some starts, (start,) of bool, accelerate again from V_r(0); their legs do not change.

        Without an acceleration nothing changes.
        """
        ...


@runtime_checkable
class Controller(Protocol):
    """A frozen dataclass whose fields are its settings: plain data that distinguish two controllers.

    With an attribute `mirrored = True` it states that starts mirrored in the body axis give mirrored walks to the last
    bit; `conformance` checks it. A method `check_velocity(velocity, stride)` may raise InputError before any work if
    the time step is too long for V_r.
    """

    @property
    def name(self) -> str:
        """Name in tables and titles."""
        ...

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> Plan:
        """Return a new plan, which depends on nothing but these arguments.

        Args:
            starts: tips at time 0 on their own axes, all standing, (start, leg) [mm].
            velocity: V_r, or its final value when accelerating, (start,), 0 <= V_r < 1: per time unit a standing tip
                moves V_r mm to the rear, and a swinging one 1 mm ahead.
            stride: step range, lines of the tips and time step.
            acceleration: Eq. 11; `timing.commanded_velocities` gives V_r at each step.
            threads: by default one per core; the plan does not depend on it.
        """
        ...


@runtime_checkable
class SteerableController(Controller, Protocol):
    """A controller whose plans are `SteerablePlan`s, as sensory feedback and disturbances need."""

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> SteerablePlan:
        """Return a plan that walks at its final velocity from time 0; its arguments are those of `begin`.

        The acceleration begins only with `slow_down` or `restart`.
        """
        ...


def check_steerable(controller: Controller) -> None:
    """Raise InputError unless a controller is a `SteerableController`."""
    if not isinstance(controller, SteerableController):
        raise InputError(f"{controller.name} cannot be disturbed: it has no begin_at_speed")


def check_controller_type(controller: object) -> None:
    """Raise InputError unless something is a controller: a frozen dataclass with a name and a method `begin`."""
    if isinstance(controller, type) or not (is_dataclass(controller) and isinstance(controller, Controller)):
        raise InputError(
            f"controller = {short(controller)}; expected a controller, as hexmj.LDVS or hexmj.load_controller gives one"
        )


def settings_of(controller: Controller) -> dict[str, Any]:
    """Return the settings of a controller as plain data: numbers, texts, lists and dicts.

    Raises:
        InputError: a field is no plain data.
    """
    check_controller_type(controller)
    return _without_classes(plain(controller))


def _without_classes(value: Any) -> Any:
    """Remove the names of classes from plain settings; a member of an enumeration becomes its name."""
    if isinstance(value, dict):
        if value.keys() == {"class", "member"}:
            return value["member"]
        return {key: _without_classes(item) for key, item in value.items() if key != "class"}
    return [_without_classes(item) for item in value] if isinstance(value, list) else value
