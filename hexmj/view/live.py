"""Live walk of one insect, whose controller, command and conditions can change while it walks."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexmj.body import ROOT_QPOS
from hexmj.command import Command
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.protocol import Controller
from hexmj.controllers.steered import commanded
from hexmj.errors import InputError
from hexmj.physics.foot_path import OrdersFromPlan, steps_in_chunk
from hexmj.physics.outcomes import grounded, measured_walk
from hexmj.physics.pushes import Push, steps_pushed
from hexmj.physics.rollout import Chunk, Rollout, next_orders
from hexmj.physics.settle import settle_plan
from hexmj.rotations import rotated
from hexmj.stability import walk_margin
from hexmj.starts import checked_starts
from hexmj.timing import MOST_STEPS, Stride
from hexmj.validate import leg_last, number, numbers
from hexmj.walks import PlannedWalk, joined, part_of

ONLY = np.array([0])
"""Array with the index of the only insect of a live walk."""

STRONGEST_PUSH = 80.0
"""Maximum impulse of a push, the same as in tasks [body mass times V_p]."""


@dataclass(frozen=True, eq=False)
class Moment:
    """State of the insect and its plan at the end of a step."""

    seconds: float
    """Time since the walk began [s]."""
    velocity: float
    """Commanded velocity forward, a fraction of V_p."""
    qpos: np.ndarray
    """(position,) MuJoCo's positions of the root and the joints."""
    feet: np.ndarray
    """(leg, 3) feet in the world [mm]."""
    planned_tips: np.ndarray
    """(leg, 3) commanded tips in the world [mm]."""
    centre_of_mass: np.ndarray
    """(3,) centre of mass in the world [mm]."""
    stance: np.ndarray
    """(leg,) True where a foot is at the ground."""
    planned_stance: np.ndarray
    """(leg,) True where a leg retracts in the plan."""
    margin: float
    """Stability margin of the feet at the ground [mm]."""
    planned_margin: float
    """Stability margin of the plan [mm]."""


