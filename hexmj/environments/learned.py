"""A learned policy as a controller: it adds offsets to the tips that another controller plans.

A policy receives sensed numbers (`felt`), in an environment from its observations and in a walk of the package from
`Sensed`. It answers with actions of the environment with offsets, each from -1 to 1. A policy that was trained in the
environment therefore walks wherever a controller does, the league included. In a kinematic walk nothing is sensed:
there the insect is upright, walks at the commanded velocity and stands on the feet that it plans to stand on.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Protocol

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
"""Columns of the sensed numbers, see `felt`."""

FELT = 38
"""Number of sensed numbers."""

OBSERVED = "orientation", "velocity", "angular_velocity", "contact", "planned_stance", "planned_tips"
"""Observations of an environment from which the sensed numbers are computed."""

MOST = 10.0
"""Bound of the sensed numbers, in units of their usual sizes."""


class Policy(Protocol):
    """A frozen dataclass of plain data that answers sensed numbers, (n, `FELT`), with actions, (n, leg * axis)."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Return offsets forward, left and up of each tip, in `Lengths.largest_tip_offset`, clipped to -1 and 1.

        In a walk, tips are also clipped to the range between PEP_min and AEP_0, unless the plan itself goes beyond:
        controllers keep their tips there (`check-controller`). The environment does not clip them.
        """
        ...


def felt(body: Body, *parts: np.ndarray) -> np.ndarray:
    """Return the numbers that policies receive, (n, `FELT`), clipped to `MOST`.

    Args:
        body: its standing height scales lengths and velocities.
        parts: tilt ahead and to the left, velocity, turning, contact, planned stance and planned tips, each (n, ...).
            They are divided by their usual sizes: 0.1 rad, five standing heights a second, 2 rad/s, 1, 1, and a
            standing height.
    """
    count, high = len(parts[0]), body.standing_height
    usual = 0.1, 5.0 * high, 2.0, 1.0, 1.0, high
    columns = [part.reshape(count, -1) / size for part, size in zip(parts, usual, strict=True)]
    return np.concatenate(columns, axis=1).clip(-MOST, MOST)


def felt_in(observations: dict[str, np.ndarray], body: Body = STICK_INSECT) -> np.ndarray:
    """Return the sensed numbers, (n, `FELT`), of a vector environment's observations; of a single one (`FELT`,)."""
    orientation, *others = (np.asarray(observations[name]) for name in OBSERVED)
    tilt = np.arcsin(np.clip(lean(orientation.reshape(-1, 4))[0], -1.0, 1.0))
    sensed = felt(body, tilt, *others)
    return sensed if orientation.ndim > 1 else sensed[0]


@dataclass(frozen=True)
class WithOffsets(Wrapper):
    """A controller whose planned tips are offset by a policy."""

    controller: Controller = field(default=LDVS, kw_only=True)
    """The controller that plans."""
    policy: Policy
    """The learned policy."""
    conditions: Conditions = field(default_factory=Conditions)
    """Conditions of the walk: their V_p and foot path lift and lower the feet, and their body scales the offsets.
    Physical walks under other conditions are refused."""
    name: str = "learned"

    def wrap(self, plan: Any) -> "OffsetPlan":
        """See `Wrapper`; the inner controller must not be made for other conditions."""
        check_made_for(plan, self.conditions)
        return OffsetPlan(plan, self.policy, self.conditions)


class OffsetPlan(WrappedPlan):
    """A `protocol.FeedbackPlan`: another plan's tips with a policy's offsets, and the heights of the foot path."""

    def __init__(self, plan: Plan, policy: Policy, conditions: Conditions) -> None:
        """Wrap a plan at time 0."""
        super().__init__(plan)
        self._policy, self.made_for = policy, conditions
        self._targets = TipTargets(plan.starts, conditions, plan.stride)
        self._tips = standing_tips(plan.starts, conditions.standing_height, plan.stride)
        self._stance = np.ones(plan.starts.shape)
        self._felt, self._sensed = np.zeros((len(plan.starts), FELT)), np.zeros((len(plan.starts), 1), dtype=bool)

    def sense(self, sensed: Sensed) -> None:
        """Store the sensed numbers for the policy, and pass them on to a plan with sensory feedback."""
        if isinstance(self._plan, FeedbackPlan):
            self._plan.sense(sensed)
        self._sensed[sensed.ids] = True
        planned = self._stance[sensed.ids], self._tips[sensed.ids]
        self._felt[sensed.ids] = felt(
            self.made_for.body, sensed.tilt, sensed.velocity, sensed.turning, sensed.contact, *planned
        )

    def advance(self, steps: int) -> PlannedWalk:
        """Plan the next steps, each with the policy's offsets for what is sensed then."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> PlannedWalk:
        step, count = copied(super().advance(1)), len(self.starts)
        seen = np.where(self._sensed, self._felt, self._upright(step.velocity[0]))
        actions = np.asarray(self._policy(seen), dtype=float)
        if actions.shape != (count, 18) or np.isnan(actions).any():
            raise InputError(
                f"a policy returned NaN or the shape {actions.shape}; expected (start, leg * axis), {(count, 18)}"
            )
        offset = np.clip(actions, -1.0, 1.0).reshape(count, 6, 3)
        offset = self.made_for.body.lengths.largest_tip_offset * offset
        self._tips, self._stance = self._targets.follow(step, np.arange(count))[:, -1], step.stance[0].astype(float)
        x, y, up = np.moveaxis(self._tips + offset, -1, 0)
        rear, front = np.minimum(step.x[0], self.stride.pep_min), np.maximum(step.x[0], self.stride.aep0)
        x = np.clip(x - np.array(self.stride.geometry.origin), rear, front)
        height = up + self.made_for.standing_height
        return replace(step, x=x[None], y=y[None], height=height[None])

    def _upright(self, velocity: np.ndarray) -> np.ndarray:
        """Return the sensed numbers of a kinematic walk."""
        still = np.zeros((len(self.starts), 3))
        ahead = np.stack([velocity * self.made_for.vp, still[:, 0], still[:, 0]], axis=1)
        return felt(self.made_for.body, still[:, :2], ahead, still, self._stance, self._stance, self._tips)
