"""Controllers around another one: their base classes, and impairments: a lost leg, and noisy or late senses."""

from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexmj.controllers.planning import check_velocities
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed, check_controller_type
from hexmj.errors import InputError
from hexmj.timing import Stride
from hexmj.validate import number, whole
from hexmj.walks import PlannedWalk

RISE = 3.0
"""How fast the lost leg is raised as the walk begins [mm / time unit], three times as fast as tips swing ahead."""


@dataclass(frozen=True)
class Wrapper:
    """Base class of controllers whose plans wrap those of another controller."""

    controller: Controller
    """Plans the steps."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)

    def check_velocity(self, velocity: float, stride: Stride) -> None:
        """As the controller within, see `protocol.Controller`."""
        check_velocities(self.controller, [velocity], stride)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> Plan:
        """See `protocol.Controller.begin`.

        Raises:
            InputError: the plan of the controller within cannot be wrapped.
        """
        return self.wrap(self.controller.begin(starts, velocity, stride, acceleration, threads))

    def wrap(self, plan: Any) -> Plan:
        """Return a plan around one at time 0."""
        raise NotImplementedError


class WrappedPlan:
    """Base class of plans around another one; as it is, it gives the same steps."""

    def __init__(self, plan: Any) -> None:
        """Wrap a plan at time 0."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self.made_for = plan, getattr(plan, "made_for", None)

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        walk = self._plan.advance(steps)
        self.done = self._plan.done
        return walk


@dataclass(frozen=True)
class LegLost(Wrapper):
    """A controller that has lost a leg and does not know it: the leg is held up.

    A body that tips far enough onto the leg comes down on it.
    """

    leg: int
    """Index of the lost leg."""
    held: float = 12.0
    """Height at which the leg is held [mm]; kinematic results do not depend on it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        whole("leg", self.leg, 0, 5)
        number("held", self.held, 1e-6, 1e6)

    @property
    def name(self) -> str:
        """The controller's name, and what is different."""
        return f"{self.controller.name}, leg {self.leg + 1} lost"

    def wrap(self, plan: Any) -> "LamePlan":
        """See `Wrapper`."""
        return LamePlan(plan, self.leg, self.held)


class LamePlan(WrappedPlan):
    """A plan of which one leg is held up; it senses what the plan within does, the lost leg included."""

    def __init__(self, plan: Any, leg: int, held: float) -> None:
        """Wrap a plan at time 0; `held` is the leg's height [mm]."""
        super().__init__(plan)
        self._leg, self._held = leg, held
        if isinstance(plan, FeedbackPlan):
            self.sense = plan.sense

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps; the lost leg moves to and fro in the air."""
        walk = super().advance(steps)
        stance, height = walk.stance.copy(), walk.height.copy()
        stance[..., self._leg] = False
        height[..., self._leg] = self._held * np.minimum(walk.time / (self._held / RISE), 1.0)[:, None]
        return replace(walk, stance=stance, height=height)


@dataclass(frozen=True)
class PoorSenses(Wrapper):
    """A controller with sensory feedback that senses its tips with noise, or everything late.

    Controllers that sense only loads or contacts, as some baselines do, are not affected by the noise.
    """

    noise: float = 0.0
    """Standard deviation of the error of each coordinate of each tip, drawn independently at every step, as a fraction
    of AEP_0 - PEP_0."""
    delay: float = 0.0
    """Delay of everything that is sensed [time units], rounded to steps of the plan."""

    def __post_init__(self) -> None:
        super().__post_init__()
        number("noise", self.noise, 0, 10)
        number("delay", self.delay, 0, 1000)

    @property
    def name(self) -> str:
        """The controller's name, and what is different."""
        return f"{self.controller.name}, noise {self.noise:g}, delay {self.delay:g}"

    def wrap(self, plan: Any) -> "PoorlySensedPlan":
        """See `Wrapper`."""
        stride, late = plan.stride, round(self.delay / plan.stride.dt)
        if self.delay and not late:
            raise InputError(f"delay = {self.delay:g}; expected at least one step of {stride.dt:g} time units")
        if not isinstance(plan, FeedbackPlan):
            raise InputError(f"poor senses of {self.controller.name}; expected a controller with sensory feedback")
        return PoorlySensedPlan(plan, self.noise * (stride.aep0 - stride.pep0), late)


class PoorlySensedPlan(WrappedPlan):
    """A `protocol.FeedbackPlan` that senses with noise or late; the noise of a start depends only on its tips."""

    def __init__(self, plan: FeedbackPlan, error: float, late: int) -> None:
        """Wrap a plan at time 0, with a standard deviation [mm] and a delay in steps."""
        super().__init__(plan)
        self._draws = [np.random.default_rng(np.frombuffer(start.tobytes(), np.uint32)) for start in plan.starts]
        self._coming: deque[Sensed] = deque()
        self._error, self._late = error, late

    def sense(self, sensed: Sensed) -> None:
        """Pass on what was sensed some steps ago; nothing until then."""
        if self._error:
            errors = [self._draws[i].standard_normal(sensed.tips.shape[1:]) for i in sensed.ids]
            sensed = replace(sensed, tips=sensed.tips + self._error * np.array(errors))
        self._coming.append(sensed)
        if len(self._coming) > self._late:
            self._plan.sense(self._coming.popleft())
