"""Steering: any controller that walks straight ahead follows a command.

The wrapped controller plans as if it walked straight ahead, at V_r = the speed of the fastest leg over the ground. Each
leg steps along its own line, which runs through its neutral tip in the direction of v + w x r, the velocity of the body
at this tip. The line's length, as a fraction of the step range, is the leg's speed over V_r: inner legs take shorter
steps in the same period, as those of stick insects do (Dürr and Ebeling 2005, J. exp. Biol. 208, 2237).

- **Stance**: the body moves over the standing tips, which stay where they are on the ground.
- **Swing**: the tip moves from where it was lifted to the AEP on its present line.
- **Neutral tip**: the middle of the step range straight ahead, the middle of the leg's box (`legs.Workspace`) sideways.
- **Workspace**: lines are not longer than the boxes allow. Shorter steps need a higher V_r, up to `FASTEST`; beyond it
  the body moves more slowly than commanded.
- **Halt**: a command of zero stops the wrapped plan. Swings in progress end at the neutral tips; the plan then waits.

Commands that are straight ahead leave the plan as it is, to the last bit, until the first other command.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hexmj.command import Command
from hexmj.controllers import planning
from hexmj.controllers.protocol import (
    CommandedController,
    Controller,
    FeedbackPlan,
    Plan,
    Sensed,
    SteerableController,
    SteerablePlan,
)
from hexmj.controllers.wrappers import Wrapper
from hexmj.errors import InputError
from hexmj.jitted import jitted
from hexmj.legs import SIDE, WORKSPACE
from hexmj.starts import checked_starts
from hexmj.timing import Acceleration, Stride
from hexmj.walks import PLANNED, PlannedWalk, joined

FASTEST = 0.6
"""Maximum V_r of the wrapped controller when its steps are shorter than the step range; with full steps, V_r is as
commanded."""

PROVISIONAL = 0.3
"""V_r of a plan that waits for its first command that is not zero."""


class Lines(NamedTuple):
    """The lines on which the legs step under a command."""

    twist: np.ndarray
    """(3,) velocity of the body: forward, left [mm / time unit], turn [rad / time unit]."""
    velocity: float
    """V_r of the wrapped controller; 0 at a halt."""
    neutral: np.ndarray
    """(leg, 2) neutral tips, ahead of and left of O [mm]."""
    along: np.ndarray
    """(leg, 2) directions of the lines, toward the AEP, times their lengths over the step range."""
    direction: np.ndarray
    """(leg, 2) directions of the lines, unit vectors toward the AEP; 0 at a halt."""
    longest: np.ndarray
    """(leg,) greatest length of the lines in the workspace over the step range."""

    @classmethod
    def of(cls, command: np.ndarray, stride: Stride) -> "Lines":
        """Return the lines of a command: forward, left, turn, (3,)."""
        forward, sideward, turn = command
        geometry, box = stride.geometry, WORKSPACE
        middle, half = (stride.aep0 + stride.pep0) / 2, (stride.aep0 - stride.pep0) / 2
        outward, width = (np.tile(np.add(box.outer, ends), 2) / 2 for ends in (box.inner, np.negative(box.inner)))
        neutral = np.stack([np.array(geometry.origin) + middle, geometry.y], axis=1)
        velocity = np.stack([forward - turn * neutral[:, 1], sideward + turn * neutral[:, 0]], axis=1)
        speed = np.hypot(*velocity.T)
        direction = np.divide(velocity, speed[:, None], out=np.zeros_like(velocity), where=speed[:, None] > 0)
        aside = np.abs(direction[:, 1]) / width  # lateral part of a full line over the width of the box
        neutral[:, 1] += half * np.array(SIDE) * outward * np.minimum(aside, 1.0)
        longest = 1.0 / np.maximum(aside, 1.0)
        needed = float((speed / longest).max())
        if not needed:
            return cls(np.zeros(3), 0.0, neutral, np.zeros((6, 2)), direction, longest)
        v = min(needed, max(FASTEST, float(speed.max())), 1.0 - 1e-9)
        slower = v / needed
        along = direction * (slower * speed / v)[:, None]
        return cls(slower * np.asarray(command), v, neutral, along, direction, longest)

    @property
    def straight(self) -> bool:
        """Whether the body moves straight ahead or not at all."""
        forward, left, turn = self.twist
        return bool(left == turn == 0.0 <= forward)


def feet_on(lines: Lines, starts: np.ndarray, stride: Stride) -> np.ndarray:
    """Return feet, (start, leg, 2), that stand on their lines as `starts`, (start, leg), stand on the step range [mm].

    If the body moves straight ahead or not at all, the lines are those of the stride.
    """
    if lines.straight:
        x = starts + np.array(stride.geometry.origin)
        return np.stack(np.broadcast_arrays(x, stride.geometry.y), axis=-1)
    return lines.neutral + (starts - (stride.aep0 + stride.pep0) / 2)[..., None] * lines.along


def pace(command: Command, stride: Stride) -> float:
    """Return V_r at which a controller walks by the first part of a command that is not zero; 0 without one."""
    return next((v for part in command.parts if (v := Lines.of(part, stride).velocity)), 0.0)


@dataclass(frozen=True)
class Steered(Wrapper):
    """A controller that follows commands, around a controller that walks straight ahead."""

    @property
    def name(self) -> str:
        """Name of the wrapped controller."""
        return self.controller.name

    @property
    def mirrored(self) -> bool:
        """Whether the wrapped controller is mirrored, see `protocol.Controller`."""
        return getattr(self.controller, "mirrored", False)

    def begin(self, starts, velocity, stride, acceleration=None, threads=None) -> Plan:
        """Return the plan of the wrapped controller: without a command, it walks straight ahead."""
        return planning.begin(self.controller, starts, velocity, stride, acceleration, threads)

    def begin_commanded(self, starts, command, stride, threads=None) -> "SteeredPlan":
        """See `protocol.CommandedController.begin_commanded`."""
        return SteeredPlan(self.controller, starts, Lines.of(command, stride), stride, threads)


class SteeredPlan:
    """A `protocol.CommandedPlan`, and a `protocol.FeedbackPlan` if the wrapped plan is one."""

    def __init__(
        self, controller: Controller, starts: np.ndarray, lines: Lines, stride: Stride, threads: int | None
    ) -> None:
        """Begin with feet that stand on the lines as `starts`, (start, leg) [mm], stand on the step range."""
        self._controller, self._inner_starts, self._threads = controller, starts, threads
        self._lines, self.stride, self.done = lines, stride, 0
        self._origin, self._y = np.array(stride.geometry.origin), np.array(stride.geometry.y)
        self._middle, self._straight, self._waits = (stride.aep0 + stride.pep0) / 2, lines.straight, not lines.velocity
        self._stance = np.ones(starts.shape, dtype=bool)  # (start, leg) legs that stand now
        self._level = np.zeros(starts.shape)
        self._feet = feet_on(lines, starts, stride)
        self.starts = starts if self._straight else self._feet[..., 0] - self._origin
        self.y = self._feet[..., 1].copy()
        self._set_plan(self._begun(), starts)
        self.made_for = getattr(self._plan, "made_for", None)

    def follow(self, command: np.ndarray) -> None:
        """See `protocol.CommandedPlan.follow`."""
        before, self._lines = self._lines, Lines.of(command, self.stride)
        self._straight = self._straight and self._lines.straight
        if not self._lines.velocity:
            return
        if self._waits:
            self._set_plan(self._begun(), self._x)
        elif self.steers:
            self._plan.set_velocity(np.full(len(self.starts), self._lines.velocity))
        else:
            raise InputError(f"{self._controller.name} cannot change its velocity; expected a plan with set_velocity")
        self._waits = False
        if not self._straight and (self._lines.along != before.along).any():
            self._shorten_stances()

    @property
    def steers(self) -> bool:
        """Whether the wrapped plan can change its velocity, so that commands can change."""
        return hasattr(self._plan, "set_velocity")

    def hand_over(self, controller: Controller) -> bool:
        """Let another controller continue from the current tips and stance; return False if one of the two cannot."""
        if not (isinstance(controller, SteerableController) and isinstance(self._plan, SteerablePlan)):
            return False
        tips, standing, self._controller = self._plan.tips.copy(), self._plan.standing.copy(), controller
        plan: Any = self._begun(at_speed=True)
        plan.see(tips, standing)
        self._set_plan(plan, tips)
        return True

    def advance(self, steps: int) -> PlannedWalk:
        """Return the next steps; velocity, left and turn of the walk are those at which the body moves as planned."""
        self.done += steps
        time = np.arange(self.done - steps + 1, self.done + 1) * self.stride.dt
        if not self._lines.velocity:
            return self._halted(time)
        walk = replace(self._plan.advance(steps), time=time)
        self._level = walk.level[-1]
        if not self._straight:
            walk = self._steered(walk)
        else:
            self._feet[..., 0] = walk.x[-1] + self._origin
            self._x, self._stance = walk.x[-1].copy(), walk.stance[-1].copy()
            self._planned_stance = self._stance
        return walk

    def _steered(self, walk: PlannedWalk) -> PlannedWalk:
        """Return steps of the wrapped plan with the tips on the legs' own lines."""
        feet, goals = np.empty((2, *walk.x.shape, 2))
        lines = self._lines
        twists = walk.velocity[..., None] / lines.velocity * lines.twist
        planned = tuple(map(np.ascontiguousarray, (walk.x, walk.stance, walk.aep)))
        last, own = (self._x, self._planned_stance, self._feet), (lines.neutral, lines.along, *_box(self.stride))
        _steer(planned, last, twists, self.stride.dt, self._middle, own, feet, goals)
        self._x, self._stance = walk.x[-1].copy(), walk.stance[-1].copy()
        self._planned_stance = self._stance
        motion = dict(zip(("velocity", "left", "turn"), np.moveaxis(twists, 2, 0), strict=True))
        return replace(walk, **motion, **self._on_axes(feet, goals))

    def _halted(self, time: np.ndarray) -> PlannedWalk:
        """Return steps of a body at rest: swings end at the neutral tips."""
        shape, goal, dt = (len(time), *self._stance.shape), self._lines.neutral, self.stride.dt
        feet, stance = np.empty((*shape, 2)), np.empty(shape, dtype=bool)
        self._straight = self._straight and bool(self._stance.all())
        for n in range(len(time)):
            way = np.hypot(*np.moveaxis(goal - self._feet, 2, 0)) * ~self._stance
            part = np.divide(dt, way, out=np.ones_like(way), where=way > dt) * ~self._stance
            self._feet, self._stance = self._feet + part[..., None] * (goal - self._feet), self._stance | (way <= dt)
            feet[n], stance[n] = self._feet, self._stance
        tips: dict[str, Any] = self._on_axes(feet, np.broadcast_to(goal, feet.shape))
        tips |= {"stance": stance, "height": np.broadcast_to(np.nan, shape)}
        tips["level"] = np.broadcast_to(self._level, shape)
        return PlannedWalk(time, np.zeros(shape[:2]), **tips, geometry=self.stride.geometry)

    def _on_axes(self, feet: np.ndarray, goals: np.ndarray) -> dict[str, np.ndarray]:
        """Return tips and ends of swings relative to O, (step, start, leg, 2), as arrays of a `PlannedWalk`."""
        tips = {"x": feet[..., 0] - self._origin, "y": feet[..., 1]}
        return tips | {"aep": goals[..., 0] - self._origin, "aep_y": goals[..., 1]}

    def _sense(self, sensed: Sensed) -> None:
        """Pass the senses to the wrapped plan, with the tips where they would be if the body walked straight ahead."""
        ids, lines = sensed.ids, self._lines
        if lines.velocity and not self._straight:
            landed = sensed.gained & ~self._planned_stance[ids]
            self._feet[ids] = np.where(landed[..., None], sensed.tips[..., :2], self._feet[ids])
            tips, length = sensed.tips.copy(), np.maximum((lines.along**2).sum(axis=1), 1e-6)
            off = ((sensed.tips[..., :2] - lines.neutral) * lines.along).sum(axis=2) / length
            tips[..., 0], tips[..., 1] = self._origin + self._middle + off, self._y
            sensed = replace(sensed, tips=tips)
        if lines.velocity:
            self._plan.sense(sensed)

    def _begun(self, at_speed: bool = False) -> Any:
        """Return a new plan of the wrapped controller, at time 0."""
        v = self._lines.velocity or PROVISIONAL
        return planning.begin(self._controller, self._inner_starts, v, self.stride, None, self._threads, at_speed)

    def _set_plan(self, plan: Any, x: np.ndarray) -> None:
        """Begin to steer a plan at time 0 whose tips are at x, (start, leg) [mm]."""
        self._plan, self._x = plan, x.copy()
        self._planned_stance = np.array(plan.standing) if isinstance(plan, SteerablePlan) else self._stance.copy()
        vars(self).pop("sense", None)
        if isinstance(plan, FeedbackPlan):
            self.sense = self._sense

    def _shorten_stances(self) -> None:
        """Let standing legs lift off before their tips leave the boxes, if the wrapped plan is steerable."""
        if not isinstance(self._plan, SteerablePlan):
            return
        low, high = _box(self.stride)
        back = np.abs(self._lines.along)
        room = np.where(self._lines.along > 0, self._feet - low, high - self._feet)
        room = np.divide(room, back, out=np.full_like(room, np.inf), where=back > 0).min(axis=2)
        x, stands = np.array(self._plan.tips), np.array(self._plan.standing)
        self._x = np.where(stands, np.minimum(x, self.stride.pep0 + np.maximum(room, 0.0)), x)
        self._plan.see(self._x.copy(), stands)


