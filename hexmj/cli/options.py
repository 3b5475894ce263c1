"""What several commands are told: which walks, by which controller, under which conditions.

Each command is a frozen dataclass made of these parts, and offers just the options that it obeys.
"""

import os
import threading
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass, field, fields, is_dataclass, make_dataclass, replace
from typing import Annotated, Any, Literal, TypeVar, cast, get_type_hints

from tyro.conf import Fixed, OmitArgPrefixes, Suppress, arg
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from hexmj.conditions import OBEYED, Conditions, Ground
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, check_distinct
from hexmj.legs import GEOMETRIES, Geometry
from hexmj.process.signals import STOPS, of_stop, stops_wait, unheard_by_children
from hexmj.sweeps.plain import plain
from hexmj.timing import Acceleration, Stride

CONTROLLER = (
    "a preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9, robust-0.1, robust-0.3, robust-0.7, lasting,"
    " lasting-0.1 ... lasting-0.9), a rival (wilson, graham, ...; `hexmj league` lists all), a file of weights (TOML),"
    " module:object, file.py:object or an entry point"
)
"""How controllers are named."""

MOST_PROCESSES = 1000
"""More than any machine has cores."""

LOADED: dict[str, tuple[Controller, Any]] = {}
"""Controllers as the command has loaded them, and their settings then: a file that is edited while it runs is not run
again."""

ControllerName = Annotated[str, arg(help=f"A controller: {CONTROLLER}.")]


def loaded(name: str) -> Controller:
    """A controller by its name as the command has loaded it first; names and errors as of `load_controller`."""
    from hexmj.controllers.named import load_controller

    if name not in LOADED:
        LOADED[name] = (found := load_controller(name)), _settings(found)
    return LOADED[name][0]


def _settings(controller: Controller) -> Any:
    """A controller's settings as plain data; none where they are no such."""
    with suppress(InputError):
        return plain(controller)


def check_loaded() -> None:
    """Refuse that a file has changed, while the command was at work, which a field of a controller names.

    Raises:
        InputError: it has, or settings are none any more.
    """
    for name, (controller, settings) in LOADED.items():
        if settings is not None and plain(controller) != settings:
            raise InputError(f"a file that {name} names has changed while the command was at work; start it again")


@dataclass(frozen=True)
class Walks:
    """Which walks: their starts, how long they are observed, and where the tips step."""

    window: str = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (40 time units) or a number [time units]."""
    seed: int = 0
    """Seed of the random starts; those of 0 are the ones on which our own presets were searched."""
    stride: OmitArgPrefixes[Stride] = field(default_factory=Stride)

    @property
    def time(self) -> str | float:
        """The window's name, or its number of time units."""
        try:
            return float(self.window)
        except ValueError:
            return self.window


@dataclass(frozen=True)
class Accelerating:
    """Whether walks accelerate."""

    acceleration: float | None = None
    """Accelerate from --initial-velocity with this a of Eq. 11 [1 / time unit]; the paper's is 0.00008."""
    initial_velocity: float | None = None
    """V_r(0) when accelerating, a fraction of V_p; 0.1 unless given."""

    @property
    def procedure(self) -> Acceleration | None:
        """Eq. 11, if walks accelerate.

        Raises:
            InputError: an initial velocity without an acceleration.
        """
        if self.acceleration is not None:
            start = Acceleration.start if self.initial_velocity is None else self.initial_velocity
            return Acceleration(self.acceleration, start)
        if self.initial_velocity is not None:
            raise InputError(
                f"--initial-velocity = {self.initial_velocity:g} without --acceleration; expected it with that only"
            )
        return None


