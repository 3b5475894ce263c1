"""Tasks as plain data: what a body shall do, on which ground, and what happens on the way.

A task is a dataclass or a TOML file. Times are in time units: 1 mm / V_p. The file holds the fields of `Task`; the
tables `[command]`, `[terrain]` and `[conditions]` hold those of `Command`, `Terrain` and `Conditions`, and each table
`[[events]]` holds a `kind`, one of `EVENTS`, and the fields of the event:

    duration = 300.0

    [command]
    forward = 0.3

    [terrain]
    ground = "step"
    ground_height = 5.0

    [[events]]
    kind = "push"
    impulse = 40.0
    time = 100.0
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from math import pi
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from hexmj.command import Command
from hexmj.conditions import Conditions, GroundKind, check_ground
from hexmj.errors import InputError
from hexmj.files import read_toml
from hexmj.timing import OBSERVATION_TIMES
from hexmj.validate import choice, number, short, whole

FOLDER = Path(__file__).parent / "files"
"""Folder of the tasks that come with hexmj."""

MOST_IMPULSE = 80.0
"""Maximum impulse of a push, in multiples of m V_p; a larger impulse throws the insect into the air."""

Answer = Literal["none", "reorganise", "slow_down"]
"""Strategies after a disturbance (paper, Section 6): none; the legs go to the nearest posture of undisturbed walking;
or the walk continues at V_r = 0.1 and accelerates again."""

Built = TypeVar("Built")


@dataclass(frozen=True)
class Terrain:
    """Ground of a task. Its fields are those of `Conditions`, of the same names."""

    ground: GroundKind = "flat"
    ground_height: float = Conditions.ground_height
    ground_at: float = Conditions.ground_at
    ground_length: float = Conditions.ground_length
    ground_seed: int = Conditions.ground_seed
    pitch: float = 0.0
    roll: float = 0.0
    softness: float = 0.0
    friction: float = 1.0

    def __post_init__(self) -> None:
        check_ground(self.on(Conditions()))

    @classmethod
    def step(cls, height: float, at: float = ground_at) -> "Terrain":
        """Return flat ground with a step up, `at` mm ahead of O at the start."""
        return cls("step", height, at)

    @classmethod
    def stairs(cls, height: float, length: float, at: float = ground_at) -> "Terrain":
        """Return flat ground with five stairs of a height and a length [mm]."""
        return cls("stairs", height, at, length)

    @classmethod
    def gap(cls, length: float, at: float = ground_at) -> "Terrain":
        """Return flat ground with a gap of a length in the direction of walking [mm]."""
        return cls("gap", ground_at=at, ground_length=length)

    @classmethod
    def rough(cls, height: float, seed: int = 0, at: float = ground_at) -> "Terrain":
        """Return ground with bumps of random heights up to `height` [mm]."""
        return cls("rough", height, at, ground_seed=seed)

    @classmethod
    def slope(cls, pitch: float, roll: float = 0.0) -> "Terrain":
        """Return a plane that rises ahead by `pitch` and to the left by `roll` [rad]."""
        return cls(pitch=pitch, roll=roll)

    @classmethod
    def soft(cls, softness: float = 10.0) -> "Terrain":
        """Return soft flat ground, with contacts of this time constant [ms]."""
        return cls(softness=softness)

    @classmethod
    def slippery(cls, friction: float) -> "Terrain":
        """Return flat ground with a coefficient of sliding friction."""
        return cls(friction=friction)

    def on(self, conditions: Conditions) -> Conditions:
        """Return conditions with this ground; fields of the terrain that have their defaults change nothing."""
        changed = {name: value for name, value in vars(self).items() if value != getattr(Terrain, name)}
        return replace(conditions, **changed)


@dataclass(frozen=True)
class Disturbing:
    """Base class of events that happen once in the walk of each start."""

    time: float | None = None
    """Time of the event; None is a random time of each start, within the fourth period of a leg. The starts are then
    the first of the seed whose plan is stable until then."""
    answer: Answer = field(default="none", kw_only=True)
    """Strategy after the event."""
    recovery: float = field(default=0.002, kw_only=True)
    """Acceleration with which the answer 'slow_down' returns to the commanded velocity [1 / time unit]."""

    def __post_init__(self) -> None:
        if self.time is not None:
            number("time", self.time, 0.0)
        choice("answer", self.answer, get_args(Answer))
        number("recovery", self.recovery, 0.0, 1.0, above=True)


@dataclass(frozen=True)
class Push(Disturbing):
    """A horizontal push on the root, which lasts 25 ms."""

    impulse: float = 10.0
    """Impulse, in multiples of the body's mass times V_p."""
    direction: float = pi / 2
    """Direction relative to the heading at time 0: 0 ahead, pi / 2 to the left [rad]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        number("impulse", self.impulse, 0.0, MOST_IMPULSE)
        number("direction", self.direction, -2 * pi, 2 * pi)


@dataclass(frozen=True)
class Halt(Disturbing):
    """An obstacle stops all legs; stances begin where the tips are. After 4 time units the walk begins again there."""


@dataclass(frozen=True)
class LegStopped(Disturbing):
    """An obstacle ends the swing of one leg: its stance begins where it is."""

    leg: int | None = None
    """Index of the leg; None is a random one. If the leg stands, the event waits for its next swing."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.leg is not None:
            whole("leg", self.leg, 0, 5)


@dataclass(frozen=True)
class LegLost:
    """A leg is lost: from then on it is held in the air."""

    leg: int = 0
    """Index of the leg."""
    time: float = 0.0
    """Time of the loss."""
    announced: bool = False
    """Whether the controller learns of the loss, if it has a method `after_loss`."""

    def __post_init__(self) -> None:
        whole("leg", self.leg, 0, 5)
        number("time", self.time, 0.0)


