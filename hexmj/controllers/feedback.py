"""Feedback around any plan that can be steered: before each of its steps it reads the legs as they are.

Its decisions (in the 1998 network: influences, the crossing of PEP and AEP) read

- the tips where the joint angles put them in the root frame, on each leg's axis;
- the contacts: a leg that protracts stands as soon as its foot meets the ground again.  At an obstacle the swing
  ends there.

A leg that should stand and has no ground counts as standing.  The targets of the servos are not the tips as read: they
go on by -V_r dt or +dt and take up what the plan makes of the tip as read only where the leg changes its state, or
where the plan puts it elsewhere, as after a halt; a target that restarts from the lagging tip at every step never loads
its servo.  `docs/feedback.md` tells what else was tried.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.controllers.losses import first_losses
from hexmj.controllers.protocol import (
    Controller,
    FeedbackPlan,
    Sensed,
    SteerablePlan,
    check_controller_type,
    claims_mirrored,
    limits_within,
)
from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk, copied, joined

SAME = 1e-9
"""A tip moved on from where the plan saw it if it is no farther than this from there by one step's way [mm]."""


@dataclass(frozen=True)
class SensoryFeedback:
    """A controller whose plans read the legs, made of one whose plans can be steered."""

    controller: Controller
    """What plans."""

    def __post_init__(self) -> None:
        check_controller_type(self.controller)

    @property
    def name(self) -> str:
        """That of the controller that plans, and what is different."""
        return f"{self.controller.name}, reading the legs"

    @property
    def mirrored(self) -> bool:
        """As the controller that plans."""
        return claims_mirrored(self.controller)

    check_velocity = property(limits_within)

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> "SensedPlan":
        """See `protocol.Controller.begin`.

        Raises:
            InputError: plans that cannot be steered.
        """
        plan = self.controller.begin(starts, velocity, stride, acceleration, threads)
        if isinstance(plan, FeedbackPlan):
            raise InputError(
                f"feedback around {self.controller.name}; expected another: this one reads the legs already"
            )
        if not isinstance(plan, SteerablePlan):
            raise InputError(
                f"feedback around {self.controller.name}; expected a controller whose plans can go on from the legs as"
                " they are, with tips, standing, see, restart, slow_down"
            )
        return SensedPlan(plan)


class SensedPlan:
    """A `protocol.FeedbackPlan`: goes on from the tips and contacts that it senses, with targets that load the servos.

    Whatever is not sensed is as ordered, so that without `sense` the plan goes on as if nobody walked by it.
    """

    def __init__(self, plan: SteerablePlan) -> None:
        """Around a plan at time 0, which may have been moved before."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self.made_for = plan, getattr(plan, "made_for", None)
        self._tips = self._targets = self._ordered = np.array(plan.tips)
        self._stance = np.array(plan.standing)

    def first_losses(self, steps: np.ndarray) -> np.ndarray:
        """See `protocol.FastLosses`: on paper, where nothing is read, those of the plan within."""
        return first_losses(self._plan, steps)

    def sense(self, sensed: Sensed) -> None:
        """Take in the tips, and which feet have met the ground."""
        lands = np.zeros(self._stance.shape, dtype=bool)
        lands[sensed.ids] = sensed.gained
        self._tips = self._tips.copy()
        self._tips[sensed.ids] = sensed.tips[..., 0] - np.array(self.stride.geometry.origin)
        self._targets = np.where(lands & ~self._stance, self._tips, self._targets)
        self._stance = self._stance | lands

    def advance(self, steps: int) -> PlannedWalk:
        """The next steps: where the tips shall be, and which legs shall stand."""
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
        return copied(replace(step, x=self._targets[None], aep=aep[None]))