@dataclass(frozen=True)
class Controlled:
    """How the controllers plan that are named."""

    order: str | None = None
    """Order of updates of the 1998 network: 'printed' (Eq. 6 to the letter, unless given), 'undelayed' or
    'sequential'."""
    reading: str | None = None
    """Reading of the 1998 paper: 'printed', or 'lasting', in which an anterior leg acts by mechanism 3 while it
    protracts, too; that of the set unless given."""
    feedback: bool = False
    """The controller reads the legs before each of its steps, where the tips are and which feet meet the ground,
    instead of going on by itself."""

    def controller(self, name: str) -> Controller:
        """A controller by its name, see `load_controller`, planning in this way.

        Raises:
            InputError: no such controller, or one that has no order of updates or reading, or not this one.
        """
        from hexmj.controllers.cruse1998 import Cruse1998
        from hexmj.controllers.reads_legs import ReadsLegs

        found = loaded(name)
        for rule, value in self.rules.items():
            if not isinstance(found, Cruse1998):
                raise InputError(
                    f"--{rule} = {getattr(self, rule)} with {name}; expected it with the 1998 network only"
                )
            found = replace(found, **{rule: value})
        return ReadsLegs(found) if self.feedback else found

    @property
    def rules(self) -> dict[str, Any]:
        """What was given of the 1998 network's order of updates and reading."""
        from hexmj.controllers.cruse1998.readings import named_reading

        given = {"order": self.order, "reading": self.reading and named_reading(self.reading)}
        return {name: value for name, value in given.items() if value is not None}

    def brought(self, name: str) -> str:
        """Order of updates and reading that a set brings along, where it does not walk as printed; else nothing."""
        from hexmj.controllers.cruse1998 import Cruse1998
        from hexmj.controllers.cruse1998.readings import Reading, in_words

        found, _ = LOADED.get(name, (None, None))
        if not isinstance(found, Cruse1998):
            return ""
        reading = in_words(found.reading) if isinstance(found.reading, Reading) else str(found.reading)  # an heir's
        rules = {"order": found.order, "reading": reading}
        return ", ".join(
            f"{rule} {told}" for rule, told in rules.items() if told != "printed" and rule not in self.rules
        )

    def preset_of(self, name: str) -> str:
        """The preset whose weights a controller has, or of which parts are left out."""
        from hexmj.controllers.cruse1998 import PRESETS
        from hexmj.controllers.named import PART

        weights = getattr(LOADED.get(name, (None, None))[0], "weights", None)
        same = (preset for preset, usual in PRESETS.items() if weights and usual.weights == weights)
        return next(same, PART.sub("", name))

    def controllers(self, names: Sequence[str]) -> dict[str, Controller]:
        """Several of them, by what they call themselves, or as they were asked for where two have one name."""
        check_distinct("controllers", names)
        found = [self.controller(name) for name in names]
        own = [one.name for one in found]
        return dict(zip(own if len(set(own)) == len(own) else names, found, strict=True))


@dataclass(frozen=True)
class Figures:
    """How figures are written."""

    format: Literal["png", "pdf", "svg"] = "png"
    """Format of the figures: PNG for screens, PDF or SVG for print."""

    def named(self, name: str) -> str:
        """The name of a figure's file, from that of the PNG."""
        return f"{name.removesuffix('.png')}.{self.format}"


@dataclass(frozen=True)
class Workers:
    """What works."""

    threads: int | None = None
    """Threads; one per core unless given.  No result depends on it."""


