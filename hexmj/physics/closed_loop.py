"""The closed loop, `Body.feedback`: before each of its steps the network reads the legs as they are.

Its decisions (Eq. 1-6: influences, the crossing of PEP and AEP) read

- the tips where the joint angles put them in the root frame, on each leg's axis;
- the contacts: a leg that protracts stands as soon as its foot meets the ground again, having been off it for
  longer than `Body.contact_gap`.  At an obstacle the swing ends there.

A leg that should stand and has no ground counts as standing.  Told to its neighbours as one that protracts until
its foot has met the ground, it keeps them down until they hang as well: over a step of 3 mm the FLSS was 0.52 instead
of 0.41 (0.36 in the open loop; LDVS, V = 0.3, the same 96 starts, a trial before this module was written).

The targets of the servos are not the tips as read.  They go on by -V_r dt or +dt and take up what the plan makes of the
tip as read only where the leg changes its state, or where the plan puts it elsewhere, as after a halt; a target that
restarts from the lagging tip at every step never loads its servo, and all of 48 starts fell at V = 0.5 and
V_p = 20 mm/s instead of 24 (the same trial).

On the flat ground at V_p = 80 mm/s the tips as read lie 0.1 mm from the targets of standing legs, within 0.3 mm for
95 % of the time, and feedback changes next to nothing.  A load spreads the feet: with twice the insect's weight the
hind tips stand 0.4 mm farther back than ordered, the network lets them swing too early, and more starts fall.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hexmj.errors import InputError
from hexmj.physics.joint_targets import JointTargets, Orders
from hexmj.physics.stretches import Insects, Stretch
from hexmj.plans import Plan, SeeingPlan
from hexmj.walks import Walk, joined

SAME = 1e-9
"""A tip moved on from where the plan saw it if it is no farther than this from there by one step's way [mm]."""


def closed_loop(insects: Insects, plan: Plan, duration: float) -> Iterator[Stretch]:
    """Walk by a plan that reads the legs before each of its steps, until `duration` [time units].

    Raises:
        InputError: a plan that cannot see.
    """
    if not isinstance(plan, SeeingPlan):
        raise InputError(
            f"feedback = True; expected a plan that can see, as the network can; a {type(plan).__name__} cannot"
        )
    sensed = SensedPlan(plan, insects.settled.starts)
    targets = JointTargets(insects.settled, sensed, duration)
    ids = np.arange(len(insects.settled.starts))
    while len(ids) and (steps := targets.steps_ahead()):
        stretch = insects.obey(_step_by_step(insects, sensed, targets, ids, steps), steps)
        yield stretch
        ids = ids[~stretch.fell]


def _step_by_step(
    insects: Insects, sensed: "SensedPlan", targets: JointTargets, ids: np.ndarray, steps: int
) -> Iterator[Orders]:
    """Orders for one step of the network after the other, each made from what the last one has brought about."""
    for _ in range(steps):
        sensed.sense(ids, insects.tips(ids), insects.carried(ids))
        if orders := targets.ahead(ids, steps=1):
            yield orders


class SensedPlan:
    """A plan that goes on from the tips and contacts that it senses, and orders targets that load the servos.

    Whatever is not sensed is as ordered, so that without `sense` the plan goes on as if nobody walked by it.
    """

    def __init__(self, plan: SeeingPlan, starts: np.ndarray) -> None:
        """All legs stand at the starts, (start, leg) [mm]."""
        self.network, self.done = plan.network, plan.done
        self._plan = plan
        self._tips = self._targets = starts
        self._stance = self._carried = np.ones(starts.shape, dtype=bool)

    def sense(self, ids: np.ndarray, tips: np.ndarray, carried: np.ndarray) -> None:
        """Take in the tips [mm] and which feet the ground carries, both (n, leg), of the starts `ids`."""
        lands = np.zeros(self._stance.shape, dtype=bool)
        lands[ids] = carried & ~self._carried[ids]
        self._tips, self._carried = self._tips.copy(), self._carried.copy()
        self._tips[ids], self._carried[ids] = tips, carried
        self._targets = np.where(lands & ~self._stance, self._tips, self._targets)
        self._stance = self._stance | lands

    def advance(self, steps: int) -> Walk:
        """The next steps: where the tips shall be, and which legs shall stand."""
        return joined([self._step() for _ in range(steps)])

    def _step(self) -> Walk:
        self._plan.see(self._tips, self._stance)
        step = self._plan.advance(1)
        self.done = self._plan.done
        way = np.where(self._stance, -step.velocity[0][:, None], 1.0) * self.network.dt
        goes_on = (step.stance[0] == self._stance) & (np.abs(step.x[0] - self._tips - way) < SAME)
        self._tips = self._targets = np.where(goes_on, self._targets + way, step.x[0])
        self._stance = step.stance[0]
        return replace(step, x=self._targets[None])