class TablePlan:
    """A plan that follows a `Command` which changes over time."""

    def __init__(self, plan: Any, command: Command) -> None:
        """Wrap a `protocol.CommandedPlan` at time 0 that follows the first part of the command."""
        self._plan, self._changes = plan, command.changes(plan.stride)
        self.starts, self.y, self.stride, self.done, self.made_for = plan.starts, plan.y, plan.stride, 0, plan.made_for
        if isinstance(plan, FeedbackPlan):
            self.sense = plan.sense

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        end, parts = self.done + steps, []
        while self.done < end:
            if self.done and self.done in self._changes:
                self._plan.follow(self._changes[self.done])
            until = min([end, *(step for step in self._changes if step > self.done)])
            parts.append(self._plan.advance(until - self.done))
            self.done = until
        return joined(parts)


class JoinedPlan:
    """A plan of starts with different commands, made from a plan for each command."""

    def __init__(self, plans: Sequence[Any], ids: Sequence[np.ndarray]) -> None:
        """Join plans at time 0; `ids` are the indices of their starts, increasing in each plan."""
        self._plans, self._ids, self._order = plans, ids, np.argsort(np.concatenate(ids))
        self.stride, self.done, self.made_for = plans[0].stride, 0, plans[0].made_for
        self.starts, self.y = (self._whole([getattr(plan, name) for plan in plans]) for name in ("starts", "y"))
        if isinstance(plans[0], FeedbackPlan):
            self.sense = self._sense

    def advance(self, steps: int) -> PlannedWalk:
        """See `protocol.Plan`."""
        self.done += steps
        walks, names = [plan.advance(steps) for plan in self._plans], ("velocity", "left", "turn", *PLANNED)
        return replace(walks[0], **{name: self._whole([getattr(walk, name) for walk in walks], 1) for name in names})

    def _whole(self, parts: Sequence[np.ndarray], axis: int = 0) -> np.ndarray:
        return np.concatenate(parts, axis=axis).take(self._order, axis=axis)

    def _sense(self, sensed: Sensed) -> None:
        for plan, ids in zip(self._plans, self._ids, strict=True):
            if (own := np.isin(sensed.ids, ids)).any():
                felt = {name: values[own] for name, values in vars(sensed).items()}
                plan.sense(Sensed(**felt | {"ids": np.searchsorted(ids, felt["ids"])}))


