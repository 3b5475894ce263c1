"""The interface of controllers, of their plans, and of the sensed state of the legs.

A controller begins a plan for many starts at once; the plan is advanced step by step and returns the tips. A kinematic
walk gives the plan no feedback. In a physical walk, a plan with a method `sense` receives the state of the legs before
each step.
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
    """The walk of many independent starts, planned step by step.

    A plan that sets the height of the feet may have an attribute `made_for`, the `Conditions` it is made for; physical
    walks under other conditions then raise InputError. A plan may have methods `first_losses(steps)` and
    `first_dynamic_losses(steps, pendulum)`; one of them is called once, at time 0, and gives the result of
    `planning.planned_losses` or `planned_dynamic_losses` faster. A plan with an attribute `y` begins elsewhere, after
    a warm-up or on other lines: `starts` and `y`, (start, leg) [mm], are its tips, not the starts that `begin`
    received. A plan with a method `set_velocity(velocity)` walks at V_r = `velocity`, (start,), from the next step on;
    commands that change need it.
    """

    starts: np.ndarray
    """(start, leg) tips at time 0 on their own axes, on which an insect stands [mm]."""
    stride: Stride
    """Step range, lines of the tips and time step."""
    done: int
    """Number of steps planned so far."""

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps of all starts; several short calls give the same walk as one long call."""
        ...


@dataclass(frozen=True, eq=False)
class Sensed:
    """The state of the legs that a robot can sense at the end of a step, for the n starts that still walk.

    Contact, load and torques are those at the beginning of the last physics step.
    """

    ids: np.ndarray
    """(n,) index in the plan of each start that still walks."""
    tips: np.ndarray
    """(n, leg, axis) tips computed from the joint angles, in the root frame: ahead of, left of and above O [mm]."""
    contact: np.ndarray
    """(n, leg) whether the ground carried the foot within the last `Conditions.contact_gap`."""
    gained: np.ndarray
    """(n, leg) whether the foot has contact now, but had none one step before."""
    lost: np.ndarray
    """(n, leg) whether the foot had contact one step before, but has none now."""
    load: np.ndarray
    """(n, leg) normal force of the ground minus adhesion [g mm/s^2], negative where adhesion holds a foot that pulls.
    An insect of 1 g weighs 9810."""
    joints: np.ndarray
    """(n, leg, joint) joint angles [rad]."""
    torques: np.ndarray
    """(n, leg, joint) torques of the servos [g mm^2/s^2]."""
    tilt: np.ndarray
    """(n, 2) angles by which the root's forward and left axes point below the horizontal [rad]."""
    velocity: np.ndarray
    """(n, 3) velocity of the root: along its heading, to its left, and upward [mm/s]."""
    turning: np.ndarray
    """(n, 3) angular velocity of the root in its own frame [rad/s]."""


@runtime_checkable
class FeedbackPlan(Plan, Protocol):
    """A plan with sensory feedback. In a kinematic walk `sense` is never called, and the legs move as planned."""

    def sense(self, sensed: Sensed) -> None:
        """Receive the state of the legs before the next step is planned."""
        ...


@runtime_checkable
class SteerablePlan(Plan, Protocol):
    """A plan that can continue from given tips and restart. It keeps the arrays that its methods receive."""

    @property
    def tips(self) -> np.ndarray:
        """(start, leg) tips on their own axes after the last planned step [mm]."""
        ...

    @property
    def standing(self) -> np.ndarray:
        """(start, leg) True for each leg that retracts after the last planned step."""
        ...

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """Continue from `tips`, (start, leg) [mm], with the legs in stance where `standing`, (start, leg), is True."""
        ...

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """Put the starts where `which`, (start,), is True at time 0, with feet at `tips`, (start, leg) [mm].

        From then on they walk, to the last bit, like a new plan from `begin` that starts at `tips`.
        """
        ...

    def slow_down(self, which: np.ndarray) -> None:
        """Let the starts where `which`, (start,), is True accelerate again from V_r(0); their legs do not change.

        The call has no effect if the plan has no acceleration.
        """
        ...


@runtime_checkable
class Controller(Protocol):
    """A frozen dataclass whose fields are its settings: plain data, different for controllers that walk differently.

    An attribute `mirrored = True` promises that starts mirrored in the body axis give mirrored walks to the last bit;
    `conformance` checks it. A method `check_velocity(velocity, stride)` may raise InputError before a walk is planned
    if the time step is too long for V_r. A method `after_loss(leg, time)` returns a controller that walks without a leg
    from a time on, when the loss of the leg is announced.
    """

    @property
    def name(self) -> str:
        """Name of the controller in tables and titles."""
        ...

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> Plan:
        """Return a new plan, which depends only on the settings and these arguments.

        Args:
            starts: tips at time 0 on their own axes, all standing, (start, leg) [mm].
            velocity: V_r, or its final value when accelerating, (start,), 0 <= V_r < 1: per time unit a standing tip
                moves V_r mm to the rear, and a swinging tip 1 mm ahead.
            stride: step range, lines of the tips and time step.
            acceleration: Eq. 11, or None for constant V_r; `timing.commanded_velocities` gives V_r at each step.
            threads: number of threads, by default one per core; the plan does not depend on it.
        """
        ...


@runtime_checkable
class SteerableController(Controller, Protocol):
    """A controller whose plans are `SteerablePlan`s, which sensory feedback and disturbances require."""

    def begin_at_speed(self, starts, velocity, stride, acceleration=None, threads=None) -> SteerablePlan:
        """Return a plan that walks at its final velocity from time 0; the arguments are the same as of `begin`.

        The acceleration begins only with `slow_down` or `restart`.
        """
        ...


@runtime_checkable
class CommandedPlan(Plan, Protocol):
    """A plan that follows a command (`hexmj.Command`), the same for all of its starts."""

    def follow(self, command: np.ndarray) -> None:
        """Walk by `command`, (3,), from the next step on: forward, left [V_p] and turn [rad / time unit]."""
        ...


@runtime_checkable
class CommandedController(Controller, Protocol):
    """A controller that plans by a command itself; all others are steered, see `steered.Steered`."""

    def begin_commanded(self, starts, command, stride, threads=None) -> CommandedPlan:
        """Return a plan that walks by `command`, (3,), from time 0; the other arguments are those of `begin`."""
        ...


def check_steerable(controller: Controller) -> None:
    """Raise InputError unless the controller is a `SteerableController`."""
    if not isinstance(controller, SteerableController):
        raise InputError(f"{controller.name} cannot be disturbed; expected a controller with begin_at_speed")


def check_controller_type(controller: object) -> None:
    """Raise InputError unless the object is a controller: a frozen dataclass with a name and a method `begin`."""
    if isinstance(controller, type) or not (is_dataclass(controller) and isinstance(controller, Controller)):
        expected = "one such as hexmj.LDVS or load_controller(name), or in a comparison also {name: controller}"
        raise InputError(f"controller = {short(controller)}; expected {expected}")


def settings_of(controller: Controller) -> dict[str, Any]:
    """Return the settings of a controller as plain data: numbers, strings, lists and dicts.

    Raises:
        InputError: a field does not hold plain data.
    """
    check_controller_type(controller)
    return _without_classes(plain(controller))


def _without_classes(value: Any) -> Any:
    """Return plain settings without class names."""
    if isinstance(value, dict):
        return {key: _without_classes(item) for key, item in value.items() if key != "class"}
    return [_without_classes(item) for item in value] if isinstance(value, list) else value
