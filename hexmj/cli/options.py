"""Options of the command line, generated from the dataclasses of settings."""

import ast
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, make_dataclass
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
"""Field of settings -> its option, where they differ."""

COMMON = ("controller", "velocity", "starts", "seed", "vp", "observation_time", "out", "json")
"""Options that `--help` shows first, in this order, in all commands that have them."""

CONTROLLER = (
    "a weight set (hws, ldvs, uncoordinated, own, robust-0.3, lasting, ...), a baseline controller (wilson, graham,"
    " walknet, ...; `hexmj league` runs all), a TOML file, module:object, file.py:object or an entry point"
)
"""How controllers are named."""

TYPES = {int: "INT", float: "FLOAT", str: "TEXT", Path: "PATH"}
METAVARS = {"controller": "NAME", "observation_time": "TIME"}


@dataclass(frozen=True)
class Planning:
    """How controllers plan."""

    group: ClassVar[str] = "walk"

    order: Literal["printed", "undelayed", "sequential"] | None = None
    """Order of updates of the 1998 network; by default that of the weight set."""
    model_variant: str | None = None
    """Variant of the 1998 model, 'printed' or 'lasting'; by default that of the weight set."""
    feedback: bool = False
    """Give the controller sensory feedback: tips and ground contact before each of its steps."""


@dataclass(frozen=True)
class Output:
    """How a command reports."""

    json: bool = False
    """Print one JSON object and nothing else on standard output."""


@dataclass(frozen=True)
class Results:
    """Where the results of a study are written."""

    out: Path = Path("results")
    """Folder for figures, NetCDF, manifest and cached results."""


@dataclass(frozen=True)
class Figures:
    """How figures are written."""

    format: Literal["png", "pdf", "svg"] = "png"
    """Format of the figures."""


@dataclass(frozen=True)
class Threads:
    """Execution on threads."""

    group: ClassVar[str] = "execution"

    threads: int | None = None
    """Threads; by default one per core. No result depends on it."""


@dataclass(frozen=True)
class Workers:
    """Execution of cells. No result depends on these options, and finished cells are cached in the results' folder."""

    group: ClassVar[str] = "execution"

    threads: int | None = None
    """Threads of each process; by default the processes share the cores."""
    processes: int = 1
    """Number of processes."""
    scheduler: str | None = None
    """Address of a Dask scheduler such as tcp://127.0.0.1:8786; its workers must see the results' folder."""
    fresh: bool = False
    """Compute everything again, and replace cached results."""


@dataclass(frozen=True)
class Option:
    """One option: a field of the class that tyro parses."""

    name: str
    kind: Any
    default: Any
    group: str


def option_fields(
    settings: type, title: str, hidden: Collection[str] = (), usual: Mapping[str, Any] = {}
) -> Iterator[Option]:
    """Yield the options for a dataclass of settings.

    A controller is given by name; `Conditions`, `Stride` and `Acceleration` become options of their own.

    Args:
        settings: the dataclass. Its class variable `hidden` names conditions that are not offered, and `group` its
            group of options.
        title: group of its options, unless it names another.
        hidden: other fields that are not offered.
        usual: defaults by option that replace those of the dataclass.
    """
    hints, group = get_type_hints(settings), getattr(settings, "group", title)
    left_out = {"body", *hidden, *getattr(settings, "hidden", ())}
    for member in fields(settings):
        kind, name = hints[member.name], NAMES.get(member.name, member.name)
        default = _default(member, usual.get(name, MISSING))
        if member.name in left_out or name in left_out:
            continue
        if several := {Conditions, Stride}.intersection((kind, *get_args(kind))):
            (kind,) = several
            for part in option_fields(kind, "walk" if kind is Stride else "conditions", left_out):
                value = usual.get(part.name, getattr(default, part.name, part.default))
                yield Option(part.name, part.kind, value, part.group)
        elif Acceleration in (kind, *get_args(kind)):
            yield Option("acceleration", float | None, usual.get("acceleration"), "walk")
            yield Option("initial_velocity", float | None, None, "walk")
        else:
            yield Option(name, kind, default, group)


def options_class(
    title: str,
    *sources: type,
    positional: str = "",
    hidden: Collection[str] = (),
    usual: Mapping[str, Any] = {},
    help: bool,
) -> type:
    """Return the class that tyro parses for several dataclasses of settings, with a member for each group of options.

    Args:
        title: group of the options that are particular to the command.
        sources: dataclasses of settings; of options with the same name, the first counts.
        positional: name of an option that is given without its name.
        hidden: fields that are not offered.
        usual: defaults that replace those of the dataclasses.
        help: whether the texts of the options are needed.
    """
    found: dict[str, Option] = {}
    for source in sources:
        for option in option_fields(source, title, hidden, usual):
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
    """Return all options of a parsed `options_class` in one namespace."""
    values = {}
    for name, value in vars(parsed).items():
        values |= vars(value) if is_dataclass(value) else {name: value}
    return SimpleNamespace(**values)


