"""Options of the command line, generated from the dataclasses of settings."""

import ast
from collections.abc import Collection, Iterator, Mapping, Sequence
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
    " walknet, ...; `hexmj league` runs all), a TOML file, module:object, file.py:object or an entry point"
)
"""Ways to name a controller, for the help texts."""

TYPES = {int: "INT", float: "FLOAT", str: "TEXT", Path: "PATH"}
METAVARS = {"controller": "NAME", "observation_time": "TIME"}
"""Type, or name of an option -> placeholder of the value in `--help`."""


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
class Output:
    """Options of the output."""

    json: bool = False
    """Print the answer as one JSON object, and nothing else on standard output."""


@dataclass(frozen=True)
class Results:
    """Where a study writes its files."""

    out: Path = Path("results")
    """Folder for figures, NetCDF, manifest and cached results."""


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
    """Number of threads, by default one per core; results do not depend on it."""


@dataclass(frozen=True)
class Workers:
    """Options of the execution of a study's cells; results do not depend on them."""

    group: ClassVar[str] = "execution"

    threads: int | None = None
    """Number of threads of each process; by default the processes share the cores equally."""
    processes: int = 1
    """Number of processes."""
    scheduler: str | None = None
    """Dask scheduler, such as tcp://127.0.0.1:8786; its workers compute and must be able to access the folder --out."""
    fresh: bool = False
    """Ignore cached results: compute everything again and replace them."""


@dataclass(frozen=True)
class Option:
    """One option: a field of the class that tyro parses."""

    name: str
    kind: Any
    default: Any
    group: str


def option_fields(
    settings: type, title: str, hidden: Collection[str] = (), defaults: Mapping[str, Any] = {}
) -> Iterator[Option]:
    """Yield one option for each field of a dataclass of settings.

    A field of type `Conditions`, `Stride` or `Acceleration` becomes one option for each of its own fields. If the
    dataclass has a field `axes`, the option of a condition that is a number takes several values.

    Args:
        settings: the dataclass. Its class variable `hidden`, if any, names fields and conditions without an option;
            its class variable `group` names the group of its options.
        title: group of the options of a dataclass without `group`.
        hidden: further fields without an option.
        defaults: option -> default that replaces the one of the dataclass.
    """
    hints, group = get_type_hints(settings), getattr(settings, "group", title)
    left_out = {"body", *hidden, *getattr(settings, "hidden", ())}
    for member in fields(settings):
        kind, name = hints[member.name], NAMES.get(member.name, member.name)
        default = _default(member, defaults.get(name, MISSING))
        if member.name in left_out or name in left_out or name == "axes":
            continue
        if several := {Conditions, Stride}.intersection((kind, *get_args(kind))):
            (kind,) = several
            for part in option_fields(kind, "walk" if kind is Stride else "conditions", left_out):
                value = defaults.get(part.name, getattr(default, part.name, part.default))
                if kind is Conditions and "axes" in hints and part.kind in (float, int):
                    part, value = replace(part, kind=tuple[part.kind, ...]), (value,)
                yield Option(part.name, part.kind, value, part.group)
        elif Acceleration in (kind, *get_args(kind)):
            yield Option("acceleration", float | None, defaults.get("acceleration"), "walk")
            yield Option("initial_velocity", float | None, None, "walk")
        else:
            yield Option(name, kind, default, group)


def options_class(
    title: str,
    *sources: type,
    positional: str = "",
    hidden: Collection[str] = (),
    defaults: Mapping[str, Any] = {},
    help: bool,
) -> type:
    """Return the class that tyro parses, with one member for each group of options.

    Args:
        title: name of the group of the command's own options.
        sources: dataclasses whose fields become options; if two have the same option, the first dataclass defines it.
        positional: option whose value is given without the option's name.
        hidden: fields without an option.
        defaults: option -> default that replaces the one of its dataclass.
        help: whether the options get their help texts.
    """
    found: dict[str, Option] = {}
    for source in sources:
        for option in option_fields(source, title, hidden, defaults):
            found.setdefault(option.name, option)
    texts = _texts(Stride, Conditions, *reversed(sources)) if help else {}
    common = [found.pop(name) for name in COMMON if name in found]
    groups: dict[str, list[Option]] = {"common": common, title: [], "walk": [], "conditions": [], "execution": []}
    for option in found.values():
        groups.setdefault("positional" if option.name == positional else option.group, []).append(option)
    members: list[Any] = [_member(option, texts, Positional) for option in groups.pop("positional", [])]
    for name, options in groups.items():
        if options:
            name = name.replace("-", "_")
            kind = make_dataclass(name, [_member(option, texts) for option in options], namespace={"__doc__": ""})
            members.append((name, Annotated[OmitArgPrefixes[kind], arg(help="")], field(default_factory=kind)))
    return make_dataclass("Options", members)


def flat(parsed: Any) -> SimpleNamespace:
    """Return the options of all groups of a parsed `options_class` in one namespace."""
    values = {}
    for name, value in vars(parsed).items():
        values |= vars(value) if is_dataclass(value) else {name: value}
    return SimpleNamespace(**values)


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
                values["controllers"] = controllers(given)
            case "conditions":
                values["conditions"] = conditions(given, _default(member))
            case "axes":
                several = _given(Conditions, given).items()
                values["axes"] = {k: v for k, v in several if isinstance(v, tuple) and len(v) != 1}
            case "stride":
                values["stride"] = stride(given)
            case "acceleration":
                values["acceleration"] = acceleration(given)
            case name:
                value = getattr(given, NAMES.get(name, name), None)
                values |= {} if value is None else {name: value}
    return settings(**values)


