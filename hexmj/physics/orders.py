"""From the plan to joint targets, chunk by chunk: plan, tips, inverse kinematics."""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.checked_plans import advanced, check_plan, said
from hexmj.controllers.protocol import Plan
from hexmj.errors import InputError
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.settling import Settled
from hexmj.timing import steps_within
from hexmj.walks import PlannedWalk, part_of

CHUNK = 40
"""Physics steps in a chunk, about: fewer cost more calls, more waste steps after a fall (0.4 to 0.8 %, measured)."""

AHEAD = 8
"""Chunks that are planned at once for one insect: to ask its plan for each took a twelfth of its walk's time."""


@dataclass(frozen=True, eq=False)
class Orders:
    """What some starts shall do in the next chunk."""

    plan: PlannedWalk
    """The plan over the chunk, of all starts."""
    first: int
    """Index of the first substep."""
    ids: np.ndarray
    """(n,) which starts these are."""
    control: np.ndarray
    """(n, substep, actuator) joint targets [rad], and the adhesion of feet that may grasp."""
    tips: np.ndarray
    """(n, substep, leg, 3) where the tips shall be before each of these substeps, in the root frame [mm]."""
    missed: np.ndarray
    """(n, substep, leg) which tips are out of reach."""

    def only(self, keep: np.ndarray) -> "Orders":
        """The orders of some of the starts, (n,)."""
        few = {name: getattr(self, name)[keep] for name in ("ids", "control", "tips", "missed")}
        return replace(self, **few)


def steps_in_chunk(substeps: int, multiple: int = 0) -> int:
    """Steps of a plan in a chunk, of so many physics steps each, of which `multiple` is a whole number."""
    most = max(1, CHUNK // substeps)
    return next(steps for steps in range(most, 0, -1) if multiple % steps == 0)


class OrdersFromPlan:
    """The orders of settled starts, made as their plan goes on."""

    tips: np.ndarray
    """(start, leg, 3) where the tips shall be now, in the root frame [mm]."""

    def __init__(self, settled: Settled, plan: Plan, duration: float, multiple: int = 0) -> None:
        """All legs hold their starts, at time 0 of a plan that ends after a duration [time units].

        As many steps as `multiple` are a whole number of chunks, see `Push.divisor`.

        Raises:
            InputError: a plan of other starts, with another stride, not at time 0, or made for other conditions.
        """
        check_plan(plan, settled.starts, settled.stride)
        check_made_for(plan, settled.conditions)
        self._plan, self._settled, self._steps = plan, settled, int(steps_within(duration, settled.stride))
        self._chunk, self._planned = steps_in_chunk(settled.substeps, multiple), list[PlannedWalk]()
        self._follow = TipTargets(settled.starts, settled.conditions, settled.stride).follow
        self._joints = settled.ctrl[:, settled.compiled.columns.ctrl].reshape(len(settled.ctrl), 6, -1).copy()
        self.tips = standing_tips(settled.starts, settled.conditions.standing_height, settled.stride)

    def steps_ahead(self) -> int:
        """Steps of the plan in the next chunk, 0 where the walk has ended."""
        return min(self._chunk, self._steps - self._done)

    def ahead(self, ids: np.ndarray, steps: int | None = None) -> Orders | None:
        """The orders of some starts, (n,), for the next steps, a chunk unless told; none where the walk has ended.

        A leg whose tip is out of reach keeps its last angles.
        """
        done, m = self._done, self._settled.substeps
        if done == self._steps:
            return None
        plan = self._next_chunk() if steps is None else advanced(self._plan, steps)
        tips = self._follow(plan, ids)
        joints, reachable = self._settled.compiled.inverse(tips)
        for i in np.flatnonzero(~reachable.all(axis=(1, 2))):
            hold(joints[i], self._joints[ids[i]])
        self._joints[ids] = joints[:, -1]
        tips = np.concatenate([self.tips[ids, None], tips], axis=1)  # the insect is shown before each substep
        self.tips[ids] = tips[:, -1]
        control = joints.reshape(*joints.shape[:2], -1)
        if self._settled.conditions.grasp:
            control = np.concatenate([control, plan.stance[:, ids].swapaxes(0, 1).repeat(m, axis=1)], axis=2)
        if self._done == self._steps:  # one substep more shows the state at the end
            control = np.concatenate([control, control[:, -1:]], axis=1)
        return Orders(plan, done * m, ids, control, tips[:, : control.shape[1]], ~reachable)

    @property
    def _done(self) -> int:
        """Steps of the plan that are ordered."""
        return int(self._plan.done) - sum(len(one.time) for one in self._planned)

    def _next_chunk(self) -> PlannedWalk:
        if not self._planned:
            chunks = AHEAD if len(self._settled.starts) == 1 else 1
            steps, size = min(chunks * self._chunk, self._steps - self._done), self._chunk
            planned = advanced(self._plan, steps)
            self._planned = [part_of(planned, slice(begin, begin + size)) for begin in range(0, steps, size)][::-1]
        return self._planned.pop()


def check_made_for(plan: Plan, conditions: Conditions) -> None:
    """Refuse a plan that lifts the feet itself for another V_p, path or body, as its `made_for`, if it has it, tells.

    Raises:
        InputError: it does.
    """
    with said("a plan, made_for"):
        made_for = getattr(plan, "made_for", None)
    if isinstance(made_for, Conditions):
        here, there = conditions.settings(), made_for.settings()
        for name in ("vp", "step_height", "standing_height", "lift_time", "landing_time", "body"):
            if here[name] != there[name]:
                raise InputError(
                    f"the plan is made for {name} = {there[name]}; expected that of the conditions, {here[name]}"
                )
        if conditions.body != made_for.body:
            raise InputError(f"the plan is made for another body that is called {there['body']}; expected this one")


def hold(joints: np.ndarray, last: np.ndarray) -> None:
    """Replace missing angles, (substep, leg, joint), by those before them, at first by `last`."""
    for now in joints:
        missing = np.isnan(now)
        now[missing] = last[missing]
        last = now
