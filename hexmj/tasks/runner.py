"""The runner: any controller walks any task, from the same random starts.

A start whose walk fails, since it cannot stand, a target is out of reach or the simulation diverges, is reported as
refused; all other starts walk as if it were not there.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from hexmj.conditions import Conditions, unusual
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.planning import advanced, check_velocities, first_dynamic_losses
from hexmj.controllers.protocol import Controller, FeedbackPlan, Plan, check_controller_type, settings_of
from hexmj.controllers.steered import begin, pace
from hexmj.controllers.wrappers import FromSteadyState, PoorSenses
from hexmj.controllers.wrappers import LegLost as WithoutLeg
from hexmj.errors import InputError, OutOfReach, SimulationError, StillThrown
from hexmj.io import attributes
from hexmj.measures.study import UNITS
from hexmj.measures.tables import frequencies, happened, over_start
from hexmj.plain import plain
from hexmj.progress import Progress
from hexmj.starts import check_draw, draw_starts
from hexmj.sweep import Cell, Execution, over_axes, run_study
from hexmj.tasks.disturbed import NEVER, Disturbance, Disturbed, TimedStarts, collect_postures, find_stable_starts
from hexmj.tasks.task import Disturbing, Halt, LegLost, LegStopped, Push, Task, load_task, stops
from hexmj.timing import Acceleration, Stride, observation_duration, steps_within
from hexmj.tipping import Pendulum
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr

GRID = 20
"""Random times of events are multiples of this number of steps: 25 ms at the default V_p, as long as a push."""

HELD = 1.2
"""Height at which a lost leg is held, in multiples of the standing height of the body or of the walk (the higher)."""

MOST_PERIODS = 3
"""Maximum number of periods of a single leg for which a stopped leg waits for its swing."""

EFFORT = {"work": "mm", "torque": "1", "way": "mm"}
"""Work of the joints over the insect's weight, greatest torque over its limit, and distance along the path -> unit."""

PATH = {"path_distance": "mm", "path_length": "mm", "heading_error": "rad", "forward": "V_p", "left": "V_p",
        "turn": "rad / time unit"}  # fmt: skip
"""Field of `measures.path.PathOutcomes` -> its unit."""

EXTRA = {"margin": "1", "least_margin": "1", "recovery": "time unit", "event": "time unit", "back": "time unit"}
"""Normalised static margin, its minimum, recovery time after a push, time of the first event, and time from which the
walk is undisturbed again -> unit."""


