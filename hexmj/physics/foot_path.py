"""From the plan to joint targets: tips in time and space, then inverse kinematics, chunk by chunk.

The plan says where a tip is, whether it swings, and possibly how high it is. If the plan gives no height, the foot is
raised within `Conditions.lift_time` after lift-off. It is lowered over the last `Conditions.landing_time` before the
plan's AEP, so that touchdown is where the plan begins the stance. If the swing ends elsewhere, lowering begins then.
Both times are in ms of the physical world, so they become a vanishing part of the stride as V_p goes to zero.

Since the body sags, a foot meets the ground half a millimetre early. So a foot moves slowly over its last millimetre.
Fine steps (`substeps`) treat feet that strike the ground faster.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.planning import advanced, check_plan
from hexmj.controllers.protocol import Plan
from hexmj.errors import InputError
from hexmj.jitted import jitted
from hexmj.physics.settle import Settled
from hexmj.timing import Stride, steps_within
from hexmj.walks import PlannedWalk

EVENLY = 0.25
"""Share of the step height that is linear in the phase of the lift; it determines the speed at touchdown."""

CHUNK = 40
"""Approximate number of physics steps in a chunk. Short chunks cost calls, long chunks waste steps after a fall."""


class TipTargets:
    """Targets of the tips of many starts, computed from successive steps of a plan."""

    def __init__(self, starts: np.ndarray, conditions: Conditions, stride: Stride, y: np.ndarray | None = None) -> None:
        """Begin with all feet standing at the starts, (start, leg), and at `y`, by default the legs' lines [mm]."""
        self._x = np.array(starts, order="C")
        self._y = np.tile(stride.geometry.y, (len(starts), 1)) if y is None else np.array(y, order="C")
        self._stance = np.ones(starts.shape, dtype=bool)
        self._lift, self._height, self._level = np.zeros((3, *starts.shape))
        self._substeps = conditions.substeps(stride)
        substep = 1000.0 * conditions.seconds(stride) / self._substeps
        self._rates = substep / conditions.lift_time, substep / conditions.landing_time, conditions.landing_distance
        self._heights = conditions.step_height, conditions.standing_height
        self._origin = np.array(stride.geometry.origin)

    def follow(self, plan: PlannedWalk, ids: np.ndarray) -> np.ndarray:
        """Return the targets of the starts `ids`, (n,), at the end of each substep of the plan's next steps.

        Returns:
            Tips in the root frame, (n, substep, leg, 3): forward, left and up [mm].
        """
        tips = np.empty((len(ids), len(plan.time) * self._substeps, 6, 3))
        arrays = plan.x, plan.y, plan.stance, plan.aep, plan.aep_y, plan.height, plan.level
        planned = tuple(map(np.ascontiguousarray, arrays))  # one memory layout, so that numba compiles once
        last = self._x, self._y, self._stance, self._lift, self._height, self._level
        _follow(planned, ids, last, self._substeps, self._rates, self._heights, self._origin, tips)
        for name in ("x", "y", "stance", "level"):
            getattr(self, f"_{name}")[ids] = getattr(plan, name)[-1, ids]
        return tips


@dataclass(frozen=True, eq=False)
class Orders:
    """Joint targets of n starts for the next chunk."""

    plan: PlannedWalk
    """Plan of all starts over the chunk."""
    first: int
    """Index of the chunk's first substep, counted from the beginning of the walk."""
    ids: np.ndarray
    """(n,) indices of the starts that carry out these orders."""
    control: np.ndarray
    """(n, substep, actuator) joint targets [rad], followed by the adhesion of the feet if `Conditions.grasp` is set."""
    tips: np.ndarray
    """(n, substep, leg, 3) targets of the tips before each substep of `control`, in the root frame [mm]."""
    missed: np.ndarray
    """(n, substep, leg) whether the target of a tip is out of reach."""

    def only(self, keep: np.ndarray) -> "Orders":
        """Return the orders of the starts for which `keep`, (n,), is True."""
        few = {name: getattr(self, name)[keep] for name in ("ids", "control", "tips", "missed")}
        return replace(self, **few)


