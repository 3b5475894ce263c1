"""Options of the command line, generated from the dataclasses of settings."""

import ast
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, make_dataclass, replace
from inspect import getsource
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from types import NoneType, SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin, get_type_hints

from tyro.conf import OmitArgPrefixes, Positional, arg

from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.legs import GEOMETRIES, Geometry
from hexmj.timing import Acceleration, Stride
from hexmj.validate import distinct

NAMES = {"controllers": "controller", "velocities": "velocity", "n_starts": "starts"}
"""Name of a dataclass field -> name of its option, where the two names differ."""

COMMON = ("controller", "velocity", "starts", "seed", "vp", "observation_time", "out", "json")
"""Options that `--help` shows first, in this order, in all commands that have them."""

CONTROLLER = (
    "a weight set (hws, ldvs, uncoordinated, own, robust-0.3, lasting, ...), a baseline controller (wilson, graham,"
    " walknet, ...; `hexmj league --list` shows all), a TOML file, module:object, file.py:object or an entry point"
)
"""Ways to name a controller, for the help texts."""


@dataclass(frozen=True)
class Planning:
    """Options that change how controllers plan."""

    group: ClassVar[str] = "walk"

    order: Literal["printed", "undelayed", "sequential"] | None = None
    """Order in which the 1998 network updates its state; by default, the weight set determines it."""
    model_variant: str | None = None
    """Variant of the 1998 model, 'printed' or 'lasting'; by default, the weight set determines it."""
    feedback: bool = False
    """Give the controller sensory feedback: tip positions and ground contacts before each of its steps."""


@dataclass(frozen=True)
class Json:
    """Options of a command that writes no files."""

    json: bool = False
    """Print the answer as one JSON object, and nothing else on standard output."""


@dataclass(frozen=True)
class Output(Json):
    """Options of a command that writes files."""

    out: Path = Path("results")
    """Folder for all files, such as figures, NetCDF, manifest and cached results."""


@dataclass(frozen=True)
class Figures:
    """Options of figures."""

    format: Literal["png", "pdf", "svg"] = "png"
    """Format of the figures."""


@dataclass(frozen=True)
class Threads:
    """Options of execution on threads."""

    group: ClassVar[str] = "execution"

    threads: int | None = None
    """Number of threads of each process, by default one per core; results do not depend on it."""


@dataclass(frozen=True)
class Workers(Threads):
    """Options of the execution of a study's cells; results do not depend on them."""

    processes: int = 1
    """Number of processes; by default they share the cores equally."""
    scheduler: str | None = None
    """Dask scheduler, such as tcp://127.0.0.1:8786; its workers compute and must be able to access the folder --out."""
    fresh: bool = False
    """Ignore cached results: compute everything again and replace them."""


@dataclass(frozen=True)
class Accelerating:
    """Options of a walk that accelerates."""

    acceleration: float | None = None
    """Acceleration a of Eq. 11 from --initial-velocity to --velocity [1 / time unit]; the paper's is 0.00008. By
    default, walks do not accelerate."""
    initial_velocity: float = Acceleration.start
    """V_r at the beginning of a walk with --acceleration."""


NESTED = {Conditions: Conditions, Stride: Stride, Acceleration: Accelerating}
"""Type of a field -> dataclass whose fields become the options of this field."""


@dataclass(frozen=True)
class Option:
    """One option: a field of the class that tyro parses."""

    name: str
    kind: Any
    default: Any
    group: str
    text: str

    def member(self, *markers: Any) -> Any:
        """Return the option as a field for `make_dataclass`: name, annotated type and default."""
        unset = self.default is None or self.default is False or self.default == ()
        shown: Any = {"help_behavior_hint": ""} if unset else {}
        config = arg(name=self.name.replace("_", "-"), help=self.text, **shown)
        default = field() if self.default is MISSING else field(default=self.default)
        return self.name, Annotated[self.kind, config, *markers], default


def option_fields(
    settings: type, title: str, hidden: Collection[str] = (), defaults: Mapping[str, Any] = {}
) -> Iterator[Option]:
    """Yield one option for each field of a dataclass of settings.

    A field of a type in `NESTED` becomes one option for each field of another dataclass. If the settings have a field
    `axes`, the option of a condition that is a number takes several values.

    Args:
        settings: the dataclass. Its class variable `hidden`, if any, names fields and conditions without an option;
            its class variable `group` names the group of its options.
        title: group of the options of a dataclass without `group`.
        hidden: further fields without an option.
        defaults: option -> default that replaces the one of the dataclass.
    """
    hints, texts, group = get_type_hints(settings), _texts(settings), getattr(settings, "group", title)
    left_out = {"body", "axes", *hidden, *getattr(settings, "hidden", ())}
    for member in fields(settings):
        kind, name = hints[member.name], NAMES.get(member.name, member.name)
        if left_out & {member.name, name}:
            continue
        default = defaults.get(name, _default(member))
        if nested := NESTED.keys() & {kind, *get_args(kind)}:
            (kind,) = nested
            for part in option_fields(NESTED[kind], "conditions" if kind is Conditions else "walk", left_out, defaults):
                axis = "axes" in hints and kind is Conditions and part.kind in (float, int)
                yield replace(part, kind=tuple[part.kind, ...], default=(part.default,)) if axis else part
        else:
            yield _option(name, kind, default, group, texts.get(name, ""))