@dataclass(frozen=True)
class TaskWalks:
    """Walks of one controller in one task; `outcomes` is the function of a cell."""

    controller: Controller
    task: Task
    n_starts: int
    seed: int
    stride: Stride

    @property
    def velocity(self) -> float:
        """V_r at which the controller walks by the first part of the command that is not zero."""
        return pace(self.task.whole_command, self.stride)

    @cached_property
    def timetable(self) -> TimedStarts:
        """The starts of the walks, and the random times of events."""
        n, stride = self.n_starts, self.stride
        if self.task.drawn_times:
            command = self.task.whole_command
            curved = None if command.velocity is not None else command
            return find_stable_starts(self.planner, self.velocity, n, self.seed, stride, GRID, curved)
        draw = np.random.default_rng([self.seed, 2]).uniform(size=(n, 2))[:, 1]
        return TimedStarts(draw_starts(n, self.seed, stride), np.zeros(n, dtype=int), draw, n)

    @property
    def planner(self) -> Controller:
        """The controller without sensory feedback, after the announcement of lost legs."""
        controller: Any = self.controller
        controller = controller.controller if isinstance(controller, SensoryFeedback) else controller
        for event in self.task.events:
            if isinstance(event, LegLost) and event.announced and hasattr(controller, "after_loss"):
                controller = controller.after_loss(event.leg, event.time)
        return controller

    def step_of(self, event: Disturbing, which: np.ndarray) -> np.ndarray:
        """Return the number of steps before an event, (n,), of the starts with indices `which`, (n,)."""
        if event.time is None:
            return self.timetable.step[which]
        return np.full(len(which), round(event.time / self.stride.dt))

    @property
    def disturbing(self) -> Halt | LegStopped | Push | None:
        """The event that stops legs or has an answer, if there is one."""
        return next((event for event in self.task.events if stops(event)), None)  # pyright: ignore[reportReturnType]

    @property
    def recovery(self) -> Acceleration | None:
        """The acceleration of the answer 'slow_down', or None."""
        event = self.disturbing
        return Acceleration(event.recovery) if event and event.answer == "slow_down" else None

    @cached_property
    def _postures(self) -> Any:
        event = self.disturbing
        if not event or event.answer != "reorganise":
            return None
        return collect_postures(self.planner, self.velocity, self.seed, self.stride)

    def disturbed(self, which: np.ndarray) -> Controller:
        """Return the controller of the starts with indices `which`, (n,), with the event that stops legs."""
        event = self.disturbing
        if event is None:
            return self.planner
        kind: Any = {Halt: "halt", LegStopped: "leg", Push: "push"}[type(event)]
        leg = event.leg if isinstance(event, LegStopped) else None
        disturbance = Disturbance(kind, self.step_of(event, which), self.timetable.draw[which], leg)
        planner: Any = self.planner
        return Disturbed(planner, disturbance, self._postures, slows=self.recovery is not None)

    def plan(self, which: np.ndarray, threads: int | None) -> Plan:
        """Return the plan of the starts with indices `which`, (n,), at time 0."""
        task, starts = self.task, self.timetable.starts[which]
        controller = self.disturbed(which)
        command: Any = task.whole_command
        command = command if command.velocity is None else command.velocity
        if isinstance(self.controller, SensoryFeedback):
            controller = replace(self.controller, controller=controller)
        elif task.feedback or task.noise or task.delay:
            begun = begin(self.planner, starts[:1], self.velocity, self.stride)
            controller = controller if isinstance(begun, FeedbackPlan) else SensoryFeedback(controller)
        if task.noise or task.delay:
            controller = PoorSenses(controller, task.noise, task.delay)
        if task.starts == "steady":
            controller = FromSteadyState(controller)
        plan = begin(controller, starts, command, self.stride, self.recovery, threads)
        conditions = task.all_conditions
        held = HELD * max(conditions.standing_height, conditions.body.standing_height)
        for event in task.events:
            if isinstance(event, LegLost):
                plan = WithoutLeg(self.planner, event.leg, held, event.time).wrap(plan)
        return plan

    @cached_property
    def times(self) -> tuple[np.ndarray, np.ndarray]:
        """Time of each start's first event, NaN without one, and time from which it walks on undisturbed, (start,)."""
        everyone, dt = np.arange(self.n_starts), self.stride.dt
        first = np.full(self.n_starts, np.nan)
        for event in self.task.events:
            if isinstance(event, Halt | Push):
                first = np.fmin(first, self.step_of(event, everyone) * dt)
            elif isinstance(event, LegLost):
                first = np.fmin(first, event.time)
        event = self.disturbing
        if event is None:
            return first, np.nan_to_num(first)
        ahead: Any = begin(self.disturbed(everyone), self.timetable.starts, self.velocity, self.stride, self.recovery)
        step = self.step_of(event, everyone)
        last = int(step.max() + self.stride.periods(self.velocity, MOST_PERIODS) / dt)
        while (ahead.resumed == NEVER).any():
            if ahead.done > last:
                raise InputError(f"{self.task.name}: a leg of {self.controller.name} to be stopped does not swing")
            advanced(ahead, max(1, int(step.max()) + 1 - ahead.done))
        back = ahead.resumed * dt + (self.recovery.duration(self.velocity) if self.recovery else 0.0)
        return np.fmin(first, ahead.step * dt), back

    @property
    def duration(self) -> float:
        """Duration of all walks [time units]."""
        time = float(observation_duration(self.task.duration, self.velocity or 1.0, self.stride))
        return time + float(self.times[1].max()) if self.task.drawn_times else time

    def outcomes(self, threads: int | None = None, progress: Progress | None = None) -> "xr.Dataset":
        """Return the outcome of every physical walk, (start,).

        Returns:
            All fields of `Outcomes` and `PathOutcomes`, and the variables of `EFFORT` and `EXTRA`; NaN for starts that
            are `refused`.
        """
        import xarray as xr

        from hexmj.physics.outcomes import Outcomes

        everyone = np.arange(self.n_starts)
        parts = [part.assign_coords(start=which) for which, part in by_halves(everyone, self._walked(threads))]
        units = {member.name: UNITS.get(member.name, "1") for member in fields(Outcomes)} | PATH | EFFORT | EXTRA
        if parts:
            found = xr.concat(parts, "start").reindex(start=everyone)
        else:
            found = over_start({name: np.full(self.n_starts, np.nan) for name in units}).assign_coords(start=everyone)
        for name, unit in units.items():
            found[name].attrs["units"] = unit
        if progress:
            progress(1.0)
        return found.assign(refused=found.fall.isnull(), drawn=self.timetable.drawn)

    def _walked(self, threads: int | None) -> Any:
        """Return the function that walks the starts with some indices, (n,), and returns their outcomes."""
        from hexmj.measures.path import PathSoFar
        from hexmj.physics.outcomes import EffortSoFar, OutcomesSoFar
        from hexmj.physics.pushes import Push as BodyPush
        from hexmj.physics.rollout import drive
        from hexmj.physics.settle import settle_plan
        from hexmj.tasks.outcomes import MarginSoFar, recovery_times

        task, stride, conditions, duration = self.task, self.stride, self.task.all_conditions, self.duration
        steps, unit = int(steps_within(duration, stride)), conditions.body.mass * conditions.vp
        events = [event for event in task.events if isinstance(event, Push)]
        pendulum = Pendulum.of(conditions.standing_height, conditions.seconds(stride))
        first, back = self.times

        def walked(which: np.ndarray) -> "xr.Dataset":
            plan = self.plan(which, threads)
            settled = settle_plan(plan, conditions, threads)
            static, dynamic, _ = first_dynamic_losses(plan, steps, pendulum, threads)
            static, dynamic = (np.where(step > 0, step * stride.dt, np.inf) for step in (static, dynamic))
            begins = [self.step_of(event, which) for event in events]
            pushes = [
                BodyPush(np.full(len(which), event.impulse * unit), step * stride.dt, direction=event.direction)
                for event, step in zip(events, begins, strict=True)
            ]
            outcomes, effort = OutcomesSoFar(settled, static, dynamic), EffortSoFar(settled)
            margin, pushed, undisturbed = MarginSoFar(settled), PathSoFar(settled, steps), PathSoFar(settled, steps)
            for chunk in drive(settled, self.plan(which, 1), duration, pushes=pushes, threads=threads):
                for so_far in (outcomes, effort, margin, pushed):
                    so_far.add(chunk)
            recovery = np.full(len(which), np.nan)
            if pushes:
                for chunk in drive(settled, self.plan(which, 1), duration, threads=threads):
                    undisturbed.add(chunk)
                recovery = recovery_times(pushed.poses, undisturbed.poses, np.max(begins, axis=0), stride.dt)
            path = pushed.outcomes(task.whole_command)
            extra = {"event": first[which], "back": back[which], "recovery": recovery, "way": path.way}
            extra |= {"margin": margin.mean, "least_margin": margin.least, "torque": effort.torque}
            extra["work"] = effort.work / settled.compiled.weight
            columns = {name: getattr(path, name) for name in PATH}
            return over_start(vars(outcomes.outcomes()) | columns | extra)

        return walked


