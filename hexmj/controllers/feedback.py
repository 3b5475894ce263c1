"""Sensory feedback around any steerable controller: before each step the plan reads the legs as they are.

Its decisions (in the 1998 network: influences, the crossing of PEP and AEP) use

- the tips where the joint angles put them in the root frame, on each leg's axis;
- the contacts: a leg that protracts stands as soon as its foot meets the ground again, so that a swing ends at an
  obstacle.

A leg that should stand and has no ground counts as standing. The targets of the servos are not the sensed tips: they
move by -V_r dt or +dt, and take up the plan's response to the sensed tip only where the leg changes its state, or where
the plan puts it elsewhere, as after a halt. A target that restarts from the lagging tip at every step never loads its
servo. `docs/feedback.md` describes the alternatives that were tried.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexmj.controllers.planning import first_losses
from hexmj.controllers.protocol import FeedbackPlan, Sensed, SteerablePlan
from hexmj.controllers.wrappers import WrappedPlan, Wrapper
from hexmj.errors import InputError
from hexmj.walks import PlannedWalk, joined

SAME = 1e-9
"""Greatest distance of a tip from one step beyond its sensed place at which it counts as moved on from there [mm]."""


@dataclass(frozen=True)
class SensoryFeedback(Wrapper):
    """A controller with sensory feedback, made from a steerable one."""

    @property
    def name(self) -> str:
        """The controller's name, and what is different."""
        return f"{self.controller.name} with feedback"

    @property
    def mirrored(self) -> bool:
        """As the controller that plans."""
        return getattr(self.controller, "mirrored", False)

    def wrap(self, plan: Any) -> "SensedPlan":
        """See `Wrapper`; the plan has no feedback of its own, and can be steered."""
        if isinstance(plan, FeedbackPlan) or not isinstance(plan, SteerablePlan):
            expected = "a steerable plan (tips, standing, see, restart, slow_down) without feedback of its own"
            raise InputError(f"feedback around {self.controller.name}; expected {expected}")
        return SensedPlan(plan)


class SensedPlan(WrappedPlan):
    """A `protocol.FeedbackPlan` that continues from the sensed tips and contacts, with targets that load the servos.

    What is not sensed is taken to be as planned, so that without `sense` the walk is the kinematic one.
    """

    def __init__(self, plan: SteerablePlan) -> None:
        """Wrap a plan at time 0; other legs may have been given to it before."""
        super().__init__(plan)
        self._tips = self._targets = self._ordered = np.array(plan.tips)
        self._stance = np.array(plan.standing)

    def first_losses(self, steps: np.ndarray) -> np.ndarray:
        """See `protocol.Plan`: in a kinematic walk, those of the plan within."""
        return first_losses(self._plan, steps)

    def sense(self, sensed: Sensed) -> None:
        """Receive the tips, and which feet have met the ground."""
        lands = np.zeros(self._stance.shape, dtype=bool)
        lands[sensed.ids] = sensed.gained
        self._tips = self._tips.copy()
        self._tips[sensed.ids] = sensed.tips[..., 0] - np.array(self.stride.geometry.origin)
        self._targets = np.where(lands & ~self._stance, self._tips, self._targets)
        self._stance = self._stance | lands

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps: targets of the tips, and which legs stand."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> PlannedWalk:
        self._plan.see(self._tips.copy(), self._stance.copy())
        step = self._plan.advance(1)
        self.done = self._plan.done
        way = np.where(self._stance, -step.velocity[0][:, None], 1.0) * self.stride.dt
        goes_on = (step.stance[0] == self._stance) & (np.abs(step.x[0] - self._tips - way) < SAME)
        self._tips = self._targets = np.where(goes_on, self._targets + way, step.x[0])
        self._stance = step.stance[0].copy()
        put_back = self._targets < self._ordered  # such a tip is not on its way to the AEP
        aep, self._ordered = np.where(put_back, np.nan, step.aep[0]), self._targets
        return replace(step, x=self._targets[None], aep=aep[None])
