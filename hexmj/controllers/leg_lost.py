"""A controller that has lost a leg and does not know: the leg is held up, whatever it is told, and never stands."""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.checks import whole
from hexmj.controllers.protocol import Controller, Plan, ReadingPlan, Sensed, check_controller_type
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk

HELD = 0.6
"""Height at which the lost leg is held, in steps from PEP_0 to AEP_0."""

RAISED = 0.2
"""Time in which it is raised there as the walk begins, in times of a swing over such a step."""


@dataclass(frozen=True)
class LegLost:
    """A controller without one of its legs."""

    controller: Controller
    """Plans for six."""
    leg: int
    """Index of the lost leg."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)
        whole("leg", self.leg, 0, 5)

    @property
    def name(self) -> str:
        """That of the controller that plans, and what is different."""
        return f"{self.controller.name}, leg {self.leg + 1} lost"

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
        return LameReadingPlan(plan, self.leg) if isinstance(plan, ReadingPlan) else LamePlan(plan, self.leg)


class LamePlan:
    """A `protocol.Plan` of which one leg is held up."""

    def __init__(self, plan: Plan, leg: int) -> None:
        """Around a plan at time 0."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self._leg, self.made_for = plan, leg, getattr(plan, "made_for", None)

    def advance(self, steps: int) -> PlannedWalk:
        """The next steps; the lost leg is moved to and fro in the air."""
        walk = self._plan.advance(steps)
        self.done = self._plan.done
        stance, height = walk.stance.copy(), walk.height.copy()
        stance[..., self._leg] = False
        step = self.stride.aep0 - self.stride.pep0
        height[..., self._leg] = HELD * step * np.minimum(walk.time / (RAISED * step), 1.0)[:, None]
        return replace(walk, stance=stance, height=height)


class LameReadingPlan(LamePlan):
    """The same of a `protocol.ReadingPlan`."""

    def sense(self, sensed: Sensed) -> None:
        """Hand on what the legs tell, the lost one included, whose foot never meets the ground."""
        self._plan.sense(sensed)  # pyright: ignore[reportAttributeAccessIssue]
