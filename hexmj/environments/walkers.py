"""Insects that take actions, each in an episode of its own; the faces of this package only name what happens here.

Insects that begin together are one plan's starts.  A plan that reads nothing goes on by itself, so it is asked for many
steps ahead; one that reads the legs is told of them before each step.  No insect knows of another, so what it does
depends neither on how many there are nor on who began with it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.controllers.asking import advanced, begin, tell
from hexmj.controllers.protocol import Plan, ReadingPlan
from hexmj.environments.passes import judge, keep, observe, order, within
from hexmj.environments.task import (
    Seen,
    Task,
    action_bounds,
    action_names,
    at_the_end,
    observation_bounds,
)
from hexmj.errors import InputError
from hexmj.physics.backend import Diverged
from hexmj.physics.divergence import walk_error
from hexmj.physics.fine_steps import Shown
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import settle

AHEAD = 128
"""Steps for which a plan that reads nothing is asked at once."""

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""


Take = Callable[[np.ndarray, np.ndarray], Shown]
"""One step of some bodies, (n,), with these controls, (n, substep, actuator); see `fine_steps.FineSteps.take`."""


class Bodies(Protocol):
    """What insects are made of: they can be looked at, and put where they stand."""

    @property
    def qpos(self) -> np.ndarray:
        """(n, position)."""
        ...

    @property
    def qvel(self) -> np.ndarray:
        """(n, velocity)."""
        ...

    @property
    def rotation(self) -> np.ndarray:
        """From the root frames to the world, (n, axis, axis)."""
        ...

    @property
    def sensors(self) -> np.ndarray:
        """(n, column), of which those that measure places are current."""
        ...

    def stand(self, ids: np.ndarray, states: np.ndarray, control: np.ndarray) -> None:
        """Put some bodies where they stand at rest, (n, state), by controls, (n, actuator)."""
        ...


class Acted(NamedTuple):
    """What a step has brought about, each (n,)."""

    reward: np.ndarray
    """0 for those that did not walk."""
    terminated: np.ndarray
    """Whether it fell."""
    truncated: np.ndarray
    """Whether its time or the ground is over."""


@dataclass(eq=False)
class Together:
    """Insects that began together, and their plan."""

    ids: np.ndarray
    """(n,) those that still walk."""
    rows: np.ndarray
    """(n,) which of the plan's starts they are."""
    plan: Plan
    """Of all that began."""
    targets: TipTargets
    """Of all that began."""
    reading: ReadingPlan | None
    """The same plan if it reads the legs."""
    ahead: int = 0
    """Steps that are planned and not yet walked."""


