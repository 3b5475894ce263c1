"""What several commands are told: which walks, by which controller, under which conditions.

Each command is a frozen dataclass made of these parts, and offers just the options that it obeys.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, make_dataclass, replace
from typing import Annotated, Any, Literal, TypeVar, cast

from tyro.conf import Fixed, OmitArgPrefixes, Suppress, arg

from hexmj.cli.loaded import loaded
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.timing import Acceleration, Stride
from hexmj.validate import distinct

PRESET = (
    "a preset (hws, ldvs, uncoordinated, own, own-0.1 ... own-0.9, robust-0.1, robust-0.3, robust-0.7, lasting,"
    " lasting-0.1 ... lasting-0.9)"
)
OF_ONES_OWN = "a file of weights (TOML), module:object, file.py:object or an entry point"
NETWORK = f"{PRESET}, {OF_ONES_OWN}"
"""How sets of the 1998 network are named."""

CONTROLLER = f"{PRESET}, a rival (wilson, graham, ...; `hexmj league` lists all), {OF_ONES_OWN}"
"""How controllers are named."""

ControllerName = Annotated[str, arg(help=f"A controller: {CONTROLLER}.")]


@dataclass(frozen=True)
class Walks:
    """Which walks: their starts, how long they are observed, and where the tips step."""

    observation_time: str = "walk"
    """Observation time: 'walk' (three periods of a single leg), 'start' (two protractions) or a number [time units]."""
    seed: int = 0
    """Seed of the random starts; those of 0 are the ones on which our own presets were searched."""
    stride: OmitArgPrefixes[Stride] = field(default_factory=Stride)

    @property
    def time(self) -> str | float:
        """The observation time's name, or its number of time units."""
        try:
            return float(self.observation_time)
        except ValueError:
            return self.observation_time


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
    """Order of updates of the 1998 network: 'printed' (Eq. 6 to the letter), 'undelayed' or 'sequential'; that of the
    set unless given."""
    model_variant: str | None = None
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
        from hexmj.controllers.feedback import SensoryFeedback

        found = loaded(name)
        for rule, value in self.rules.items():
            if not isinstance(found, Cruse1998):
                raise InputError(
                    f"--{rule} = {getattr(self, rule)} with {name}; expected it with the 1998 network only"
                )
            found = replace(found, **{rule: value})
        return SensoryFeedback(found) if self.feedback else found

    @property
    def rules(self) -> dict[str, Any]:
        """What was given of the 1998 network's order of updates and reading."""
        from hexmj.controllers.cruse1998.model_variants import named_variant

        given = {"order": self.order, "model_variant": self.model_variant and named_variant(self.model_variant)}
        return {name: value for name, value in given.items() if value is not None}

    def brought(self, name: str) -> str:
        """Order of updates and reading that a set brings along, where it does not walk as printed; else nothing."""
        from hexmj.controllers.cruse1998 import Cruse1998
        from hexmj.controllers.cruse1998.model_variants import ModelVariant, in_words

        found = loaded(name)
        if not isinstance(found, Cruse1998):
            return ""
        model_variant = (
            in_words(found.model_variant) if isinstance(found.model_variant, ModelVariant) else str(found.model_variant)
        )  # an heir's
        rules = {"order": found.order, "model_variant": model_variant}
        return ", ".join(
            f"{rule} {told}" for rule, told in rules.items() if told != "printed" and rule not in self.rules
        )

    def controllers(self, names: Sequence[str]) -> dict[str, Controller]:
        """Several of them, by what they call themselves, or as they were asked for where two have one name."""
        distinct("models", names)
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


Options = TypeVar("Options")


def hiding(usual: Options, names: Collection[str], about: str = "") -> Options:
    """Options to begin with, of which a command does not offer some, those of parts too: these keep their values.

    `about` is said of the others, unless what is usual says it.
    """
    whole, base = cast(Any, usual), type(usual)
    values = {one.name: getattr(usual, one.name) for one in fields(whole)}
    parts = {name: hiding(value, names) for name, value in values.items() if is_dataclass(value) and name != "body"}
    if isinstance(usual, Conditions):
        kind = type("Conditions", (Conditions,), {"HIDDEN": tuple(names), "__doc__": usual.__doc__})
        return cast(Any, kind)(**values)
    hidden = [(name, Annotated[type(values[name]), Fixed, Suppress], values[name]) for name in names if name in values]
    namespace = {"__doc__": about or usual.__doc__}
    kind = make_dataclass(base.__name__, hidden, bases=(base,), namespace=namespace, frozen=True) if hidden else base
    return kind(**values | parts)


STEADY = hiding(Accelerating(), ["acceleration", "initial_velocity"])
"""Of commands whose walks do not accelerate."""

AS_THEY_ARE = hiding(Controlled(), ["order", "model_variant", "feedback"])
"""Of commands in which all controllers walk as they are."""