@dataclass(frozen=True)
class TaskStudy:
    """Walks of several controllers in several tasks."""

    tasks: Sequence[Task]
    controllers: Mapping[str, Controller]
    """Controllers by their names in the result."""
    n_starts: int = 50
    """Number of random starts in each task, the same for every controller."""
    seed: int = field(default=17, kw_only=True)
    """Seed of the random starts; by default one on which no preset was optimised."""
    stride: Stride = field(default=Stride(), kw_only=True)

    def __post_init__(self) -> None:
        check_draw(self.n_starts, self.seed)
        distinct("tasks", [task.name for task in self.tasks])
        distinct("controllers", [*self.controllers])
        for controller in self.controllers.values():
            check_controller_type(controller)

    def cells(self) -> list[Cell]:
        """Return a cell for each task and controller, computed by `TaskWalks.outcomes`.

        Raises:
            InputError: adhesion presses the feet too deep into the ground, or a controller refuses a V_r.
        """
        from hexmj.physics.settle import check_adhesion

        cells = []
        for task in self.tasks:
            check_adhesion(task.all_conditions, self.stride, self.seed)
            for name, controller in self.controllers.items():
                walks = TaskWalks(controller, task, self.n_starts, self.seed, self.stride)
                check_velocities(controller, [walks.velocity], self.stride)
                work = float(observation_duration(task.duration, walks.velocity or 1.0, self.stride))
                cells.append(Cell(f"{task.name} {name}", walks.outcomes, {}, work))
        return cells

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """Return the dataset that `run_task` describes, from the outcomes of all cells."""
        table = over_axes({"task": len(self.tasks), "controller": len(self.controllers)}, data)
        table = table.assign_coords(task=[task.name for task in self.tasks], controller=[*self.controllers])
        recorded = {
            "study": "tasks",
            "controllers": {name: settings_of(controller) for name, controller in self.controllers.items()},
            "tasks": {task.name: _recorded(task) for task in self.tasks},
            "starts": self.n_starts,
            "seed": self.seed,
            "stride": asdict(self.stride),
        }
        return summarised(table).assign_attrs(attributes(recorded))