def controller(given: SimpleNamespace, name: str) -> Controller:
    """Load a controller by name, and apply the options --order, --model-variant and --feedback."""
    from dataclasses import replace

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


def controllers(given: SimpleNamespace) -> dict[str, Controller]:
    """Return the controllers of --controller by their attribute `name`, or as typed if two have the same `name`."""
    distinct("--controller", given.controller)
    found = [controller(given, name) for name in given.controller]
    names = [planner.name for planner in found]
    return dict(zip(names if len(set(names)) == len(names) else given.controller, found, strict=True))


def conditions(given: SimpleNamespace, defaults: Conditions | None = None) -> Conditions:
    """Return the conditions that the options set, of several values the first; the others are those of `defaults`."""
    values = {k: v if isinstance(v, tuple) else (v,) for k, v in _given(Conditions, given).items()}
    return Conditions(**(defaults or Conditions()).values() | {k: v[0] for k, v in values.items() if v})


def stride(given: SimpleNamespace) -> Stride:
    """Return the stride that the options set."""
    values = _given(Stride, given)
    values["geometry"] = GEOMETRIES[values.get("geometry", "fig1")]
    return Stride(**values)


def acceleration(given: SimpleNamespace) -> Acceleration | None:
    """Return the acceleration of Eq. 11 that the options set, or None without --acceleration."""
    if given.acceleration is None:
        if given.initial_velocity is not None:
            raise InputError(f"--initial-velocity = {given.initial_velocity:g} has no effect without --acceleration")
        return None
    start = Acceleration.start if given.initial_velocity is None else given.initial_velocity
    return Acceleration(given.acceleration, start)


def no_effect(given: SimpleNamespace, names: Collection[str], reason: str, more: Mapping[str, Any] = {}) -> None:
    """Raise InputError if an option in `names` has no effect, for a `reason` such as "without --physical", but is set.

    An option is set if it differs from its default; `more` holds defaults of options that are no conditions.
    """
    defaults = Conditions().values() | {"feedback": False} | dict(more)
    for name in names:
        if (value := getattr(given, name, defaults[name])) != defaults[name]:
            raise InputError(f"--{name.replace('_', '-')} = {value} has no effect {reason}; leave it out")


def _given(settings: type, given: SimpleNamespace) -> dict[str, Any]:
    names = {member.name for member in fields(settings)}
    return {name: value for name, value in vars(given).items() if name in names}


def _default(member: Any, replacement: Any = MISSING) -> Any:
    if replacement is not MISSING:
        return replacement
    return member.default if member.default_factory is MISSING else member.default_factory()


def _member(option: Option, texts: Mapping[str, str], *markers: Any) -> Any:
    """Return an option as a field for `make_dataclass`: name, annotated type and default."""
    name, kind, default = option.name, option.kind, option.default
    if kind is Controller:
        kind, default = str, "ldvs" if default is MISSING else default
    elif kind is Geometry:
        kind, default = Literal[*GEOMETRIES], next(key for key, lines in GEOMETRIES.items() if lines == default)
    elif name == "observation_time":
        kind = float | str
    optional = NoneType in get_args(kind)
    inner = next(part for part in get_args(kind) if part is not NoneType) if optional else kind
    several = get_origin(inner) in (tuple, Sequence, Mapping)
    text = texts.get(name, "")
    if several:
        inner = get_args(inner)[0]
        kind = tuple[inner, ...] | None if optional else tuple[inner, ...]
        default = default if default is None or default is MISSING else tuple(default)
    if name == "controller":
        text = f"{text or 'Controller that plans the walk.'} {'Each is' if several else 'It is'} {CONTROLLER}."
    choices = "{" + ",".join(map(str, get_args(inner))) + "}" if get_origin(inner) is Literal else None
    metavar = METAVARS.get(name) or choices or TYPES.get(inner, "")
    metavar = f"{metavar} ..." if several else metavar
    hint: Any = {"help_behavior_hint": ""} if default is None or default is False or default == () else {}
    hint |= {"metavar": f"[{metavar}]" if markers and default is not MISSING else metavar} if metavar else {}
    described = Annotated[kind, arg(name=name.replace("_", "-"), help=text, **hint), *markers]
    return name, described, field() if default is MISSING else field(default=default)


def _texts(*settings: type) -> dict[str, str]:
    """Return option -> docstring of its field; if several dataclasses have the field, the last one counts."""
    texts: dict[str, str] = {}
    for source in settings:
        for base in reversed([base for base in source.__mro__ if is_dataclass(base)]):
            (tree,) = ast.parse(dedent(getsource(base))).body
            for statement, text in pairwise(getattr(tree, "body", [])):
                match statement, text:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(words))):
                        texts[NAMES.get(name, name)] = " ".join(words.split())
    texts.setdefault("initial_velocity", "V_r at the beginning of a walk with --acceleration; by default 0.1.")
    texts["acceleration"] = (
        "Acceleration a of Eq. 11 from --initial-velocity to --velocity [1 / time unit]; the paper's is 0.00008."
        " By default, walks do not accelerate."
    )
    return texts
