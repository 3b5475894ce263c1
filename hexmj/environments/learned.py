"""What was learned, as a controller: a policy adds offsets to the tips that another controller plans.

A policy sees what a robot feels (`felt`), in an environment from its observations, in a walk of the package from
`Sensed`; and it answers with actions of the environment whose actions are offsets, each from -1 to 1.  So what was
trained there walks wherever a controller does, in the league too.  On paper nobody feels anything: there the insect is
upright, as fast as it is told and stands on the feet that it plans to stand on.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from hexmj.body import STICK_INSECT, Body
from hexmj.checks import NO_ARRAY, numbers, short, typed
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, Sensed, limits_within
from hexmj.errors import InputError
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.orders import check_made_for
from hexmj.rotations import lean
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PlannedWalk, copied, joined

TILT, VELOCITY, TURNING = slice(0, 2), slice(2, 5), slice(5, 8)
CONTACT, STANCE, TIPS = slice(8, 14), slice(14, 20), slice(20, 38)
"""Columns of what is felt; see `felt`."""

FELT = 38
"""Numbers that are felt."""

SEEN = {
    "orientation": (4,),
    "velocity": (3,),
    "angular_velocity": (3,),
    "contact": (6,),
    "planned_stance": (6,),
    "planned_tips": (6, 3),
}
"""Observations of an environment, of which it is made, by their shapes for one insect."""

MOST = 10.0
"""Greatest number that is felt, in usual sizes; beyond it nothing is told apart."""


class Policy(Protocol):
    """A frozen dataclass of plain data that answers what is felt, (n, `FELT`), with actions, (n, leg * axis)."""

    def __call__(self, felt: np.ndarray) -> np.ndarray:
        """Offsets forward, left and up of each tip, in `Lengths.largest_tip_offset`; cut off at -1 and 1.

        Walks cut off, too, what leads a tip ahead of AEP_0 or behind PEP_min where the plan does not go there itself:
        plans keep to where legs step (`check-controller`).  The environment does not.
        """
        ...


def felt(body: Body, *parts: np.ndarray) -> np.ndarray:
    """What policies see, (n, `FELT`): tilt ahead and to the left, velocity, turning, contact, planned stance and tips.

    Each is (n, ...), and divided by its usual size: 0.1 rad, five standing heights of the body a second, 2 rad/s, and a
    standing height, so that it is of the size of 1; it ends at `MOST`.
    """
    count, high = len(parts[0]), body.standing_height
    usual = 0.1, 5.0 * high, 2.0, 1.0, 1.0, high
    columns = [one.reshape(count, -1) / size for one, size in zip(parts, usual, strict=True)]
    return np.concatenate(columns, axis=1).clip(-MOST, MOST)


def felt_in(observations: dict[str, np.ndarray], body: Body = STICK_INSECT) -> np.ndarray:
    """The same from the observations of a vector environment of this body; (`FELT`,) from those of a single one.

    Raises:
        InputError: other observations than its dictionary, or of other shapes.
    """
    if missing := [name for name in SEEN if name not in typed("observations", observations, Mapping)]:
        raise InputError(f"observations of {', '.join(map(str, observations)):.200}; expected {missing[0]}, too")
    told = {name: _observed(name, observations[name]) for name in SEEN}
    several = told["orientation"].shape[:-1][:1]
    for name, shape in SEEN.items():
        if told[name].shape != several + shape:
            raise InputError(f"{name} of the shape {told[name].shape}; expected {several + shape}")
    orientation, *others = told.values() if several else (values[None] for values in told.values())
    seen = felt(typed("body", body, Body), np.arcsin(np.clip(lean(orientation)[0], -1.0, 1.0)), *others)
    return seen if several else seen[0]


def _observed(name: str, values: Any) -> np.ndarray:
    with suppress(*NO_ARRAY):
        array = np.asarray(values)
        if array.dtype.kind in "biuf":
            return array
    raise InputError(f"{name} = {short(values)}; expected numbers")


@dataclass(frozen=True)
class WithOffsets:
    """A controller whose plan's tips are offset by a policy."""

    policy: Policy
    """What was learned."""
    controller: Controller = LDVS
    """What plans."""
    conditions: Conditions = field(default_factory=Conditions)
    """Under which it walks: of their V_p and path the feet are lifted and lowered, and offsets are those of their body.
    A walk whose own are others is refused."""
    name: str = field(default="learned")

    check_velocity = property(limits_within)

    def begin(
        self,
        starts: np.ndarray,
        velocity: np.ndarray,
        stride: Stride,
        acceleration: Acceleration | None = None,
        threads: int | None = None,
    ) -> "OffsetPlan":
        """See `protocol.Controller.begin`.

        Raises:
            InputError: the controller was itself made for other conditions.
        """
        plan = self.controller.begin(starts, velocity, stride, acceleration, threads)
        check_made_for(plan, self.conditions)
        return OffsetPlan(plan, self.policy, self.conditions)


