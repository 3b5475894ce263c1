"""The plan of a live walk: another controller may go on from the legs as they are."""

from dataclasses import replace

import numpy as np

from hexmj.controllers.checked_plans import begin, begin_at_speed, said, tell
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed, SteerablePlan, is_steerable
from hexmj.timing import Stride
from hexmj.walks import PlannedWalk


class Steered:
    """A `protocol.FeedbackPlan` of one start around whatever plan goes on at the moment, whose steps are counted on."""

    def __init__(self, controller: Controller, starts: np.ndarray, velocity: float, stride: Stride) -> None:
        """Begin at `starts`, (1, leg) [mm]."""
        self.starts, self.stride, self.done = starts, stride, 0
        self._plan: Plan = begin(controller, starts, velocity, stride, threads=1)

    @property
    def reads(self) -> bool:
        """Whether the plan wants to be told of the legs before each step."""
        return isinstance(self._plan, FeedbackPlan)

    @property
    def made_for(self) -> object:
        """The conditions that the plan is made for, if it tells them; see `protocol.Plan`."""
        return getattr(self._plan, "made_for", None)

    def sense(self, sensed: Sensed) -> None:
        """Hand on what is known."""
        if isinstance(self._plan, FeedbackPlan):
            tell(self._plan, sensed)

    def advance(self, steps: int) -> PlannedWalk:
        """The next steps of the plan that goes on now."""
        walk = self._plan.advance(steps)  # checked by whoever asks
        self.done += steps
        return replace(walk, time=np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt)

    def hand_over(self, controller: Controller, velocity: float) -> bool:
        """Let a controller go on at V_r from the legs as they are: their tips, and whether they stand.

        What else the last plan remembers is forgotten, as is the influence on a leg of the step before.

        Returns:
            Whether both the last plan and the controller can do so; else nothing has changed.
        """
        if not is_steerable(controller):
            return False
        with said("a plan, tips and standing"):
            if not isinstance(self._plan, SteerablePlan):
                return False
            tips, standing = self._plan.tips, self._plan.standing
        plan = begin_at_speed(controller, self.starts, np.array([velocity]), self.stride)
        with said("a plan, see"):
            plan.see(tips.copy(), standing.copy())
        self._plan = plan
        return True