def _option(name: str, kind: Any, default: Any, group: str, text: str) -> Option:
    """Return the option of a field, with a type that tyro can parse."""
    optional = NoneType in get_args(kind)
    inner = next(part for part in get_args(kind) if part is not NoneType) if optional else kind
    if get_origin(inner) in (tuple, Sequence, Mapping):
        kind = tuple[get_args(inner)[0], ...]
        kind = kind | None if optional else kind
        default = default if default is None or default is MISSING else tuple(default)
    if kind is Controller:
        kind, default = str, "ldvs" if default is MISSING else default
    elif kind is Geometry:
        kind, default = Literal[*GEOMETRIES], next(key for key, lines in GEOMETRIES.items() if lines == default)
    elif name == "observation_time":
        kind = float | str
    if name == "controller":
        each = "It is" if kind is str else "Each is"
        text = f"{text or 'Controller that plans the walk.'} {each} {CONTROLLER}."
    return Option(name, kind, default, group, text)


def options_class(options: Iterable[Option], title: str, positional: str) -> type:
    """Return the class that tyro parses, with one member for each group of options.

    Args:
        options: all options; of those with the same name, the first counts.
        title: name of the group of the command's own options.
        positional: option whose value is given without the option's name.
    """
    found: dict[str, Option] = {}
    for option in options:
        found.setdefault(option.name, option)
    members = [found.pop(positional).member(Positional)] if positional else []
    common = [found.pop(name) for name in COMMON if name in found]
    groups: dict[str, list[Option]] = {"common": common, title: [], "walk": [], "conditions": [], "execution": []}
    for option in found.values():
        groups[option.group].append(option)
    for name, group in groups.items():
        if group:
            kind = make_dataclass(name, [option.member() for option in group], namespace={"__doc__": ""})
            members.append((name, Annotated[OmitArgPrefixes[kind], arg(help="")], field(default_factory=kind)))
    return make_dataclass("Options", members)


def values_of(parsed: Any) -> dict[str, Any]:
    """Return option -> value of all groups of a parsed `options_class`."""
    values = {}
    for name, value in vars(parsed).items():
        values |= vars(value) if is_dataclass(value) else {name: value}
    return values


def build(settings: Any, given: SimpleNamespace, **own: Any) -> Any:
    """Build a dataclass of settings from parsed options; `option_fields` made the options from its fields.

    Args:
        settings: the dataclass.
        given: parsed options; a field whose option is None or missing keeps the default of the dataclass.
        own: field values that override the options.
    """
    values = dict(own)
    for member in fields(settings):
        if member.name in own:
            continue
        match member.name:
            case "controller":
                values["controller"] = controller(given, given.controller)
            case "controllers":
                distinct("--controller", given.controller)
                found = [controller(given, name) for name in given.controller]
                names = [planner.name for planner in found]
                names = names if len(set(names)) == len(names) else given.controller
                values["controllers"] = dict(zip(names, found, strict=True))
            case "conditions":
                values["conditions"] = conditions(given)
            case "axes":
                several = _given(Conditions, given).items()
                values["axes"] = {k: v for k, v in several if isinstance(v, tuple) and len(v) != 1}
            case "stride":
                values["stride"] = replace(Stride(**_given(Stride, given)), geometry=GEOMETRIES[given.geometry])
            case "acceleration":
                rate = given.acceleration
                values["acceleration"] = None if rate is None else Acceleration(rate, given.initial_velocity)
            case name:
                value = getattr(given, NAMES.get(name, name), None)
                values |= {} if value is None else {name: value}
    return settings(**values)


def controller(given: SimpleNamespace, name: str) -> Controller:
    """Load a controller by name, and apply the options --order, --model-variant and --feedback."""
    from hexmj.controllers.registry import load_controller

    found = load_controller(name)
    if rules := network_rules(given):
        from hexmj.controllers.cruse1998 import Cruse1998

        if not isinstance(found, Cruse1998):
            option = next(iter(rules)).replace("_", "-")
            raise InputError(f"--{option} has no effect on {name}; it changes only the 1998 network")
        found = replace(found, **rules)
    if getattr(given, "feedback", False):
        from hexmj.controllers.feedback import SensoryFeedback

        return SensoryFeedback(found)
    return found


def network_rules(given: SimpleNamespace) -> dict[str, Any]:
    """Return the values of --order and --model-variant as fields of `Cruse1998`, without options that are not given."""
    rules = {}
    if getattr(given, "order", None):
        rules["order"] = given.order
    if getattr(given, "model_variant", None):
        from hexmj.controllers.cruse1998 import named_variant

        rules["model_variant"] = named_variant(given.model_variant)
    return rules


def conditions(given: SimpleNamespace) -> Conditions:
    """Return the conditions that the options set; of several values, the first counts."""
    values = _given(Conditions, given)
    return Conditions(**{k: v[0] if isinstance(v, tuple) else v for k, v in values.items() if v != ()})


def check_kinematic(given: SimpleNamespace, used: Collection[str] = ()) -> None:
    """Raise InputError if an option is set that changes only physical walks, except for the conditions in `used`."""
    for name, default in (Conditions().values() | {"feedback": False}).items():
        if name not in used and getattr(given, name, default) != default:
            raise InputError(f"--{name.replace('_', '-')} has no effect on kinematic walks; leave it out")


def _given(settings: type, given: SimpleNamespace) -> dict[str, Any]:
    names = {member.name for member in fields(settings)}
    return {name: value for name, value in vars(given).items() if name in names}


def _default(member: Any) -> Any:
    return member.default if member.default_factory is MISSING else member.default_factory()


def _texts(settings: type) -> dict[str, str]:
    """Return option -> docstring of its field in a dataclass or in one of its base classes."""
    texts: dict[str, str] = {}
    for base in reversed([base for base in settings.__mro__ if is_dataclass(base)]):
        (tree,) = ast.parse(dedent(getsource(base))).body
        for statement, text in pairwise(getattr(tree, "body", [])):
            match statement, text:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(words))):
                    texts[NAMES.get(name, name)] = " ".join(words.split())
    return texts
