"""Sensory feedback for any steerable controller: before each step its plan receives the sensed tips and contacts.

The plan decides (in the 1998 network: influences, and whether a tip has crossed PEP or AEP) by

- the sensed tips, computed from the joint angles in the root frame, on each leg's axis;
- the contacts: a protracting leg begins its stance as soon as its foot touches the ground, so that an obstacle ends a
  swing.

A leg that should stand but has no ground contact counts as standing. The targets of the servos differ from the sensed
tips: in each step a target moves by -V_r dt in stance or +dt in swing. It is set to the tip that the plan computes from
the sensed tip only where the leg changes its state, or where the plan moves the tip in another way, as after a halt.
If every step set the target from the sensed tip, which lags, the target would never load its servo.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexmj.controllers.planning import first_dynamic_losses, first_losses
from hexmj.controllers.protocol import FeedbackPlan, Sensed, SteerablePlan
from hexmj.controllers.wrappers import WrappedPlan, Wrapper
from hexmj.errors import InputError
from hexmj.tipping import Losses, Pendulum
from hexmj.walks import PlannedWalk, joined

SAME = 1e-9
"""Greatest distance between the planned tip and the sensed tip moved on by one step that counts as equal [mm]."""


@dataclass(frozen=True)
class SensoryFeedback(Wrapper):
    """A steerable controller to which sensory feedback is added."""

    @property
    def name(self) -> str:
        """Name of the wrapped controller, followed by 'with feedback'."""
        return f"{self.controller.name} with feedback"

    @property
    def mirrored(self) -> bool:
        """Whether the wrapped controller is mirrored, see `protocol.Controller`."""
        return getattr(self.controller, "mirrored", False)

    def wrap(self, plan: Any) -> "SensedPlan":
        """Return a `SensedPlan` around a plan at time 0, which must be steerable and have no feedback of its own."""
        if isinstance(plan, FeedbackPlan) or not isinstance(plan, SteerablePlan):
            expected = "a steerable plan (tips, standing, see, restart, slow_down) without feedback of its own"
            raise InputError(f"{self.controller.name} cannot receive feedback; expected {expected}")
        return SensedPlan(plan)


class SensedPlan(WrappedPlan):
    """A `protocol.FeedbackPlan` that continues from the sensed tips and contacts, with targets that load the servos.

    The legs of a start that is not sensed count as planned, so that without `sense` the walk is the kinematic one.
    """

    def __init__(self, plan: SteerablePlan) -> None:
        """Wrap a plan that is at time 0; its method `see` may have been called before."""
        super().__init__(plan)
        self._tips = self._targets = self._previous = np.array(plan.tips)
        self._stance = np.array(plan.standing)

    def first_losses(self, steps: np.ndarray) -> np.ndarray:
        """See `protocol.Plan`: in a kinematic walk, the wrapped plan has the same first losses."""
        return first_losses(self._plan, steps)

    def first_dynamic_losses(self, steps: np.ndarray, pendulum: Pendulum) -> Losses:
        """See `first_losses`."""
        return first_dynamic_losses(self._plan, steps, pendulum)

    def sense(self, sensed: Sensed) -> None:
        """Receive the sensed tips, and begin the stance of protracting legs whose feet have gained contact."""
        lands = np.zeros(self._stance.shape, dtype=bool)
        lands[sensed.ids] = sensed.gained
        self._tips = self._tips.copy()
        self._tips[sensed.ids] = sensed.tips[..., 0] - np.array(self.stride.geometry.origin)
        self._targets = np.where(lands & ~self._stance, self._tips, self._targets)
        self._stance = self._stance | lands

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next `steps` steps, with the targets of the servos as tips."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> PlannedWalk:
        self._plan.see(self._tips.copy(), self._stance.copy())
        step = self._plan.advance(1)
        self.done = self._plan.done
        way = np.where(self._stance, -step.velocity[0][:, None], 1.0) * self.stride.dt
        continues = (step.stance[0] == self._stance) & (np.abs(step.x[0] - self._tips - way) < SAME)
        self._tips = self._targets = np.where(continues, self._targets + way, step.x[0])
        self._stance = step.stance[0].copy()
        moved_back = self._targets < self._previous  # such a tip is not on its way to the AEP
        aep, self._previous = np.where(moved_back, np.nan, step.aep[0]), self._targets
        return replace(step, x=self._targets[None], aep=aep[None])