def build(settings: Any, given: SimpleNamespace, **own: Any) -> Any:
    """Return an object of a dataclass of settings, made from the options; see `option_fields`.

    Args:
        settings: the dataclass.
        given: parsed options; those that are None, or not there, keep the defaults of the dataclass.
        own: fields that the options do not give as they are.
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
            case "stride":
                values["stride"] = stride(given)
            case "acceleration":
                values["acceleration"] = acceleration(given)
            case name:
                value = getattr(given, NAMES.get(name, name), None)
                values |= {} if value is None else {name: value}
    return settings(**values)


def controller(given: SimpleNamespace, name: str) -> Controller:
    """Return a controller by name, with the order, model variant and feedback that the options ask for."""
    from dataclasses import replace

    from hexmj.controllers.registry import load_controller

    found = load_controller(name)
    if rules := network_rules(given):
        from hexmj.controllers.cruse1998 import Cruse1998

        if not isinstance(found, Cruse1998):
            option = next(iter(rules)).replace("_", "-")
            raise InputError(f"--{option} has no effect on {name}; only the 1998 network has it")
        found = replace(found, **rules)
    if getattr(given, "feedback", False):
        from hexmj.controllers.feedback import SensoryFeedback

        return SensoryFeedback(found)
    return found


def network_rules(given: SimpleNamespace) -> dict[str, Any]:
    """Return the order of updates and the model variant of the 1998 network, as far as they are given."""
    rules = {}
    if getattr(given, "order", None):
        rules["order"] = given.order
    if getattr(given, "model_variant", None):
        from hexmj.controllers.cruse1998 import named_variant

        rules["model_variant"] = named_variant(given.model_variant)
    return rules


def controllers(given: SimpleNamespace) -> dict[str, Controller]:
    """Return several controllers by their own names, or by the given ones if two have the same."""
    distinct("--controller", given.controller)
    found = [controller(given, name) for name in given.controller]
    own = [one.name for one in found]
    return dict(zip(own if len(set(own)) == len(own) else given.controller, found, strict=True))


def conditions(given: SimpleNamespace, usual: Conditions | None = None) -> Conditions:
    """Return the conditions, with the defaults of a study."""
    return Conditions(**(usual or Conditions()).values() | _given(Conditions, given))


def stride(given: SimpleNamespace) -> Stride:
    """Return the stride."""
    values = _given(Stride, given)
    values["geometry"] = GEOMETRIES[values.get("geometry", "fig1")]
    return Stride(**values)


def acceleration(given: SimpleNamespace) -> Acceleration | None:
    """Return the accelerating procedure of Eq. 11, if walks accelerate."""
    if given.acceleration is None:
        if given.initial_velocity is not None:
            raise InputError(f"--initial-velocity = {given.initial_velocity:g} has no effect without --acceleration")
        return None
    start = Acceleration.start if given.initial_velocity is None else given.initial_velocity
    return Acceleration(given.acceleration, start)


def no_effect(given: SimpleNamespace, names: Collection[str], reason: str, usual: Mapping[str, Any] = {}) -> None:
    """Raise InputError if an option was given that has no effect for a reason such as 'without --physical'."""
    defaults = Conditions().values() | {"feedback": False} | dict(usual)
    for name in names:
        if (value := getattr(given, name, defaults[name])) != defaults[name]:
            raise InputError(f"--{name.replace('_', '-')} = {value} has no effect {reason}")


def _given(settings: type, given: SimpleNamespace) -> dict[str, Any]:
    names = {member.name for member in fields(settings)}
    return {name: value for name, value in vars(given).items() if name in names}


def _default(member: Any, usual: Any = MISSING) -> Any:
    if usual is not MISSING:
        return usual
    return member.default if member.default_factory is MISSING else member.default_factory()


def _member(option: Option, texts: Mapping[str, str], *markers: Any) -> Any:
    """Return an option as `make_dataclass` takes it: name, annotated type and default."""
    name, kind, default = option.name, option.kind, option.default
    if kind is Controller:
        kind, default = str, "ldvs" if default is MISSING else default
    elif kind is Geometry:
        kind, default = Literal[*GEOMETRIES], next(one for one, lines in GEOMETRIES.items() if lines == default)
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
        text = f"{text} {'Each is' if several else 'It is'} {CONTROLLER}.".strip()
    choices = "{" + ",".join(map(str, get_args(inner))) + "}" if get_origin(inner) is Literal else None
    metavar = METAVARS.get(name) or choices or TYPES.get(inner, "")
    metavar = f"{metavar} ..." if several else metavar
    hint: Any = {"help_behavior_hint": ""} if default is None or default is False or default == () else {}
    hint |= {"metavar": f"[{metavar}]" if markers else metavar} if metavar else {}
    made = field() if default is MISSING else field(default=default)
    return name, Annotated[kind, arg(name=name.replace("_", "-"), help=text, **hint), *markers], made


def _texts(*settings: type) -> dict[str, str]:
    """Return the docstrings of the attributes of dataclasses by name; later classes win."""
    texts: dict[str, str] = {}
    for one in settings:
        for base in reversed([base for base in one.__mro__ if is_dataclass(base)]):
            (tree,) = ast.parse(dedent(getsource(base))).body
            for statement, text in pairwise(getattr(tree, "body", [])):
                match statement, text:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(words))):
                        texts[NAMES.get(name, name)] = " ".join(words.split())
    return {
        "acceleration": "Accelerate from --initial-velocity with a of Eq. 11 [1 / time unit]; 0.00008 in the paper.",
        "initial_velocity": "V_r(0) when accelerating, a fraction of V_p; 0.1 by default.",
    } | texts
