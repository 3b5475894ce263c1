"""Controllers that wrap another controller: base classes, a warm-up, a lost leg, and noisy or delayed senses."""

from collections import deque
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from hexmj.controllers.planning import HELD, advanced, begin, check_velocities, planned_dynamic_losses
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed, check_controller_type
from hexmj.errors import InputError
from hexmj.timing import Stride, steps_within
from hexmj.tipping import STATIC, Losses, Pendulum
from hexmj.validate import number, whole
from hexmj.walks import PlannedWalk

RISE = 3.0
"""Speed at which the lost leg is raised at the beginning of the walk [mm / time unit]: three times V_p."""

Begins = Literal["random", "steady"]
"""Where walks begin: at random starts, or in the steady state that the plan reaches from them in a warm-up."""

WARM_UP = 10.0
"""Duration of the warm-up [periods of a single leg]. Of 16 controllers at V = 0.3 and 0.5 (100 starts, seed 66), all
but tegotae (0.17) then have a kinematic FLSS within 0.11 of that after 30 periods."""


@dataclass(frozen=True)
class Wrapper:
    """Base class of controllers whose plans wrap those of another controller."""

    controller: Controller
    """The wrapped controller, which plans the steps."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)

    def check_velocity(self, velocity: float, stride: Stride) -> None:
        """Raise InputError if the wrapped controller refuses this V_r with this time step."""
        check_velocities(self.controller, [velocity], stride)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> Plan:
        """See `protocol.Controller.begin`.

        Raises:
            InputError: the plan of the wrapped controller does not suit this wrapper.
        """
        return self.wrap(self.controller.begin(starts, velocity, stride, acceleration, threads))

    def wrap(self, plan: Any) -> Plan:
        """Return a new plan that wraps `plan`, a plan at time 0."""
        raise NotImplementedError


class WrappedPlan:
    """Base class of plans that wrap another plan; without changes it returns the steps of the wrapped plan."""

    def __init__(self, plan: Any) -> None:
        """Wrap a plan that is at time 0."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self.made_for = plan, getattr(plan, "made_for", None)
        if hasattr(plan, "y"):
            self.y = plan.y

    def set_velocity(self, velocity: np.ndarray) -> None:
        """See `protocol.Plan`."""
        self._plan.set_velocity(velocity)

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        walk = self._plan.advance(steps)
        self.done = self._plan.done
        return walk


