"""One insect that walks on and on, by a controller and conditions that may change while it goes.

Knows nothing of who looks at it, nor of the time on the wall.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hexmj.body import ROOT_QPOS
from hexmj.checks import given, numbers, typed
from hexmj.conditions import Bound, Conditions, check_ground
from hexmj.controllers.checked_plans import begin
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.legs import leg_last
from hexmj.physics.foot_path import Orders, OrdersFromPlan, steps_in_chunk
from hexmj.physics.outcomes import measured_walk
from hexmj.physics.pushes import Push, steps_pushed
from hexmj.physics.rollout import Chunk, Rollout
from hexmj.physics.settle import settle
from hexmj.rotations import rotated
from hexmj.stability import walk_margin
from hexmj.timing import MOST_STEPS, Stride
from hexmj.view.steered import Steered
from hexmj.walks import PlannedWalk, joined, part_of

ONLY = np.array([0])
"""The index of the only insect."""

AT_ONCE = Bound(0.0, 60.0, "s", closed=True)
"""How long it walks in one go."""

PUSHES = Bound(-80.0, 80.0, "times m V_p", closed=True)
"""As of `hexmj disturb`, from either side."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What is seen of an insect at the end of a step."""

    seconds: float
    """Since the walk began [s]."""
    velocity: float
    """Commanded V_r, a fraction of V_p."""
    qpos: np.ndarray
    """(position,) as MuJoCo has them."""
    feet: np.ndarray
    """(leg, 3) in the world [mm]."""
    planned_tips: np.ndarray
    """(leg, 3) where the tips shall be, in the world [mm]."""
    centre_of_mass: np.ndarray
    """(3,) in the world [mm]."""
    stance: np.ndarray
    """(leg,) which feet stand."""
    planned_stance: np.ndarray
    """(leg,) which legs retract in the plan."""
    margin: float
    """Measured stability margin [mm]."""
    planned_margin: float
    """Of the plan [mm]."""


