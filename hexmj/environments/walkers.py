"""Insects that take actions, each in an episode of its own; the faces of this package only name what happens here.

Insects that begin together are one plan's starts.  A plan that reads nothing goes on by itself, so it is asked for many
steps ahead; one that reads the legs is told of them before each step.  No insect knows of another, so what it does
depends neither on how many there are nor on who began with it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import WITH_ENDS, beyond_the_ground
from hexmj.controllers.checked_plans import advanced, begin, tell
from hexmj.controllers.protocol import FeedbackPlan, Plan
from hexmj.environments.compiled_passes import ROUNDING, judge, keep, order, scaled
from hexmj.environments.observing import Observer, Places, Planned
from hexmj.environments.single_body import Alone
from hexmj.environments.task import Task, action_bounds, action_names
from hexmj.errors import InputError
from hexmj.physics.backend import Diverged, MujocoBatch
from hexmj.physics.divergence import walk_error
from hexmj.physics.fine_steps import Shown
from hexmj.physics.foot_path import TipTargets, standing_tips
from hexmj.physics.orders import check_made_for
from hexmj.physics.sensing import Senses
from hexmj.physics.settling import Settling

AHEAD = 128
"""Steps for which a plan that reads nothing is asked at once."""

Take = Callable[[np.ndarray, np.ndarray], Shown]
"""One step of some bodies, (n,), with these controls, (n, substep, actuator); see `fine_steps.FineSteps.take`."""

Bodies = Alone | MujocoBatch
"""What insects are made of: they can be looked at, and put where they stand."""


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
    model_variant: FeedbackPlan | None
    """The same plan if it reads the legs."""
    ahead: int = 0
    """Steps that are planned and not yet walked."""


class Walkers:
    """Some insects, each in an episode of its own."""

    def __init__(
        self, task: Task, compiled: CompiledBody, bodies: Bodies, take: Take, count: int, threads: int | None
    ) -> None:
        """As many insects as `count`, none of which has begun; `threads` settle them, one per core unless given."""
        self._task, self._compiled, self._threads = task, compiled, threads
        self._take, self._settling = take, Settling(task.conditions, task.stride, threads)
        self._steps, self._substeps = task.steps, task.substeps
        self._grasps = task.conditions.grasp > 0
        self._ends = task.conditions.ground in WITH_ENDS
        self._count, self._ids = count, np.arange(0)
        self._walking, self._done = np.zeros(count, dtype=bool), np.zeros(count, dtype=int)
        self.begun = False
        """Whether steps may follow: all have begun, and no step or beginning has failed since."""
        self._of: dict[int, Together] = {}
        self._together: list[Together] = []
        tips, stance = np.empty((count, AHEAD, task.substeps, 6, 3)), np.empty((count, AHEAD, 6), bool)
        self._ahead = tips, stance, np.zeros(count, dtype=int)  # as planned, and the step of these that comes next
        self._joints = np.empty((count, 6, compiled.joints // 6))
        self._planned = Planned(np.ones((count, 6)), np.empty((count, 6, 3)), np.zeros((count, 6)))
        low, self._usual, high = action_bounds(compiled, task)
        self._span = np.array([self._usual - low, high - self._usual])
        self.observer = Observer(compiled, task)
        self._trunk = compiled.columns.trunk.start, compiled.columns.trunk.stop
        self.look(bodies)

    def look(self, bodies: Bodies) -> None:
        """See where the bodies are, in arrays that go on."""
        self.bodies, self.places = bodies, Places(bodies.qpos, bodies.qvel, bodies.rotation, bodies.sensors)
        self._passed = tuple(self.places), tuple(self._planned)  # to compiled code, which takes these over faster

    def begin(self, ids: np.ndarray, starts: np.ndarray) -> None:
        """Begin episodes of some insects, (n,), at starts, (n, leg) [mm]; the first time of all of them.

        Raises:
            SimulationError: a start that does not settle.
        """
        task, self.begun = self._task, False  # until all is done
        settled = self._settling.at(starts, ids)
        plan = begin(task.controller, starts, task.velocity, task.stride, threads=self._threads)
        check_made_for(plan, task.conditions)
        targets = TipTargets(settled.starts, task.conditions, task.stride)
        self._leave(ids)
        group = Together(ids, np.arange(len(ids)), plan, targets, plan if isinstance(plan, FeedbackPlan) else None)
        self._together.append(group)
        self._of |= dict.fromkeys(ids.tolist(), group)
        self.bodies.stand(ids, settled.state, settled.ctrl)
        if len(ids) == self._count:
            self._senses = Senses(settled)
        else:
            self._senses.restart(ids, settled)
        self._joints[ids] = settled.ctrl[:, self._compiled.columns.ctrl].reshape(len(ids), 6, -1)
        standing = standing_tips(settled.starts, task.conditions.standing_height, task.stride)
        for shown, now in zip(self._planned, (1.0, standing, 0.0), strict=True):
            shown[ids] = now
        self._done[ids], self._walking[ids] = 0, True
        self._ids, self.begun = np.flatnonzero(self._walking), True

    def act(self, actions: np.ndarray) -> Acted:
        """One step of all insects that walk, with an action of every insect, (insect, number): 0 is the usual action,
        -1 the least and 1 the greatest.

        Raises:
            InputError: actions out of bounds, no episode has begun, or a plan that makes no sense.
            SimulationError: an insect that diverged.
        """
        self.check_begun()
        ids = self._ids
        if len(ids) == 0:
            return self._nothing()
        wanted, within = scaled(actions, ids, self._usual, self._span)
        if not within:
            raise self._beyond(actions, ids)
        try:
            return self.judge(self._carry_out(ids, self.control(wanted)))
        except BaseException:  # how much of the step the others have done is not known
            self._leave(ids)
            self.begun = False
            raise

    def check_begun(self) -> None:
        """Refuse a step that nothing goes before.

        Raises:
            InputError: not all have begun, or the last step or beginning failed.
        """
        if not self.begun:
            raise InputError(
                "a step before the first reset, or after a step or a reset that failed; expected a reset of all"
            )

    @property
    def over(self) -> bool:
        """Whether all episodes that have begun are over."""
        return self.begun and len(self._ids) == 0

    def control(self, wanted: np.ndarray) -> np.ndarray:
        """What those that walk, (n,), are told for a step, (n, substep, actuator), if their actions ask for this,
        (n, number) [rad] or [mm]; a leg that cannot reach its tip keeps its angles."""
        self._plan_ahead()
        ids, offset, substeps = self._ids, self._task.actions == "tips", self._substeps
        tips = order(wanted, ids, self._ahead, self._passed[1], offset)
        if offset:
            joints, reachable = self._compiled.inverse(tips)
            keep(joints, reachable, ids, self._joints, self._planned.missed)
            control = joints.reshape(len(ids), substeps, -1)
        else:
            control = wanted[:, np.newaxis].repeat(substeps, axis=1)
        if self._grasps:
            stance = self._planned.stance[ids, np.newaxis]
            control = np.concatenate([control, stance.repeat(substeps, axis=1)], axis=2)
        return control

    def judge(self, shown: Shown) -> Acted:
        """What a step has brought about that those that walk have shown, (n, substep, ...)."""
        ids, acted, sensors = self._ids, self._nothing(), shown["sensors"]
        self._senses.feel(ids, sensors, shown["force"])
        time, said = (self._done, self._steps), tuple(acted)
        any_over = judge(self._passed[0], ids, sensors, self._trunk, self._task.command, time, said)
        if self._ends:
            feet, conditions = self.places.sensors[ids, self._compiled.columns.foot], self._task.conditions
            beyond = beyond_the_ground(conditions, feet.reshape(-1, 6, 3)).any(axis=1)
            acted.truncated[ids] |= beyond & ~acted.terminated[ids]
            any_over |= bool(acted.truncated.any())
        if any_over:
            self._leave(np.flatnonzero(acted.terminated | acted.truncated))
        return acted

    def observations(self) -> np.ndarray:
        """Everything observed of all insects, (insect, number); `observer.named` says what it is."""
        places, planned = self._passed
        return self.observer.observe(places, self._senses.standing(), planned)

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
        if group.model_variant:
            here = self.places.qpos[ids], self.places.qvel[ids]
            tell(group.model_variant, replace(self._senses.sensed(ids, *here), ids=rows.copy()))
            steps = 1
        walk = advanced(group.plan, steps)
        tips = group.targets.follow(walk, rows)
        tips_ahead, stance_ahead, at = self._ahead
        tips_ahead[ids, :steps] = tips.reshape(len(ids), steps, -1, 6, 3)
        stance_ahead[ids, :steps] = walk.stance[:, rows].swapaxes(0, 1)
        at[ids], group.ahead = 0, steps

    def _nothing(self) -> Acted:
        """What a step has brought about before anybody is judged."""
        return Acted(np.zeros(self._count), *np.zeros((2, self._count), dtype=bool))

    def _carry_out(self, ids: np.ndarray, control: np.ndarray) -> Shown:
        """One step of some insects."""
        try:
            return self._take(ids, control)
        except Diverged as error:
            time, conditions = float(self._done[error.start] * self._task.stride.dt), self._task.conditions
            raise walk_error(error, "acting", time, conditions) from None

    def _beyond(self, actions: np.ndarray, ids: np.ndarray) -> InputError:
        """What is wrong with some insects' actions."""
        row, i = np.argwhere(~(np.abs(actions[ids]) <= 1.0 + ROUNDING))[0]
        name = action_names(self._compiled, self._task)[i]
        return InputError(f"the action's {name} = {actions[ids[row], i]}; expected -1 to 1")