@dataclass(frozen=True)
class Sweepers:
    """What works on cells, which are kept as they finish."""

    threads: int | None = None
    """Threads of each process; unless given, processes share the cores.  No result depends on it."""
    processes: int = 1
    """Processes that compute cells side by side.  No result depends on it."""
    scheduler: str | None = None
    """Address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers compute the cells instead; they must see
    the results' folder.  No result depends on it."""

    @property
    def threads_each(self) -> int | None:
        """Threads of each process; None where a single one takes all cores."""
        from hexmj.process.threads import thread_count

        if self.threads is not None:
            return thread_count(self.threads)
        return max(1, thread_count() // max(1, self.processes)) if self.processes != 1 else None

    @contextmanager
    def executor(self) -> Iterator[Executor | None]:
        """The processes, a cluster's workers, or None where this process does the work.

        Raises:
            InputError: no process, or too many, or a scheduler as well or that cannot be reached.
        """
        if not 1 <= self.processes <= MOST_PROCESSES:
            raise InputError(f"--processes = {self.processes}; expected at least 1 and at most {MOST_PROCESSES}")
        if self.processes == 1:
            from hexmj.sweeps.cluster import workers_of

            with nullcontext() if self.scheduler is None else workers_of(self.scheduler) as executor:
                yield executor
            return
        if self.scheduler is not None:
            raise InputError(f"--scheduler and --processes = {self.processes}; expected one of them")
        from concurrent.futures import ProcessPoolExecutor
        from multiprocessing import active_children, get_context

        from hexmj.sweeps.workers import end_with_parent

        with ExitStack() as ended:
            with stops_wait(), unheard_by_children(*STOPS):  # else semaphores might be left behind
                pool = ProcessPoolExecutor(self.processes, get_context("spawn"), initializer=end_with_parent)
                executor = ended.enter_context(pool)
            try:
                with unheard_by_children(*STOPS):
                    for _ in range(self.processes):
                        executor.submit(os.getpid)  # begins one
                yield executor
            except BaseException as error:
                if of_stop(error):  # nobody waits for cells that are stopped
                    threading.excepthook = lambda _: None  # the pool's own thread minds that they were cancelled
                    for worker in active_children():
                        worker.terminate()
                raise
            with stops_wait():  # nothing is left to do but to leave
                executor.shutdown()


def changed(given: Any, usual: Any) -> Iterator[str]:
    """Names of the options, of their parts too, that are not as usual; both are of one dataclass."""
    for name in (one.name for one in fields(given)):
        value, other = getattr(given, name), getattr(usual, name)
        if value != other:
            yield from changed(value, other) if is_dataclass(value) and not isinstance(value, Geometry) else [name]


registry = ConstructorRegistry()
"""How types of this package are read."""


@registry.primitive_rule
def _named_geometry(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Geometry] | None:
    """On the command line a geometry is given by its name."""
    if info.type is not Geometry:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="{" + ",".join(GEOMETRIES) + "}",
        instance_from_str=lambda words: GEOMETRIES[words[0]],
        is_instance=lambda value: isinstance(value, Geometry),
        str_from_instance=lambda value: [name for name, g in GEOMETRIES.items() if g == value],
        choices=tuple(GEOMETRIES),
    )


@registry.struct_rule
def _conditions_by_name(info: StructTypeInfo) -> StructConstructorSpec | None:
    """On the command line conditions are given one by one, and hold for the stick insect."""
    if info.type is not Conditions:
        return None
    usual = info.default if isinstance(info.default, Conditions) else Conditions()
    hints = get_type_hints(Conditions, include_extras=True)
    parts = [one.name for one in fields(Conditions) if one.name != "body"]

    def conditions(**given: Any) -> Conditions:
        if type(ground := given["ground"]) is Ground:
            vain = [name for name in changed(ground, Ground()) if name not in ("ground", *OBEYED[ground.ground])]
            if vain:
                name = vain[0].replace("_", "-")
                raise InputError(f"--{name} with --ground {ground.ground}; expected it with a ground that has it")
        return Conditions.of(**{name: value for part in given.values() for name, value in asdict(part).items()})

    return StructConstructorSpec(
        conditions, tuple(StructFieldSpec(name, hints[name], getattr(usual, name)) for name in parts)
    )


Options = TypeVar("Options")


def hiding(usual: Options, names: Collection[str], about: str = "") -> Options:
    """Options to begin with, of which a command does not offer some, those of parts too: these keep their values.

    `about` is said of the others, unless what is usual says it.
    """
    whole, base = cast(Any, usual), type(usual)
    values = {one.name: getattr(usual, one.name) for one in fields(whole)}
    parts = {name: hiding(value, names) for name, value in values.items() if is_dataclass(value) and name != "body"}
    if isinstance(usual, Conditions):
        return replace(usual, **parts)
    hidden = [(name, Annotated[type(values[name]), Fixed, Suppress], values[name]) for name in names if name in values]
    namespace = {"__doc__": about or usual.__doc__}
    kind = make_dataclass(base.__name__, hidden, bases=(base,), namespace=namespace, frozen=True) if hidden else base
    return kind(**values | parts)


STEADY = hiding(Accelerating(), ["acceleration", "initial_velocity"])
"""Of commands whose walks do not accelerate."""

AS_THEY_ARE = hiding(Controlled(), ["order", "reading", "feedback"])
"""Of commands in which all controllers walk as they are."""