class LiveWalk:
    """A physical walk of one insect that is advanced step by step."""

    moment: Moment
    """Current state of the insect and its plan."""
    trace: list[Moment]
    """States after each step of the last call of `advance`; the last element is `moment`."""
    lost_at: float
    """Time at which static stability is first lost [s]; inf before."""
    fell_on: str
    """Part of the trunk that has touched the ground; "" while the insect walks."""

    def __init__(
        self,
        controller: Controller,
        command: Command | float,
        start: np.ndarray,
        conditions: Conditions = Conditions(),
        stride: Stride = Stride(),
    ) -> None:
        """Let the insect settle at a start and walk its first step.

        Args:
            controller: controller that plans the walk.
            command: command that the insect follows, or V_r straight ahead.
            start: tips on their own axes at time 0, (leg,) [mm]; all feet stand.
            conditions: conditions of the walk.
            stride: stride of the plan.

        Raises:
            InputError: the insect cannot walk with these arguments.
        """
        self.controller, self.command = controller, _command(command)
        self.start = numbers("start", leg_last(start))
        self.conditions, self.stride = conditions, stride
        self.begin()

    def begin(self, start: np.ndarray | None = None, conditions: Conditions | None = None) -> None:
        """Restart the walk, with another start or other conditions if these are given.

        Raises:
            InputError: the insect cannot walk with these arguments; the walk before the call continues.
        """
        start = self.start if start is None else numbers("start", leg_last(start))
        conditions = conditions or self.conditions
        check_ground(conditions)
        starts = checked_starts(start[np.newaxis], self.stride)
        plan: Any = commanded(self.controller).begin_commanded(starts, self.command.parts[0], self.stride, threads=1)
        settled = settle_plan(plan, conditions, threads=1)
        orders = OrdersFromPlan(settled, plan, MOST_STEPS * self.stride.dt)
        with self._restored_if_it_fails():
            self._plan, self._orders, self._push = plan, orders, Push(np.zeros(1), np.zeros(1))
            self._rollout = Rollout(settled, [self._push], threads=1)
            self._push_steps = steps_in_chunk(settled.substeps)
            self.start, self.conditions, self.settled = start, conditions, settled
            self.trace, self.lost_at, self.fell_on, self._time_left = [], np.inf, "", 0.0
            self._last_step: PlannedWalk | None = None
            self._walk(2)  # the end of a step is known when the next begins

    def steer(self, command: Command | float | None = None, controller: Controller | None = None) -> bool:
        """Change the command, the controller, or both, from the next step on.

        If the controller cannot continue from the current tips and stance, the walk restarts at its start.

        Returns:
            True if the walk continues, False if it restarts.

        Raises:
            InputError: a bad command or controller; the walk before the call continues.
        """
        with self._restored_if_it_fails():
            before = self.controller
            self.command = self.command if command is None else _command(command)
            self.controller = controller or before
            same = self.controller is before
            if self._plan.steers and (same or self._plan.hand_over(self.controller)):
                self._plan.follow(self.command.parts[0])
                return True
            self.begin()
        return False

    @property
    def loss_in_words(self) -> str:
        """Text of the first loss of stability and the fall, such as 'stability lost at 0.35 s, fell on thorax'."""
        lost = f"stability lost at {self.lost_at:.2f} s" if np.isfinite(self.lost_at) else ""
        return ", ".join(filter(None, (lost, f"fell on {self.fell_on}" if self.fell_on else "")))

    @contextmanager
    def _restored_if_it_fails(self) -> Iterator[None]:
        """Restore the attributes of this walk if the block raises an error."""
        before = vars(self).copy()
        try:
            yield
        except Exception:
            vars(self).update(before)
            raise

    def push(self, impulse: float) -> None:
        """Push the root from the side. The push starts within two push durations and replaces an earlier push.

        Args:
            impulse: impulse to the left; negative to the right [body mass times V_p].

        Raises:
            InputError: the impulse is out of range, or the steps of the plan cannot hold a push.
        """
        impulse = number("impulse", impulse, -STRONGEST_PUSH, STRONGEST_PUSH)
        self._push_steps = steps_pushed(self.conditions, self.stride)
        self._push.impulse[:] = impulse * self.conditions.body.mass * self.conditions.vp
        self._push.time[:] = (self._plan.done // self._push_steps + 1) * self._push_steps * self.stride.dt

    def advance(self, seconds: float) -> Moment:
        """Walk for `seconds`, in whole steps of the plan; the next call adds the remaining time.

        Returns:
            The current state; after a fall, the last state before it.

        Raises:
            InputError: a bad time, more than `MOST_STEPS` steps in all, the end of the ground, a failing controller.
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
                raise InputError(f"the walk has reached its maximum of {MOST_STEPS:g} steps; restart it")
            self._walk(now)
            steps -= now
        return self.moment

    def _walk(self, steps: int) -> None:
        chunk = self._rollout.carry_out(next_orders(self._rollout, self._plan, self._orders, ONLY, steps))
        if chunk.fell.any():
            trunk = chunk.sensors[0, chunk.valid[0] - 1, self.settled.compiled.columns.trunk]
            self.fell_on = self.conditions.body.trunk[int(np.argmax(trunk > 0))]
        new = [*self._moments(chunk)]
        self.trace += new
        self.lost_at = min([self.lost_at, *(moment.seconds for moment in new if not moment.margin > 0)])
        if self.trace:
            self.moment = self.trace[-1]

    def _moments(self, chunk: Chunk) -> Iterator[Moment]:
        """Yield the states of insect and plan at the ends of steps, until a fall; a chunk shows the end of the step
        before it, and not the end of its own last step."""
        columns, measured, centre, height = measured_walk(chunk, self.settled)
        walk = grounded(measured, height, self.conditions)
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


def _command(command: Command | float) -> Command:
    """Return a command, or the command straight ahead at V_r."""
    return command if isinstance(command, Command) else Command(number("velocity", command))