def commanded(controller: Any) -> CommandedController:
    """Return the controller itself if it plans by commands, else the controller `Steered`."""
    return controller if isinstance(controller, CommandedController) else Steered(controller)


def begin(
    controller: Controller,
    starts: ArrayLike,
    velocity: ArrayLike | Command | Sequence[Command],
    stride: Stride,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
) -> Plan:
    """Return a controller's plan for starts, (start, leg) [mm], which follows V_r or a command, one or one per start.

    A `protocol.CommandedController` plans by the command itself; all others are `Steered`.

    Raises:
        InputError: see `planning.begin`; or the number of commands is wrong, or an acceleration is given with them.
    """
    each: Any = velocity
    if isinstance(each, Command):
        each = [each]
    if not (isinstance(each, Sequence) and isinstance(each[0], Command)):
        return planning.begin(controller, starts, each, stride, acceleration, threads)
    if acceleration:
        raise InputError("acceleration: a command has none; give it several parts instead")
    x, planner, plans, ids = checked_starts(starts, stride), commanded(controller), [], []
    if len(each) not in (1, len(x)):
        raise InputError(f"command: {len(each)} commands; expected one, or one for each of {len(x)} starts")
    for command in dict.fromkeys(each):
        ids.append(np.array([n for n in range(len(x)) if each[n % len(each)] == command]))
        v = command.velocity
        if v is not None and len(each) == 1 and planner is not controller:
            return planning.begin(controller, x, v, stride, threads=threads)
        plan = planner.begin_commanded(x[ids[-1]], command.parts[0], stride, threads)
        plans.append(plan if len(command.times) == 1 else TablePlan(plan, command))
    return plans[0] if len(plans) == 1 else JoinedPlan(plans, ids)


