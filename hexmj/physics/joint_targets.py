"""From the network's plan to joint targets, stretch by stretch: plan, tips, inverse kinematics."""

from dataclasses import dataclass, replace

import numpy as np

from hexmj.network import steps_within
from hexmj.physics import insect
from hexmj.physics.kinematics import tips_to_joints
from hexmj.physics.settling import Settled
from hexmj.physics.targets import TipTargets, standing_tips
from hexmj.plans import Plan
from hexmj.walks import Walk

STRETCH = 40
"""Physics steps in a stretch, about: fewer cost more calls, more waste steps after a fall (0.4 to 0.8 %, measured)."""


@dataclass(frozen=True, eq=False)
class Orders:
    """What some starts shall do in the next stretch."""

    plan: Walk
    """The plan over the stretch, of all starts."""
    first: int
    """Index of the first substep."""
    ids: np.ndarray
    """(n,) which starts these are."""
    control: np.ndarray
    """(n, substep, actuator) joint targets [rad], and the adhesion of feet that may grasp."""
    tips: np.ndarray
    """(n, substep, leg, 3) where the tips shall be before each of these substeps, in the root frame [mm]."""
    missed: np.ndarray
    """(n, substep) number of tips out of reach."""

    def only(self, keep: np.ndarray) -> "Orders":
        """The orders of some of the starts, (n,)."""
        few = {name: getattr(self, name)[keep] for name in ("ids", "control", "tips", "missed")}
        return replace(self, **few)


class JointTargets:
    """The joint targets of settled starts, made as the plan goes on."""

    def __init__(self, settled: Settled, plan: Plan, duration: float) -> None:
        """All legs hold their starts; `plan` is at time 0 and ends at `duration` [time units]."""
        self._plan = plan
        self._steps = int(steps_within(duration, settled.network))
        self._substeps = settled.body.substeps(settled.network)
        self._tips = TipTargets(settled.starts, settled.body, settled.network)
        self._legs = insect.dimensions(settled.mujoco_model)
        self._last = settled.ctrl[:, : insect.JOINT_ACTUATORS].reshape(-1, 6, 3).copy()
        self._last_tips = standing_tips(settled.starts, settled.body, settled.network)
        self._grasps = settled.mujoco_model.nu > insect.JOINT_ACTUATORS

    def steps_ahead(self) -> int:
        """Steps of the network in the next stretch, 0 where the walk has ended."""
        return min(max(1, STRETCH // self._substeps), self._steps - self._plan.done)

    def ahead(self, ids: np.ndarray, steps: int | None = None) -> Orders | None:
        """The orders of the starts `ids` for the next `steps`, a stretch unless given; none where the walk has ended.

        A leg whose tip is out of reach keeps its last angles.
        """
        first = self._plan.done * self._substeps
        if self._plan.done == self._steps:
            return None
        plan = self._plan.advance(steps or self.steps_ahead())
        tips = self._tips.follow(plan, ids)
        joints, reachable = tips_to_joints(tips, self._legs)
        for i in np.flatnonzero(~reachable.all(axis=(1, 2))):
            _hold(joints[i], self._last[ids[i]])
        self._last[ids] = joints[:, -1]
        tips = np.concatenate([self._last_tips[ids, None], tips], axis=1)  # the insect is shown before each substep
        self._last_tips[ids] = tips[:, -1]
        control, missed = joints.reshape(*joints.shape[:2], -1), (~reachable).sum(axis=2)
        if self._grasps:
            held = plan.stance[:, ids].swapaxes(0, 1).repeat(self._substeps, axis=1)
            control = np.concatenate([control, held], axis=2)
        if self._plan.done == self._steps:  # one substep more shows the state at the end
            control = np.concatenate([control, control[:, -1:]], axis=1)
        return Orders(plan, first, ids, control, tips[:, : control.shape[1]], missed)


def _hold(joints: np.ndarray, last: np.ndarray) -> None:
    """Replace missing angles, (substep, leg, joint), by those before them, at first by `last`."""
    for now in joints:
        missing = np.isnan(now)
        now[missing] = last[missing]
        last = now