def by_halves(which: np.ndarray, walk: Callable[[np.ndarray], Any]) -> Iterator[tuple[np.ndarray, Any]]:
    """Walk the starts together; if that fails, walk each half separately, and so on. Leave out single starts that fail.

    Yield the indices and outcomes of each part that succeeds. A walk fails if its start cannot stand, its targets are
    out of reach, it diverges, or a push still acts at its end.

    Args:
        which: indices of the starts, (n,).
        walk: returns the outcomes of starts, given by index; outcomes of a start must not depend on the other starts.
    """
    try:
        yield which, walk(which)
    except (OutOfReach, SimulationError, StillThrown):
        for half in np.array_split(which, 2) if len(which) > 1 else ():
            yield from by_halves(half, walk)


def _recorded(task: Task) -> dict[str, Any]:
    """Return a task as plain data, with only those of its conditions that differ from their defaults."""
    conditions = task.conditions.settings()
    changed = {
        name: conditions[name] for name in unusual(conditions) if conditions[name] != Conditions().settings()[name]
    }
    return {name: plain(value) for name, value in vars(task).items() if name != "conditions"} | {"conditions": changed}


def summarised(table: "xr.Dataset") -> "xr.Dataset":
    """Add frequencies and means over the starts to outcomes over (task, controller, start), see `run_task`."""
    dims = ("task", "controller")
    table = table.transpose(*dims, "start", ...)
    reached = ~(table.fall <= table.event)  # events of walks that fall before them count as not met
    fell, lost = (happened(table[name]).where(reached).values for name in ("fall", "planned_loss"))
    new = frequencies("fell", fell, dims) | frequencies("lost", np.where(np.isnan(fell), np.nan, lost), dims)
    upright = table.where(np.isinf(table.fall))
    means = {name: upright[name].mean("start") for name in ("path_distance", "margin", "least_margin")}
    means["heading_error"] = abs(upright.heading_error).mean("start")
    means["progress"] = (upright.way / upright.path_length).where(upright.path_length > 0).mean("start")
    way = upright.way.sum("start")
    means["cost"] = (upright.work.sum("start") / way).where(way > 1.0)
    means["recovery"] = upright.recovery.median("start")
    means["n_refused"] = table.refused.sum("start")
    each = table.rename({name: f"{name}_each" for name in means if name in table})
    return each.assign(new | means)


def run_task(
    tasks: Task | str | Sequence[Task | str],
    controllers: Controller | Mapping[str, Controller],
    *,
    n_starts: int = TaskStudy.n_starts,
    seed: int = 17,
    stride: Stride = Stride(),
    folder: Path | str | None = None,
    **execution: Unpack[Execution],
) -> "xr.Dataset":
    """Let controllers walk tasks in physics, from the same random starts.

    Args:
        tasks: one or several tasks, names of tasks (`task.known_tasks`) or TOML files.
        controllers: one controller, or several controllers by name.
        n_starts: number of random starts in each task.
        seed: seed of the random starts.
        stride: step range, lines of the tips and time step.
        folder: directory in which finished cells are cached; None caches nothing.
        execution: options of `sweep.Execution`, such as `executor` and `threads`; the result does not depend on them.

    Returns:
        Over (task, controller): `fell`, the frequency of falls, and `lost`, that of losses of static stability of the
        plan, with 95 % Wilson intervals (`fell_low`, ...); in tasks with events, of the starts that do not fall before.
        Means over the walks without a fall: `path_distance`, the RMS distance to the commanded path [mm];
        `heading_error` at the end [rad]; `progress`, the distance along the path over the commanded one; `margin` and
        `least_margin`, normalised by the length of the shortest leg; the `cost` of transport along the path; the
        median `recovery` after a push [time units]. `n_refused` is the number of starts that are left out, since
        their walks fail.
        Over (task, controller, start): the outcomes of each walk, see `TaskWalks.outcomes`; those with the name of a
        mean end in `_each`.

    Raises:
        InputError: an argument is out of range, or a controller cannot do a task.
    """
    named = controllers if isinstance(controllers, Mapping) else {getattr(controllers, "name", "?"): controllers}
    several = [tasks] if isinstance(tasks, Task | str) else tasks
    found = [task if isinstance(task, Task) else load_task(task) for task in several]
    return run_study(TaskStudy(found, named, n_starts, seed=seed, stride=stride), folder, **execution)
