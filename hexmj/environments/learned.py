"""A learned policy as a controller: it adds offsets to the tips that another controller plans.

A policy maps sensed numbers (`felt`) to tip offsets, each from -1 to 1. An environment computes the sensed numbers from
its observations, a physical walk from `Sensed`. A policy trained in an environment can therefore walk wherever a
controller does, for example in the league. A kinematic walk senses nothing: the policy receives the numbers of an
upright insect that walks at the commanded velocity and stands on all feet that the plan puts in stance.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hexmj.bodies.kinematics import standing_tips
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed
from hexmj.controllers.wrappers import WrappedPlan, Wrapper
from hexmj.errors import InputError
from hexmj.physics.foot_path import TipTargets, check_made_for
from hexmj.rotations import lean
from hexmj.walks import PlannedWalk, copied, joined

TILT, VELOCITY, TURNING = slice(0, 2), slice(2, 5), slice(5, 8)
CONTACT, STANCE, TIPS = slice(8, 14), slice(14, 20), slice(20, 38)
"""Columns of the array of sensed numbers, (n, `FELT`), see `felt`."""

FELT = 38
"""Number of the sensed numbers of one insect."""

MOST = 10.0
"""Largest magnitude of a sensed number, in units of its scale, see `felt`."""


Policy = Callable[[np.ndarray], np.ndarray]
"""A policy, a frozen dataclass of plain data: sensed numbers, (n, `FELT`) -> offsets of the tips, (n, leg * axis).

The offsets forward, left and up are in units of `Lengths.largest_tip_offset`, clipped to -1 ... 1. `WithOffsets` keeps
the tips between PEP_min and AEP_0, unless the plan itself exceeds this range, because controllers must stay in it. An
environment does not limit the tips so.
"""


def felt(body: Body, *parts: np.ndarray) -> np.ndarray:
    """Return the sensed numbers that policies receive, (n, `FELT`), clipped to -`MOST` ... `MOST`.

    Args:
        body: the body whose standing height scales lengths and velocities.
        parts: tilt ahead and to the left, velocity, turning, contact, planned stance and planned tips, each (n, ...).
            Each is divided by its scale: 0.1 rad, five standing heights per second, 2 rad/s, 1, 1, and one standing
            height.
    """
    count, high = len(parts[0]), body.standing_height
    scales = 0.1, 5.0 * high, 2.0, 1.0, 1.0, high
    columns = [part.reshape(count, -1) / size for part, size in zip(parts, scales, strict=True)]
    return np.concatenate(columns, axis=1).clip(-MOST, MOST)


def felt_in(observations: dict[str, np.ndarray], body: Body = STICK_INSECT) -> np.ndarray:
    """Return sensed numbers from observations: of a vector environment (n, `FELT`), of a single one (`FELT`,)."""
    names = "velocity", "angular_velocity", "contact", "planned_stance", "planned_tips"
    orientation, *others = (np.asarray(observations[name]) for name in ("orientation", *names))
    tilt = np.arcsin(np.clip(lean(orientation.reshape(-1, 4))[0], -1.0, 1.0))
    sensed = felt(body, tilt, *others)
    return sensed if orientation.ndim > 1 else sensed[0]


@dataclass(frozen=True)
class WithOffsets(Wrapper):
    """A controller that adds a policy's offsets to the tips that another controller plans."""

    controller: Controller = field(default=LDVS, kw_only=True)
    """The controller that plans the tips."""
    policy: Policy
    """The learned policy, which returns the offsets."""
    conditions: Conditions = field(default_factory=Conditions)
    """Conditions of the walk: their V_p and foot path lift and lower the feet, and their body scales the offsets. A
    physical walk under other conditions raises InputError."""
    name: str = "learned"

    def wrap(self, plan: Any) -> "OffsetPlan":
        """Return the plan with offsets; raise InputError if the inner plan is made for other conditions."""
        check_made_for(plan, self.conditions)
        return OffsetPlan(plan, self.policy, self.conditions)


class OffsetPlan(WrappedPlan):
    """A `protocol.FeedbackPlan`: the tips of another plan, lifted by the foot path, plus a policy's offsets."""

    def __init__(self, plan: Plan, policy: Policy, conditions: Conditions) -> None:
        """Wrap a plan that has not advanced yet."""
        super().__init__(plan)
        self._policy, self.made_for = policy, conditions
        self._targets = TipTargets(plan.starts, conditions, plan.stride)
        self._tips = standing_tips(plan.starts, conditions.standing_height, plan.stride)
        self._stance = np.ones(plan.starts.shape)
        self._felt, self._sensed = np.zeros((len(plan.starts), FELT)), np.zeros((len(plan.starts), 1), dtype=bool)

    def sense(self, sensed: Sensed) -> None:
        """Store the sensed numbers for the policy; pass `sensed` on if the inner plan has sensory feedback."""
        if isinstance(self._plan, FeedbackPlan):
            self._plan.sense(sensed)
        self._sensed[sensed.ids] = True
        planned = self._stance[sensed.ids], self._tips[sensed.ids]
        self._felt[sensed.ids] = felt(
            self.made_for.body, sensed.tilt, sensed.velocity, sensed.turning, sensed.contact, *planned
        )

    def advance(self, steps: int) -> PlannedWalk:
        """Plan the next steps; the policy computes the offsets of each step from the numbers sensed last."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> PlannedWalk:
        step, count = copied(super().advance(1)), len(self.starts)
        seen = np.where(self._sensed, self._felt, self._upright(step.velocity[0]))
        actions = np.asarray(self._policy(seen), dtype=float)
        if actions.shape != (count, 18) or np.isnan(actions).any():
            raise InputError(f"the policy returned NaN or the shape {actions.shape}; expected {(count, 18)} numbers")
        offset = np.clip(actions, -1.0, 1.0).reshape(count, 6, 3)
        offset = self.made_for.body.lengths.largest_tip_offset * offset
        self._tips, self._stance = self._targets.follow(step, np.arange(count))[:, -1], step.stance[0].astype(float)
        x, y, up = np.moveaxis(self._tips + offset, -1, 0)
        rear, front = np.minimum(step.x[0], self.stride.pep_min), np.maximum(step.x[0], self.stride.aep0)
        x = np.clip(x - np.array(self.stride.geometry.origin), rear, front)
        height = up + self.made_for.standing_height
        return replace(step, x=x[None], y=y[None], height=height[None])

    def _upright(self, velocity: np.ndarray) -> np.ndarray:
        """Return the numbers that an upright, undisturbed insect would sense at a velocity, (start,)."""
        still = np.zeros((len(self.starts), 3))
        ahead = np.stack([velocity * self.made_for.vp, still[:, 0], still[:, 0]], axis=1)
        return felt(self.made_for.body, still[:, :2], ahead, still, self._stance, self._stance, self._tips)