class LiveWalk:
    """The insect, wherever its steps have brought it."""

    moment: Moment
    """What is seen now."""
    trace: list[Moment]
    """Steps since `advance` was last called, the last one is `moment`, or since a viewer took them."""
    fell_on: str
    """Part of the trunk that has touched the ground; nothing while it walks."""

    def __init__(
        self,
        controller: Controller,
        velocity: float,
        start: np.ndarray,
        conditions: Conditions | None = None,
        stride: Stride | None = None,
    ) -> None:
        """Settle at a start and be about to walk.

        Args:
            controller: plans the walk.
            velocity: V_r as a fraction of V_p.
            start: tips on their own axes, all standing, (leg,) [mm].
            conditions: of the walk.
            stride: of the plan.

        Raises:
            InputError: a value that makes no sense.
        """
        self.controller, self.velocity = controller, typed("velocity", velocity, float)
        self.start = numbers("start", leg_last(start))
        self.conditions = given("conditions", conditions, Conditions)
        self.stride = given("stride", stride, Stride)
        self.begin()

    def begin(self, start: np.ndarray | None = None, conditions: Conditions | None = None) -> None:
        """Begin again, at another start or under other conditions where these are given.

        Raises:
            InputError: the insect cannot walk so; the walk goes on as it was.
        """
        start = self.start if start is None else numbers("start", leg_last(start))
        wanted: Conditions = typed("conditions", self.conditions if conditions is None else conditions, Conditions)
        check_ground(wanted)
        settled = settle(start[np.newaxis], wanted, self.stride, threads=1)
        plan, before = Steered(self.controller, settled.starts, self.velocity, self.stride), vars(self).copy()
        orders = OrdersFromPlan(settled, plan, MOST_STEPS * self.stride.dt)
        self._plan, self._orders, self._push = plan, orders, Push(np.zeros(1), np.zeros(1))
        self._insects = Rollout(settled, self._push, threads=1)
        self._lasts = steps_in_chunk(settled.substeps)
        self.start, self.conditions, self.settled = start, wanted, settled
        self.trace, self.fell_on = [], ""
        self._before: PlannedWalk | None = None
        self._left = 0.0
        try:
            self._walk(2)  # shows the end of the first
        except Exception:
            vars(self).update(before)
            raise

    def steer(self, *, velocity: float | None = None, controller: Controller | None = None) -> bool:
        """Change V_r, the controller, or both.

        They take effect from the next step on, the legs as they are (`Steered.hand_over`).  Where a controller cannot
        go on from legs as they are, the walk begins again at its start.

        Returns:
            Whether the walk went on.

        Raises:
            InputError: a velocity or controller that makes no sense; the walk goes on as it was.
        """
        wanted: float = typed("velocity", self.velocity if velocity is None else velocity, float)
        controller = self.controller if controller is None else controller
        begin(controller, self.start[np.newaxis], wanted, self.stride, threads=1)  # refuses what makes no sense
        before, self.velocity, self.controller = (self.velocity, self.controller), wanted, controller
        try:
            if self._plan.hand_over(controller, wanted):
                return True
            self.begin()
        except Exception:
            self.velocity, self.controller = before
            raise
        return False

    def push(self, impulse: float) -> None:
        """Push from the side at the root, within the next `pushes.PUSH_LASTS` or two, in place of an earlier push.

        Args:
            impulse: to the left, in multiples of the body's mass times V_p, as of `hexmj disturb`.

        Raises:
            InputError: one of more than 80, or see `pushes.steps_pushed`.
        """
        PUSHES.check("impulse", impulse := typed("impulse", impulse, float))
        self._lasts = steps_pushed(self.conditions, self.stride)
        self._push.impulse[:] = impulse * self.conditions.body.mass * self.conditions.vp
        self._push.time[:] = (self._plan.done // self._lasts + 1) * self._lasts * self.stride.dt

    def advance(self, seconds: float) -> Moment:
        """Walk on by so much time, in whole steps of the plan; what is left over is made up for by later calls.

        Returns:
            What is seen then; of an insect that has fallen, what was seen last.

        Raises:
            InputError: no time or a minute at once, more than `MOST_STEPS` in all, it walks off the ground that was
                laid, or its controller fails.
            SimulationError: the simulation diverged.
        """
        AT_ONCE.check("seconds", seconds := typed("seconds", seconds, float))
        self._left += seconds
        self.trace = []
        step = self.conditions.seconds(self.stride)
        steps = int(self._left / step + 1e-9)
        self._left -= steps * step
        while steps > 0 and not self.fell_on:
            now = min(steps, steps_in_chunk(self.settled.substeps), self._lasts - self._plan.done % self._lasts)
            if self._plan.done + now >= MOST_STEPS:
                raise InputError(f"a walk of {MOST_STEPS:g} steps has come to its end; expected it to begin again")
            self._walk(now)
            steps -= now
        return self.moment

    def _walk(self, steps: int) -> None:
        chunk = self._insects.carry_out(self._ordered(steps))
        if chunk.fell.any():
            trunk = chunk.sensors[0, chunk.valid[0] - 1, self.settled.compiled.columns.trunk]
            self.fell_on = self.conditions.body.trunk[int(np.argmax(trunk > 0))]
        self.trace += self._moments(chunk)
        if self.trace:
            self.moment = self.trace[-1]

    def _ordered(self, steps: int) -> Iterator[Orders]:
        """Orders for the next steps; to a plan that reads, one by one, from what the last has brought about."""
        for part in [1] * steps if self._plan.reads else [steps]:
            if self._plan.reads:
                self._plan.sense(self._insects.sensed(ONLY))
            orders = self._orders.ahead(ONLY, part)
            assert orders, "`advance` sees to it that no walk is longer"
            yield orders

    def _moments(self, chunk: Chunk) -> Iterator[Moment]:
        """What a chunk shows: the insect, and what was planned, as each but the first step begins, until it falls."""
        columns, walk, centre = measured_walk(chunk, self.settled)
        margins = walk_margin(walk, threads=1)[:, 0]
        plan = joined([self._before or part_of(chunk.plan, slice(1)), chunk.plan])
        self._before = part_of(chunk.plan, slice(-1, None))
        planned_margins = walk_margin(plan, threads=1)[:, 0]
        feet = chunk.sensors[0, :, self.settled.compiled.columns.foot].reshape(-1, 6, 3)
        roots = chunk.qpos[0, :, None, :ROOT_QPOS]
        tips = roots[..., :3] + rotated(roots[..., 3:], chunk.targets[0])
        for n, column in enumerate(columns[columns < chunk.valid[0]]):
            step = column // self.settled.substeps
            yield Moment(
                seconds=float(walk.time[n]) / self.conditions.vp,
                velocity=float(plan.velocity[step, 0]),
                qpos=chunk.qpos[0, column],
                feet=feet[column],
                planned_tips=tips[column],
                centre_of_mass=centre[n, 0],
                stance=walk.stance[n, 0],
                planned_stance=plan.stance[step, 0],
                margin=float(margins[n]),
                planned_margin=float(planned_margins[step]),
            )
