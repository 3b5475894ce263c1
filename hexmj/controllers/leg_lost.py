"""A controller that has lost a leg and does not know: the leg is held up, whatever it is told.

A body that tips far enough onto it comes down on it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hexmj.checks import check_types, whole
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed, check_controller_type, limits_within
from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk

RISE = 3.0
"""How fast the lost leg is raised as the walk begins [mm / time unit], three times as fast as tips swing ahead."""


@dataclass(frozen=True)
class LegLost:
    """A controller without one of its legs."""

    controller: Controller
    """Plans for six."""
    leg: int
    """Index of the lost leg."""
    held: float = 12.0
    """Height at which it is held [mm]; nothing on paper depends on it."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)
        whole("leg", self.leg, 0, 5)
        check_types(self)
        if not 0 < self.held < math.inf:
            raise InputError(f"held = {self.held}; expected a height above 0 mm")

    @property
    def name(self) -> str:
        """That of the controller that plans, and what is different."""
        return f"{self.controller.name}, leg {self.leg + 1} lost"

    check_velocity = property(limits_within)

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> "LamePlan":
        """See `protocol.Controller.begin`."""
        plan = self.controller.begin(starts, velocity, stride, acceleration, threads)
        kind = LameReadingPlan if isinstance(plan, FeedbackPlan) else LamePlan
        return kind(plan, self.leg, self.held)


class LamePlan:
    """A `protocol.Plan` of which one leg is held up."""

    def __init__(self, plan: Plan, leg: int, held: float) -> None:
        """Around a plan at time 0."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self._leg, self._held, self.made_for = plan, leg, held, getattr(plan, "made_for", None)

    def advance(self, steps: int) -> PlannedWalk:
        """The next steps; the lost leg is moved to and fro in the air."""
        walk = self._plan.advance(steps)
        self.done = self._plan.done
        stance, height = walk.stance.copy(), walk.height.copy()
        stance[..., self._leg] = False
        height[..., self._leg] = self._held * np.minimum(walk.time / (self._held / RISE), 1.0)[:, None]
        return replace(walk, stance=stance, height=height)


class LameReadingPlan(LamePlan):
    """The same of a `protocol.FeedbackPlan`."""

    def sense(self, sensed: Sensed) -> None:
        """Hand on what the legs tell, the lost one included."""
        self._plan.sense(sensed)  # pyright: ignore[reportAttributeAccessIssue]
