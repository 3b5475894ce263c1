"""Insects that take actions, each in an episode of its own; the faces of this package only name what happens here.

Insects that begin together are one plan's starts.  A plan that reads nothing goes on by itself, so it is asked for many
steps ahead; one that reads the legs is told of them before each step.  No insect knows of another, so what it does
depends neither on how many there are nor on who began with it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.controllers.asking import advanced, begin, tell
from hexmj.controllers.protocol import Plan, ReadingPlan
from hexmj.environments.task import (
    Seen,
    Task,
    action_bounds,
    action_names,
    at_the_end,
    fallen,
    observation_bounds,
    own_observations,
    rewards,
)
from hexmj.errors import InputError
from hexmj.physics.backend import Diverged, Engine
from hexmj.physics.divergence import walk_error
from hexmj.physics.fine_steps import FineSteps
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.orders import hold
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import Settled, settle

AHEAD = 64
"""Steps for which a plan that reads nothing is asked at once."""

ROUNDING = 1e-6
"""Excess of an action over its bounds that is let pass: that of a bound rounded to single precision."""


class Bodies(Engine, Protocol):
    """An engine whose bodies can be looked at; `physics.backend.MujocoBatch` is one."""

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

    def __init__(self, task: Task, compiled: CompiledBody, bodies: Bodies, count: int, threads: int | None) -> None:
        """As many insects, none of which has begun; `threads` settle them, one per core unless given."""
        self._task, self._compiled, self._bodies, self._threads = task, compiled, bodies, threads
        self._fine = FineSteps.of(bodies, task.substeps, compiled)
        self._everyone, self._ids = np.arange(count), np.arange(0)
        self._walking, self._done = np.zeros(count, dtype=bool), np.zeros(count, dtype=int)
        self._of: list[Together | None] = count * [None]
        self._together: list[Together] = []
        self._tips, self._stance = np.empty((count, AHEAD, task.substeps, 6, 3)), np.empty((count, AHEAD, 6), bool)
        self._at = np.zeros(count, dtype=int)  # the step of these that comes next
        self._joints = np.empty((count, 6, compiled.joints // 6))
        self._shown = {
            "command": np.full((count, 1), task.command),
            "planned_stance": np.ones((count, 6)),
            "planned_tips": np.empty((count, 6, 3)),
            "out_of_reach": np.zeros((count, 6)),
        }
        low, self._usual, high = action_bounds(compiled, task)
        self._above, self._below = high - self._usual, self._usual - low
        bounds = observation_bounds(compiled, task)
        self._least, self._most = (np.concatenate([pair[k].ravel() for pair in bounds.values()]) for k in (0, 1))
        ends = np.cumsum([least.size for least, _ in bounds.values()]).tolist()
        self._fields = [
            (name, slice(end - least.size, end), least.shape)
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
        for i in ids.tolist():
            self._of[i] = group
        self._bodies.stand(ids, settled.state, settled.ctrl)
        if len(ids) == len(self._everyone):
            self._senses = Senses(settled)
        else:
            self._senses.restart(ids, settled)
        self._joints[ids] = settled.ctrl[:, self._compiled.columns.ctrl].reshape(len(ids), 6, -1)
        standing = standing_tips(settled.starts, task.conditions.path.standing_height, task.stride)
        self._shown["planned_tips"][ids], self._shown["planned_stance"][ids] = standing, 1.0
        self._shown["out_of_reach"][ids], self._done[ids], self._walking[ids] = 0.0, 0, True
        self._ids = np.flatnonzero(self._walking)

    def act(self, actions: np.ndarray) -> Acted:
        """One step of all insects that walk, with an action of every insect, (insect, number): 0 is the usual action,
        -1 the least and 1 the greatest.

        Raises:
            InputError: actions out of bounds, or a plan that makes no sense.
            SimulationError: an insect that diverged.
        """
        ids, fell = self._ids, np.zeros(len(self._everyone), dtype=bool)
        wanted = self._wanted(actions[ids])
        self._plan_ahead()
        sensors = self._carry_out(ids, self._control(ids, wanted))
        self._done[ids] += 1
        seen = self._seen()
        fell[ids] = fallen(sensors, self._compiled)
        reward = rewards(seen, fell, self._task) * self._walking
        over = ((self._done == self._task.steps) | at_the_end(seen, self._task)) & self._walking & ~fell
        self._leave(np.flatnonzero(fell | over))
        return Acted(reward, fell, over)

    def observations(self) -> np.ndarray:
        """Everything observed of all insects, (insect, number); `named` says what it is."""
        count, seen, standing = len(self._everyone), self._seen(), self._senses.standing(self._everyone)
        values = own_observations(seen, standing, self._compiled) | self._shown
        flat = np.empty((count, len(self._least)))
        for name, columns, _ in self._fields:
            flat[:, columns] = values[name].reshape(count, -1)
        np.maximum(flat, self._least, out=flat)
        return np.minimum(flat, self._most, out=flat)

    def named(self, flat: np.ndarray) -> dict[str, np.ndarray]:
        """What was observed, (..., number), by name and in its shape."""
        return {name: flat[..., columns].reshape(*flat.shape[:-1], *shape) for name, columns, shape in self._fields}

    def _leave(self, ids: np.ndarray) -> None:
        """The episodes of some insects are over."""
        if len(ids) == 0:
            return
        self._walking[ids] = False
        self._ids = np.flatnonzero(self._walking)
        for group in {one for one in (self._of[i] for i in ids.tolist()) if one}:
            still = self._walking[group.ids]
            group.ids, group.rows = group.ids[still], group.rows[still]
            if not still.any():
                self._together.remove(group)
        for i in ids.tolist():
            self._of[i] = None

    def _wanted(self, actions: np.ndarray) -> np.ndarray:
        """What actions ask for, (n, number): targets [rad], or offsets [mm]."""
        if not (np.abs(actions) <= 1.0 + ROUNDING).all():
            row, i = np.argwhere(~(np.abs(actions) <= 1.0 + ROUNDING))[0]
            name = action_names(self._compiled, self._task)[i]
            raise InputError(f"the action's {name} = {actions[row, i]}; expected -1 to 1")
        return self._usual + actions * np.where(actions > 0, self._above, self._below)

    def _plan_ahead(self) -> None:
        """Plan the next steps of those that have none left."""
        for group in self._together:
            if group.ahead == 0:
                self._plan(group)
            group.ahead -= 1

    def _plan(self, group: Together) -> None:
        ids, rows, steps = group.ids, group.rows, min(AHEAD, self._task.steps - group.plan.done)
        if group.reading:
            here = self._bodies.qpos[ids], self._bodies.qvel[ids]
            tell(group.reading, replace(self._senses.sensed(ids, *here), ids=rows.copy()))
            steps = 1
        walk = advanced(group.plan, steps)
        tips = group.targets.follow(walk, rows)
        self._tips[ids, :steps] = tips.reshape(len(ids), steps, -1, 6, 3)
        self._stance[ids, :steps] = walk.stance[:, rows].swapaxes(0, 1)
        self._at[ids], group.ahead = 0, steps

    def _control(self, ids: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Of some insects for one step, (n, substep, actuator); a leg whose tip is out of reach keeps its last angles."""
        at, shown, substeps = self._at[ids], self._shown, self._task.substeps
        tips, stance = self._tips[ids, at], self._stance[ids, at]
        self._at[ids] = at + 1
        shown["planned_tips"][ids], shown["planned_stance"][ids] = tips[:, -1], stance
        if self._task.actions == "joints":
            control = wanted[:, np.newaxis].repeat(substeps, axis=1)
        else:
            joints, reachable = self._compiled.inverse(tips + wanted.reshape(-1, 1, 6, 3))
            missed = substeps - reachable.sum(axis=1)
            for i in np.flatnonzero(missed.any(axis=1)):
                hold(joints[i], self._joints[ids[i]])
            self._joints[ids], shown["out_of_reach"][ids] = joints[:, -1], missed
            control = joints.reshape(len(ids), substeps, -1)
        if self._task.conditions.contact.grasp:
            control = np.concatenate([control, stance[:, np.newaxis].repeat(substeps, axis=1)], axis=2)
        return control

    def _carry_out(self, ids: np.ndarray, control: np.ndarray) -> np.ndarray:
        """One step of some insects; what their sensors have shown, (n, substep, column)."""
        try:
            shown = self._fine.take(ids, control)
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