class Walkers:
    """Some insects, each in an episode of its own."""

    def __init__(
        self, task: Task, compiled: CompiledBody, bodies: Bodies, take: Take, count: int, threads: int | None
    ) -> None:
        """As many insects, none of which has begun.

        Args:
            task: what an episode is.
            compiled: the body.
            bodies: as many of it.
            take: one step of some of them.
            count: how many.
            threads: settle them, one per core unless given.
        """
        self._task, self._compiled, self._bodies, self._threads = task, compiled, bodies, threads
        self._take = take
        self._steps, self._substeps = task.steps, task.substeps
        self._ends = task.conditions.ground.ground != "flat"  # where ground is laid it ends somewhere
        self._everyone, self._ids = np.arange(count), np.arange(0)
        self._walking, self._done = np.zeros(count, dtype=bool), np.zeros(count, dtype=int)
        self._begun = False
        self._of: dict[int, Together] = {}
        self._together: list[Together] = []
        tips, stance = np.empty((count, AHEAD, task.substeps, 6, 3)), np.empty((count, AHEAD, 6), bool)
        self._ahead = tips, stance, np.zeros(count, dtype=int)  # as planned, and the step of these that comes next
        self._joints = np.empty((count, 6, compiled.joints // 6))
        self._planned = np.ones((count, 6)), np.empty((count, 6, 3)), np.zeros((count, 6))  # stance, tips, out of reach
        low, self._usual, high = action_bounds(compiled, task)
        self._span = self._usual - low, high - self._usual
        bounds = observation_bounds(compiled, task)
        least, most = (np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1))
        self._bounds = least, most, compiled.body.lengths.no_foot_margin
        self._body = bodies.qpos, bodies.qvel, bodies.rotation, bodies.sensors
        columns = compiled.columns
        self._layout = compiled.joints, columns.foot.start, columns.centre_of_mass.start, task.command
        self._trunk = columns.trunk.start, columns.trunk.stop
        ends = np.cumsum([least.size for least, _ in bounds.values()]).tolist()
        self._fields = [
            (name, slice(end - least.size, end), least.shape if least.ndim > 1 else ())
            for (name, (least, _)), end in zip(bounds.items(), ends, strict=True)
        ]

    def begin(self, ids: np.ndarray, starts: np.ndarray) -> None:
        """Begin episodes of some insects, (n,), at starts, (n, leg) [mm]; the first time of all of them.

        Raises:
            SimulationError: a start that does not settle.
        """
        task = self._task
        settled = settle(starts, task.conditions, task.stride, self._threads)
        plan = begin(task.controller, starts, task.velocity, task.stride, threads=self._threads)
        targets = TipTargets(settled.starts, task.conditions, task.stride)
        self._leave(ids)
        group = Together(ids, np.arange(len(ids)), plan, targets, plan if isinstance(plan, ReadingPlan) else None)
        self._together.append(group)
        self._of |= dict.fromkeys(ids.tolist(), group)
        self._bodies.stand(ids, settled.state, settled.ctrl)
        if len(ids) == len(self._everyone):
            self._senses = Senses(settled)
        else:
            self._senses.restart(ids, settled)
        self._joints[ids] = settled.ctrl[:, self._compiled.columns.ctrl].reshape(len(ids), 6, -1)
        standing = standing_tips(settled.starts, task.conditions.path.standing_height, task.stride)
        for shown, now in zip(self._planned, (1.0, standing, 0.0), strict=True):
            shown[ids] = now
        self._done[ids], self._walking[ids] = 0, True
        self._ids, self._begun = np.flatnonzero(self._walking), True

    def act(self, actions: np.ndarray) -> Acted:
        """One step of all insects that walk, with an action of every insect, (insect, number): 0 is the usual action,
        -1 the least and 1 the greatest.

        Raises:
            InputError: actions out of bounds, no episode has begun, or a plan that makes no sense.
            SimulationError: an insect that diverged.
        """
        if not self._begun:
            raise InputError("a step before the first reset; expected a reset")
        ids, task, count = self._ids, self._task, len(self._everyone)
        reward, fell = np.zeros(count), np.zeros(count, dtype=bool)
        if len(ids) == 0:
            return Acted(reward, fell, fell.copy())
        sensors = self._carry_out(ids, self._control(ids, actions))
        self._done[ids] += 1
        any_fell = judge(*self._body[1:3], ids, sensors, self._trunk, task.command, reward, fell)
        over = (self._done == self._steps) & self._walking
        if self._ends:
            over |= at_the_end(self._seen(), task) & self._walking
        if any_fell or over.any():
            over &= ~fell
            self._leave(np.flatnonzero(fell | over))
        return Acted(reward, fell, over)

    def observations(self) -> np.ndarray:
        """Everything observed of all insects, (insect, number); `named` says what it is."""
        flat, standing = np.empty((len(self._everyone), len(self._bounds[0]))), self._senses.standing(self._everyone)
        observe(self._body, self._compiled.trunk_corners, standing, self._planned, self._bounds, self._layout, flat)
        return flat

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """What was observed, (..., number), by name and in its shape."""
        return {
            name: flat[..., columns].reshape(*flat.shape[:-1], *shape) if shape else flat[..., columns]
            for name, columns, shape in self._fields
        }

    def _leave(self, ids: np.ndarray) -> None:
        """The episodes of some insects are over."""
        if len(ids) == 0:
            return
        self._walking[ids] = False
        self._ids = np.flatnonzero(self._walking)
        for group in {self._of.pop(i) for i in ids.tolist() if i in self._of}:
            still = self._walking[group.ids]
            group.ids, group.rows = group.ids[still], group.rows[still]
            if not still.any():
                self._together.remove(group)

    def _plan_ahead(self) -> None:
        """Plan the next steps of those that have none left."""
        for group in self._together:
            if group.ahead == 0:
                self._plan(group)
            group.ahead -= 1

    def _plan(self, group: Together) -> None:
        ids, rows, steps = group.ids, group.rows, min(AHEAD, self._steps - group.plan.done)
        if group.reading:
            here = self._bodies.qpos[ids], self._bodies.qvel[ids]
            tell(group.reading, replace(self._senses.sensed(ids, *here), ids=rows.copy()))
            steps = 1
        walk = advanced(group.plan, steps)
        tips = group.targets.follow(walk, rows)
        tips_ahead, stance_ahead, at = self._ahead
        tips_ahead[ids, :steps] = tips.reshape(len(ids), steps, -1, 6, 3)
        stance_ahead[ids, :steps] = walk.stance[:, rows].swapaxes(0, 1)
        at[ids], group.ahead = 0, steps

    def _control(self, ids: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Of some insects for one step, (n, substep, actuator); a leg that cannot reach its tip keeps its angles."""
        if not within(actions, ids, 1.0 + ROUNDING):
            row, i = np.argwhere(~(np.abs(actions[ids]) <= 1.0 + ROUNDING))[0]
            name = action_names(self._compiled, self._task)[i]
            raise InputError(f"the action's {name} = {actions[ids[row], i]}; expected -1 to 1")
        self._plan_ahead()
        offset, substeps = self._task.actions == "tips", self._substeps
        wanted, tips = order(actions, ids, self._usual, self._span, self._ahead, self._planned[:2], offset)
        if offset:
            joints, reachable = self._compiled.inverse(tips)
            keep(joints, reachable, ids, self._joints, self._planned[2])
            control = joints.reshape(len(ids), substeps, -1)
        else:
            control = wanted[:, np.newaxis].repeat(substeps, axis=1)
        if self._task.conditions.contact.grasp:
            stance = self._planned[0][ids, np.newaxis]
            control = np.concatenate([control, stance.repeat(substeps, axis=1)], axis=2)
        return control

    def _carry_out(self, ids: np.ndarray, control: np.ndarray) -> np.ndarray:
        """One step of some insects; what their sensors have shown, (n, substep, column)."""
        try:
            shown = self._take(ids, control)
        except Diverged as error:
            time, conditions = float(self._done[error.start] * self._task.stride.dt), self._task.conditions
            raise walk_error(error, "acting", time, conditions) from None
        self._senses.feel(ids, shown["sensors"], shown["force"][:, :, self._compiled.columns.ctrl])
        return shown["sensors"]

    def _seen(self) -> Seen:
        """All insects as they are now."""
        columns, sensors = self._compiled.columns, self._bodies.sensors
        feet, centre = sensors[:, columns.foot].reshape(-1, 6, 3), sensors[:, columns.centre_of_mass]
        return Seen(self._bodies.qpos, self._bodies.qvel, self._bodies.rotation, feet, centre)