@dataclass(frozen=True)
class CommandChange:
    """The command changes, in addition to the parts of `Task.command`."""

    time: float
    """Time from which on the new command holds."""
    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0


Event = Push | Halt | LegStopped | LegLost | CommandChange

EVENTS: dict[str, type] = {
    "push": Push,
    "halt": Halt,
    "leg_stopped": LegStopped,
    "leg_lost": LegLost,
    "command_change": CommandChange,
}
"""Kind of an event in a TOML file -> its class."""


@dataclass(frozen=True)
class Task:
    """What a body shall do, on which ground, and what happens on the way.

    At most one event of a task stops legs or has an answer.
    """

    name: str
    command: Command | float = 0.3
    """Command of the walk; a number is V_r of a straight walk."""
    terrain: Terrain = Terrain()
    events: tuple[Event, ...] = ()
    duration: float | str = "walk"
    """Duration of the walk [time units], or 'walk' for three periods of a single leg. If an event happens at a random
    time, the duration counts from the moment when the last start has resumed its walk."""
    starts: Literal["random", "steady"] = "random"
    """Where walks begin: at random starts, or in the steady state that the plan reaches from them."""
    feedback: bool = False
    """Whether the controller gets sensory feedback; controllers with feedback of their own do not change."""
    noise: float = 0.0
    """Standard deviation of the errors of sensed tips, as a fraction of the step range; implies feedback."""
    delay: float = 0.0
    """Delay of all senses [time units]; implies feedback."""
    conditions: Conditions = Conditions()
    """Conditions of the walk except its ground."""
    about: str = ""
    """Description of the task for lists."""

    def __post_init__(self) -> None:
        if not isinstance(self.command, Command):
            object.__setattr__(self, "command", Command(number("command", self.command, 0.0, 1.0)))
        object.__setattr__(self, "events", tuple(self.events))
        for event in self.events:
            if not isinstance(event, Event):
                raise InputError(f"events: {short(event)}; expected one of {', '.join(EVENTS)}")
        if isinstance(self.duration, str):
            choice("duration", self.duration, OBSERVATION_TIMES)
        else:
            number("duration", self.duration, 0.0)
        choice("starts", self.starts, ("random", "steady"))
        number("noise", self.noise, 0.0, 10.0)
        number("delay", self.delay, 0.0, 1000.0)
        if len([event for event in self.events if stops(event)]) > 1:
            raise InputError(f"events of {self.name}: more than one stops legs or has an answer")
        if self.starts == "steady" and (self.whole_command.velocity is None or self.drawn_times):
            raise InputError("starts = steady; expected a constant command straight ahead and events at fixed times")
        check_ground(self.all_conditions)

    @property
    def all_conditions(self) -> Conditions:
        """The conditions of the walk with its terrain."""
        return self.terrain.on(self.conditions)

    @property
    def whole_command(self) -> Command:
        """The command with all `CommandChange` events as parts."""
        command: Any = self.command
        parts = dict(zip(command.times, command.parts.tolist(), strict=True))
        changes = [event for event in self.events if isinstance(event, CommandChange)]
        parts |= {event.time: [event.forward, event.left, event.turn] for event in changes}
        if not changes:
            return command
        forward, left, turn = zip(*(parts[time] for time in sorted(parts)), strict=True)
        return Command(forward, left, turn, sorted(parts))

    @property
    def drawn_times(self) -> bool:
        """Whether an event happens at a random time."""
        return any(isinstance(event, Disturbing) and event.time is None for event in self.events)


def stops(event: Event) -> bool:
    """Return whether an event stops legs, or is answered by a strategy of the plan."""
    return isinstance(event, Halt | LegStopped) or (isinstance(event, Push) and event.answer != "none")


def known_tasks() -> list[str]:
    """Return the names of the tasks that come with hexmj."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_task(name: str | Path) -> Task:
    """Return a task by its name, one of `known_tasks`, or from a TOML file.

    Raises:
        InputError: the name or the file does not exist, or the file does not describe a task.
    """
    path = Path(name)
    if path.suffix != ".toml":
        path = FOLDER / f"{name}.toml"
        if not path.is_file():
            hints = [f"did you mean {near}?" for near in get_close_matches(str(name), known_tasks(), 1)]
            expected = f"expected file.toml or one of {', '.join(known_tasks())}"
            raise InputError(f"task {str(name)!r} does not exist; {(hints or [expected])[0]}")
    table: dict[str, Any] = {"name": path.stem} | read_toml(path)
    for key, kind in {"command": Command, "terrain": Terrain, "conditions": Conditions}.items():
        if isinstance(table.get(key), dict):
            table[key] = _built(kind, table[key], f"{path} [{key}]")
    if "events" in table:
        table["events"] = tuple(_event(event, path) for event in table["events"])
    return _built(Task, table, str(path))


def _event(table: dict[str, Any], path: Path) -> Event:
    where = f"{path} [[events]]"
    if (kind := table.get("kind")) not in EVENTS:
        raise InputError(f"{where}: kind = {short(kind)}; valid names: {', '.join(EVENTS)}")
    return _built(EVENTS[kind], {key: value for key, value in table.items() if key != "kind"}, where)


def _built(kind: type[Built], values: Mapping[str, Any], where: str) -> Built:
    """Return a dataclass of the values of a table; raise InputError for an unknown key or a missing one."""
    names = [member.name for member in fields(kind)]  # pyright: ignore[reportArgumentType]
    if unknown := values.keys() - set(names):
        raise InputError(f"{where}: unknown key {', '.join(unknown)}; expected {', '.join(names)}")
    try:
        return kind(**values)
    except (InputError, TypeError) as error:
        raise InputError(f"{where}: {error}") from None