class WrappedSteerablePlan(WrappedPlan):
    """Base class of `protocol.SteerablePlan`s that wrap one."""

    def see(self, tips: np.ndarray, standing: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._plan.see(tips, standing)

    def restart(self, which: np.ndarray, tips: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._plan.restart(which, tips)

    def slow_down(self, which: np.ndarray) -> None:
        """See `protocol.SteerablePlan`."""
        self._plan.slow_down(which)

    @property
    def tips(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._plan.tips

    @property
    def standing(self) -> np.ndarray:
        """See `protocol.SteerablePlan`."""
        return self._plan.standing


@dataclass(frozen=True)
class FromSteadyState(Wrapper):
    """A controller whose walks begin after a warm-up in the plan. In physics, all feet stand on the tips at its end.

    Legs that are in swing at the end of the warm-up lift off in the first step.
    """

    @property
    def name(self) -> str:
        """Name of the wrapped controller."""
        return self.controller.name

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> "LatePlan":
        """See `protocol.Controller.begin`."""
        if acceleration or not (velocity == velocity[0]).all() or velocity[0] == 0:
            raise InputError("a warm-up needs one velocity V > 0 for all starts, and no acceleration")
        plan = begin(self.controller, starts, velocity, stride, threads=threads)
        return LatePlan(plan, int(steps_within(stride.periods(velocity[0], WARM_UP), stride)))


def by_protocol(controller: Controller, protocol: str) -> Controller:
    """Return the controller whose plans begin where a protocol says."""
    return FromSteadyState(controller) if protocol == "steady" else controller


class LatePlan(WrappedPlan):
    """A plan whose time 0 is the end of a warm-up."""

    def __init__(self, plan: Plan, late: int) -> None:
        """Advance a plan at time 0 by a warm-up of `late` steps."""
        if compiled := getattr(plan, "losses_after", None):  # the 1998 network keeps only its present state
            compiled(late - 1, 0)
            self.first_losses, self.first_dynamic_losses = self._first_losses, self._first_dynamic_losses
        while plan.done < late - 1:
            plan.advance(min(max(1, HELD // len(plan.starts)), late - 1 - plan.done))
        super().__init__(plan)
        last = advanced(plan, 1)
        self.starts, self.y, self.done, self._late = last.x[0], last.y[0], 0, late
        if isinstance(plan, FeedbackPlan):
            self.sense = plan.sense

    def _first_losses(self, steps: np.ndarray) -> np.ndarray:
        """See `protocol.Plan`."""
        return self._first_dynamic_losses(steps, STATIC).static

    def _first_dynamic_losses(self, steps: np.ndarray, pendulum: Pendulum) -> Losses:
        """See `protocol.Plan`."""
        if (steps != steps[0]).any():
            return planned_dynamic_losses(self, steps, pendulum)
        static, dynamic, excursion = self._plan.losses_after(0, int(steps[0]), pendulum)
        static, dynamic = (np.where(step > 0, step - self._late, 0) for step in (static, dynamic))
        return Losses(static, dynamic, excursion)

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps; time counts from the end of the warm-up."""
        walk = super().advance(steps)
        self.done -= self._late
        return replace(walk, time=np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt)


@dataclass(frozen=True)
class LegLost(Wrapper):
    """A controller that plans for six legs although one leg is lost: from then on, the leg is held in the air.

    A body that tips far enough toward the lost leg still lands on it.
    """

    leg: int
    """Index of the lost leg."""
    held: float = 12.0
    """Height at which the lost leg is held [mm]; kinematic results do not depend on it."""
    time: float = 0.0
    """Time at which the leg is lost [time units]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("leg", self.leg, 0, 5)
        number("held", self.held, 1e-6, 1e6)
        number("time", self.time, 0.0)

    @property
    def name(self) -> str:
        """Name of the wrapped controller, and number of the lost leg."""
        return f"{self.controller.name}, leg {self.leg + 1} lost"

    def wrap(self, plan: Any) -> "LamePlan":
        """Return a `LamePlan` around a plan at time 0."""
        return LamePlan(plan, self.leg, self.held, self.time)


class LamePlan(WrappedPlan):
    """A plan that holds one leg up; the wrapped plan senses all six legs, including the lost one."""

    def __init__(self, plan: Any, leg: int, held: float, time: float) -> None:
        """Wrap a plan that is at time 0; see `LegLost` for the other arguments."""
        super().__init__(plan)
        self._leg, self._held, self._time = leg, held, time
        if isinstance(plan, FeedbackPlan):
            self.sense = plan.sense

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps, in which the lost leg moves forward and back in the air."""
        walk = super().advance(steps)
        stance, height, since = walk.stance.copy(), walk.height.copy(), walk.time - self._time
        lost = since > 0.0
        stance[lost, :, self._leg] = False
        height[lost, :, self._leg] = self._held * np.minimum(since[lost] / (self._held / RISE), 1.0)[:, None]
        return replace(walk, stance=stance, height=height)


@dataclass(frozen=True)
class PoorSenses(Wrapper):
    """A controller with sensory feedback that receives its tips with noise and all its senses with a delay.

    The noise does not affect controllers that sense only loads or contacts, as some baselines do.
    """

    noise: float = 0.0
    """Standard deviation of the noise that is added to each coordinate of each sensed tip, independently at every step,
    as a fraction of AEP_0 - PEP_0."""
    delay: float = 0.0
    """Delay of all senses [time units], rounded to whole steps of the plan."""

    def __post_init__(self) -> None:
        super().__post_init__()
        number("noise", self.noise, 0, 10)
        number("delay", self.delay, 0, 1000)

    @property
    def name(self) -> str:
        """Name of the wrapped controller, noise and delay."""
        return f"{self.controller.name}, noise {self.noise:g}, delay {self.delay:g}"

    def wrap(self, plan: Any) -> "PoorlySensedPlan":
        """Return a `PoorlySensedPlan` around a plan at time 0; raise InputError if that plan has no feedback."""
        stride, late = plan.stride, round(self.delay / plan.stride.dt)
        if self.delay and not late:
            raise InputError(f"delay = {self.delay:g}; expected 0 or at least one step of {stride.dt:g} time units")
        if not isinstance(plan, FeedbackPlan):
            raise InputError(f"{self.controller.name} has no sensory feedback, which noise or a delay could affect")
        return PoorlySensedPlan(plan, self.noise * (stride.aep0 - stride.pep0), late)


class PoorlySensedPlan(WrappedPlan):
    """A `protocol.FeedbackPlan` with noise and delay; the seed of a start's noise is given by its tips at time 0."""

    def __init__(self, plan: FeedbackPlan, error: float, late: int) -> None:
        """Wrap a plan at time 0; `error` is the standard deviation of the noise [mm], `late` the delay in steps."""
        super().__init__(plan)
        self._draws = [np.random.default_rng(np.frombuffer(start.tobytes(), np.uint32)) for start in plan.starts]
        self._coming: deque[Sensed] = deque()
        self._error, self._late = error, late

    def sense(self, sensed: Sensed) -> None:
        """Pass the state sensed `late` steps ago to the wrapped plan; pass nothing in the first `late` steps."""
        if self._error:
            errors = [self._draws[i].standard_normal(sensed.tips.shape[1:]) for i in sensed.ids]
            sensed = replace(sensed, tips=sensed.tips + self._error * np.array(errors))
        self._coming.append(sensed)
        if len(self._coming) > self._late:
            self._plan.sense(self._coming.popleft())