class OffsetPlan:
    """A `protocol.FeedbackPlan`: another plan's tips with a policy's offsets, and the heights that a body gives them."""

    def __init__(self, plan: Plan, policy: Policy, conditions: Conditions) -> None:
        """Around a plan at time 0."""
        self.starts, self.stride, self.done = plan.starts, plan.stride, plan.done
        self._plan, self._policy, self.made_for = plan, policy, conditions
        self._targets = TipTargets(plan.starts, conditions, plan.stride)
        self._tips = standing_tips(plan.starts, conditions.standing_height, plan.stride)
        self._stance = np.ones(plan.starts.shape)
        self._felt, self._told = np.zeros((len(plan.starts), FELT)), np.zeros((len(plan.starts), 1), dtype=bool)

    def sense(self, sensed: Sensed) -> None:
        """Take in what the policy sees, and what the plan reads if it reads the legs."""
        if isinstance(self._plan, FeedbackPlan):
            self._plan.sense(sensed)
        self._told[sensed.ids] = True
        planned = self._stance[sensed.ids], self._tips[sensed.ids]
        self._felt[sensed.ids] = felt(
            self.made_for.body, sensed.tilt, sensed.velocity, sensed.turning, sensed.contact, *planned
        )

    def advance(self, steps: int) -> PlannedWalk:
        """The next steps, each with the offsets that the policy gives for what is felt then."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> PlannedWalk:
        step, count = copied(self._plan.advance(1)), len(self.starts)
        seen = np.where(self._told, self._felt, self._upright(step.velocity[0]))
        actions = numbers("answer of a policy", self._policy(seen))
        if actions.shape != (count, 18) or np.isnan(actions).any():
            raise InputError(
                f"a policy answers {short(actions)} of the shape {actions.shape}; expected numbers,"
                f" (start, leg * axis), {(count, 18)}"
            )
        offset = np.clip(actions, -1.0, 1.0).reshape(count, 6, 3)
        offset = self.made_for.body.lengths.largest_tip_offset * offset
        self._tips, self._stance = self._targets.follow(step, np.arange(count))[:, -1], step.stance[0].astype(float)
        self.done = self._plan.done
        x, y, up = np.moveaxis(self._tips + offset, -1, 0)
        rear, front = np.minimum(step.x[0], self.stride.pep_min), np.maximum(step.x[0], self.stride.aep0)
        x = np.clip(x - np.array(self.stride.geometry.origin), rear, front)  # where legs step, or the plan itself goes
        height = up + self.made_for.standing_height
        return replace(step, x=x[None], y=y[None], height=height[None])

    def _upright(self, velocity: np.ndarray) -> np.ndarray:
        """What is felt on paper."""
        still = np.zeros((len(self.starts), 3))
        ahead = np.stack([velocity * self.made_for.vp, still[:, 0], still[:, 0]], axis=1)
        return felt(self.made_for.body, still[:, :2], ahead, still, self._stance, self._stance, self._tips)