class OrdersFromPlan:
    """Computes the orders of settled starts, chunk by chunk, while their plan advances."""

    tips: np.ndarray
    """(start, leg, 3) current targets of the tips, in the root frame [mm]."""
    steps: int
    """Number of steps of the plan in the whole walk."""

    def __init__(self, settled: Settled, plan: Plan, duration: float, divisor: int = 0) -> None:
        """Begin with all feet standing, at time 0 of a plan that ends after a duration [time units].

        The number of plan steps in a chunk divides `divisor`, see `Push.divisor`.

        Raises:
            InputError: the plan has other starts or another stride, is not at time 0, or is made for other conditions.
        """
        check_plan(plan, settled.starts, settled.stride)
        check_made_for(plan, settled.conditions)
        self._plan, self._settled, self._substeps = plan, settled, settled.substeps
        self.steps, self._done = int(steps_within(duration, settled.stride)), 0
        self._chunk = steps_in_chunk(self._substeps, divisor)
        self._follow = TipTargets(settled.starts, settled.conditions, settled.stride, settled.tips[..., 1]).follow
        self._joints = settled.ctrl[:, settled.compiled.columns.ctrl].reshape(len(settled.ctrl), 6, -1).copy()
        self.tips = settled.tips.copy()

    def steps_ahead(self) -> int:
        """Return the number of plan steps in the next chunk; 0 at the end of the walk."""
        return min(self._chunk, self.steps - self._done)

    def ahead(self, ids: np.ndarray, steps: int | None = None) -> Orders | None:
        """Return the orders of the starts `ids`, (n,), for the next steps, by default a chunk; None after the last.

        A leg with a target out of reach keeps its last joint angles.
        """
        first, m = self._done * self._substeps, self._substeps
        if self._done == self.steps:
            return None
        plan = advanced(self._plan, steps or self.steps_ahead())
        self._done += len(plan.time)
        tips = self._follow(plan, ids)
        joints, reachable = self._settled.compiled.inverse(tips)
        for i in np.flatnonzero(~reachable.all(axis=(1, 2))):
            hold(joints[i], self._joints[ids[i]])
        self._joints[ids] = joints[:, -1]
        tips = np.concatenate([self.tips[ids, None], tips], axis=1)  # targets before each substep
        self.tips[ids] = tips[:, -1]
        control = joints.reshape(*joints.shape[:2], -1)
        if self._settled.conditions.grasp:
            control = np.concatenate([control, plan.stance[:, ids].swapaxes(0, 1).repeat(m, axis=1)], axis=2)
        if self._done == self.steps:  # one more substep records the state at the end
            control = np.concatenate([control, control[:, -1:]], axis=1)
        return Orders(plan, first, ids, control, tips[:, : control.shape[1]], ~reachable)


def steps_in_chunk(substeps: int, divisor: int = 0) -> int:
    """Return the number of plan steps in a chunk, with `substeps` physics steps each; it divides `divisor`."""
    most = max(1, CHUNK // substeps)
    return next(steps for steps in range(most, 0, -1) if divisor % steps == 0)


def check_made_for(plan: Plan, conditions: Conditions) -> None:
    """Check the conditions that a plan names in its attribute `made_for`, if it has one because it lifts the feet.

    Raises:
        InputError: V_p, the path of the feet or the body differs between `made_for` and `conditions`.
    """
    made_for = getattr(plan, "made_for", None)
    if isinstance(made_for, Conditions):
        for name in ("vp", "step_height", "standing_height", "lift_time", "landing_time", "body"):
            expected, found = getattr(conditions, name), getattr(made_for, name)
            if expected != found:
                raise InputError(f"the plan is made for {name} = {found}; the walk has {expected}")


def hold(joints: np.ndarray, last: np.ndarray) -> None:
    """Replace NaN in `joints`, (substep, leg, joint), by those one substep before; `last` precedes the first."""
    for angles in joints:
        missing = np.isnan(angles)
        angles[missing] = last[missing]
        last = angles


@jitted
def _follow(planned: Any, ids: Any, last: Any, m: int, rates: Any, heights: Any, origin: Any, tips: Any) -> None:
    """Write the targets of the tips, which move evenly between two steps of the plan, to `tips`.

    Unless planned, the height is a smooth function of the phase of the lift. The phase rises to 1 in swing. It is
    lowered to 0 in stance, and over the last `landing` [mm] before the AEP to the share of `landing` that is left."""
    x, y, stance, aep, aep_y, own_height, level = planned
    x_old, y_old, s_old, lift, height_old, level_old = last
    rise, sink, landing = rates
    step_height, standing_height = heights
    for i, start in enumerate(ids):
        for leg in range(6):
            x_from, y_from, s = x_old[start, leg], y_old[start, leg], s_old[start, leg]
            phase, height, low = lift[start, leg], height_old[start, leg], level_old[start, leg]
            for n in range(len(x)):
                x_to, y_to, end, own = x[n, start, leg], y[n, start, leg], aep[n, start, leg], own_height[n, start, leg]
                ahead, height_from, aside = x_to >= x_from, height, aep_y[n, start, leg]
                for sub in range(m):
                    part = (sub + 1.0) / m
                    at = x_from + (x_to - x_from) * part
                    y_at = y_from + (y_to - y_from) * part
                    left = end - at if ahead else at - end
                    left = left if np.isnan(aside) else np.hypot(end - at, aside - y_at)
                    goal = 0.0 if s else 1.0 if np.isnan(end) else min(max(left / landing, 0.0), 1.0)
                    phase = min(phase + rise, max(phase - sink, goal))
                    if np.isnan(own):
                        height = step_height * (EVENLY * phase + (1.0 - EVENLY) * phase**4 * (5.0 - 4.0 * phase))
                    else:
                        height = height_from + (own - height_from) * part
                    tip = tips[i, n * m + sub, leg]
                    tip[0] = origin[leg] + at
                    tip[1] = y_at
                    tip[2] = low + (level[n, start, leg] - low) * part + height - standing_height
                x_from, y_from, s, low = x_to, y_to, stance[n, start, leg], level[n, start, leg]
            lift[start, leg], height_old[start, leg] = phase, height
