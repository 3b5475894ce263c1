"""One insect that walks on and on, whose controller, velocity and conditions may change on the way."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from hexmj.body import ROOT_QPOS
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller, Plan, SteerableController, SteerablePlan
from hexmj.errors import InputError
from hexmj.physics.foot_path import OrdersFromPlan, steps_in_chunk
from hexmj.physics.outcomes import measured_walk
from hexmj.physics.pushes import Push, steps_pushed
from hexmj.physics.rollout import Chunk, Rollout, next_orders
from hexmj.physics.settle import settle
from hexmj.rotations import rotated
from hexmj.stability import walk_margin
from hexmj.timing import MOST_STEPS, Stride
from hexmj.validate import leg_last, number, numbers
from hexmj.walks import PlannedWalk, joined, part_of

ONLY = np.array([0])
"""The index of the only insect."""

STRONGEST_PUSH = 80.0
"""Strongest push, as of `hexmj disturb` [body mass times V_p]."""


@dataclass(frozen=True, eq=False)
class Moment:
    """State of an insect at the end of a step."""

    seconds: float
    """Time since the walk began [s]."""
    velocity: float
    """Commanded V_r, a fraction of V_p."""
    qpos: np.ndarray
    """(position,) as MuJoCo has them."""
    feet: np.ndarray
    """(leg, 3) in the world [mm]."""
    planned_tips: np.ndarray
    """(leg, 3) commanded tips in the world [mm]."""
    centre_of_mass: np.ndarray
    """(3,) in the world [mm]."""
    stance: np.ndarray
    """(leg,) which feet stand."""
    planned_stance: np.ndarray
    """(leg,) which legs retract in the plan."""
    margin: float
    """Measured stability margin [mm]."""
    planned_margin: float
    """Stability margin of the plan [mm]."""


class SteeredPlan:
    """A plan of one start that another controller can take over; steps count from the first controller's begin."""

    def __init__(self, controller: Controller, starts: np.ndarray, velocity: float, stride: Stride) -> None:
        """Begin at `starts`, (1, leg) [mm]."""
        self.starts, self.stride, self.done = starts, stride, 0
        self.current: Plan = begin(controller, starts, velocity, stride, threads=1)
        self.made_for = getattr(self.current, "made_for", None)

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps."""
        walk = self.current.advance(steps)  # the physics checks it
        self.done += steps
        return replace(walk, time=np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt)

    def hand_over(self, controller: Controller, velocity: float) -> bool:
        """Let a controller continue at V_r from the current tips and stance; it knows nothing else of the last plan.

        Returns:
            Whether both the last plan and the controller can be steered; otherwise nothing has changed.
        """
        if not (isinstance(controller, SteerableController) and isinstance(self.current, SteerablePlan)):
            return False
        plan = cast(SteerablePlan, begin(controller, self.starts, velocity, self.stride, at_speed=True))
        plan.see(self.current.tips.copy(), self.current.standing.copy())
        self.current = plan
        return True


class LiveWalk:
    """A walk of one insect, advanced in steps."""

    moment: Moment
    """The current state."""
    trace: list[Moment]
    """Steps of the last call of `advance`; the last one is `moment`."""
    fell_on: str
    """Part of the trunk that has touched the ground; "" while the insect walks."""

    def __init__(
        self,
        controller: Controller,
        velocity: float,
        start: np.ndarray,
        conditions: Conditions = Conditions(),
        stride: Stride = Stride(),
    ) -> None:
        """Settle at a start.

        Args:
            controller: plans the walk.
            velocity: V_r as a fraction of V_p.
            start: tips on their own axes, all standing, (leg,) [mm].
            conditions: of the walk.
            stride: of the plan.

        Raises:
            InputError: the insect cannot walk with these values.
        """
        self.controller, self.velocity = controller, number("velocity", velocity)
        self.start = numbers("start", leg_last(start))
        self.conditions, self.stride = conditions, stride
        self.begin()

    def begin(self, start: np.ndarray | None = None, conditions: Conditions | None = None) -> None:
        """Begin again, at another start or under other conditions if these are given.

        Raises:
            InputError: the insect cannot walk with these values; the last walk continues.
        """
        start = self.start if start is None else numbers("start", leg_last(start))
        conditions = conditions or self.conditions
        check_ground(conditions)
        settled = settle(start[np.newaxis], conditions, self.stride, threads=1)
        plan = SteeredPlan(self.controller, settled.starts, self.velocity, self.stride)
        orders = OrdersFromPlan(settled, plan, MOST_STEPS * self.stride.dt)
        with self._restored_if_it_fails():
            self._plan, self._orders, self._push = plan, orders, Push(np.zeros(1), np.zeros(1))
            self._rollout = Rollout(settled, self._push, threads=1)
            self._push_steps = steps_in_chunk(settled.substeps)
            self.start, self.conditions, self.settled = start, conditions, settled
            self.trace, self.fell_on, self._time_left = [], "", 0.0
            self._last_step: PlannedWalk | None = None
            self._walk(2)  # the second step shows the end of the first

    def steer(self, *, velocity: float | None = None, controller: Controller | None = None) -> bool:
        """Change V_r, the controller, or both, from the next step on.

        If a controller cannot continue from the current legs, the walk begins again at its start.

        Returns:
            Whether the walk continued.

        Raises:
            InputError: a bad velocity or controller; the last walk continues.
        """
        velocity = self.velocity if velocity is None else number("velocity", velocity)
        controller = self.controller if controller is None else controller
        with self._restored_if_it_fails():
            self.velocity, self.controller = velocity, controller
            if self._plan.hand_over(controller, velocity):
                return True
            self.begin()
        return False

    @contextmanager
    def _restored_if_it_fails(self) -> Iterator[None]:
        """Continue the last walk after an error."""
        before = vars(self).copy()
        try:
            yield
        except Exception:
            vars(self).update(before)
            raise

    def push(self, impulse: float) -> None:
        """Push from the side at the root, within the next `pushes.PUSH_LASTS` or two. It replaces an earlier push.

        Args:
            impulse: to the left, as of `hexmj disturb` [body mass times V_p].

        Raises:
            InputError: the impulse is out of range, or the steps of the plan cannot hold a push.
        """
        impulse = number("impulse", impulse, -STRONGEST_PUSH, STRONGEST_PUSH)
        self._push_steps = steps_pushed(self.conditions, self.stride)
        self._push.impulse[:] = impulse * self.conditions.body.mass * self.conditions.vp
        self._push.time[:] = (self._plan.done // self._push_steps + 1) * self._push_steps * self.stride.dt

    def advance(self, seconds: float) -> Moment:
        """Walk for a time, in whole steps of the plan; later calls make up for the remainder.

        Returns:
            The current state; that before the fall if the insect has fallen.

        Raises:
            InputError: a bad time, more than `MOST_STEPS` in all, the end of the ground, or a failing controller.
            SimulationError: the simulation diverged.
        """
        self._time_left += number("seconds", seconds, 0.0, 60.0)
        self.trace = []
        step = self.conditions.seconds(self.stride)
        steps = int(self._time_left / step + 1e-9)
        self._time_left -= steps * step
        while steps > 0 and not self.fell_on:
            until_push = self._push_steps - self._plan.done % self._push_steps
            now = min(steps, steps_in_chunk(self.settled.substeps), until_push)
            if self._plan.done + now >= MOST_STEPS:
                raise InputError(f"the walk has {MOST_STEPS:g} steps, the most possible; begin it again")
            self._walk(now)
            steps -= now
        return self.moment

    def _walk(self, steps: int) -> None:
        chunk = self._rollout.carry_out(next_orders(self._rollout, self._plan.current, self._orders, ONLY, steps))
        if chunk.fell.any():
            trunk = chunk.sensors[0, chunk.valid[0] - 1, self.settled.compiled.columns.trunk]
            self.fell_on = self.conditions.body.trunk[int(np.argmax(trunk > 0))]
        self.trace += self._moments(chunk)
        if self.trace:
            self.moment = self.trace[-1]

    def _moments(self, chunk: Chunk) -> Iterator[Moment]:
        """States of a chunk: the insect and its plan as each step but the first begins, until the insect falls."""
        columns, walk, centre = measured_walk(chunk, self.settled)
        margins = walk_margin(walk, threads=1)[:, 0]
        plan = joined([self._last_step or part_of(chunk.plan, slice(1)), chunk.plan])
        self._last_step = part_of(chunk.plan, slice(-1, None))
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