def _box(stride: Stride) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the legs' boxes with the least and with the greatest x and y, (leg, 2) each [mm]."""
    geometry, box, half = stride.geometry, WORKSPACE, (stride.aep0 - stride.pep0) / 2
    inner, outer = (geometry.y + half * np.array(SIDE) * np.tile(end, 2) for end in (box.inner, box.outer))
    behind, ahead = (np.array(geometry.origin) + half * np.tile(end, 2) for end in (box.behind, box.ahead))
    return np.stack([behind, np.minimum(inner, outer)], axis=1), np.stack([ahead, np.maximum(inner, outer)], axis=1)


@jitted
def _steer(planned: Any, last: Any, twists: Any, dt: float, middle: float, own: Any, out: Any, goals: Any) -> None:
    """Write the tips of steered legs, (step, start, leg, 2), to `out`, and where their swings end to `goals`.

    Args:
        planned: tips, stance and AEP of the wrapped plan, (step, start, leg).
        last: tips and stance of the wrapped plan before the first step, (start, leg); and the steered tips,
            (start, leg, 2), which become those after the last step.
        twists: forward, left and turn in each step, (step, start, 3).
        dt: duration of a step [time units].
        middle: middle of the step range on a leg's axis [mm].
        own: neutral tips and directions of `Lines`, and the corners of `_box`, (leg, 2) each.
        out: array for the tips.
        goals: array for the ends of the swings.
    """
    x, stance, aep = planned
    last_x, last_stance, feet = last
    neutral, along, low, high = own
    for start in range(x.shape[1]):
        for leg in range(6):
            at_x, at_y = feet[start, leg]
            before, stands = last_x[start, leg], last_stance[start, leg]
            for n in range(x.shape[0]):
                now, end = x[n, start, leg], aep[n, start, leg]
                goal_x = min(max(neutral[leg, 0] + (end - middle) * along[leg, 0], low[leg, 0]), high[leg, 0])
                goal_y = neutral[leg, 1] + (end - middle) * along[leg, 1]
                if stands:
                    forward, left, turn = twists[n, start]
                    cosine, sine = np.cos(turn * dt), np.sin(turn * dt)
                    at_x, at_y = at_x - forward * dt, at_y - left * dt
                    at_x, at_y = cosine * at_x + sine * at_y, cosine * at_y - sine * at_x
                elif end > before:
                    part = min((now - before) / (end - before), 1.0)
                    at_x, at_y = at_x + part * (goal_x - at_x), at_y + part * (goal_y - at_y)
                else:  # no AEP, or the tip is beyond it
                    at_x, at_y = at_x + (now - before) * along[leg, 0], at_y + (now - before) * along[leg, 1]
                before, stands = now, stance[n, start, leg]
                out[n, start, leg, 0], out[n, start, leg, 1] = at_x, at_y
                goals[n, start, leg, 0], goals[n, start, leg, 1] = goal_x, goal_y
            feet[start, leg, 0], feet[start, leg, 1] = at_x, at_y
