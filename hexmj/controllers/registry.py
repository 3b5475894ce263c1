"""Controllers by name: presets, baselines, objects in modules and files, entry points and parameter files (TOML)."""

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.evolved import EVOLVED, FOUND, Evolved
from hexmj.controllers.cruse1998 import PRESETS, Cruse1998, own_tables, read_network
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml
from hexmj.plain import plain
from hexmj.validate import short

ENTRY_POINTS = "hexmj.controllers"
"""Group of the entry points by which other packages provide controllers: a name and `module:object`."""

VARIED = re.compile(r"(?P<name>.+)-(?P<how>without|with)-(?P<which>\d)")
"""Name of a controller without, or with, one of its mechanisms or rules, such as ldvs-without-3."""

PART = re.compile(r"(-(without|with)-\d)+$")
"""End of such a name."""


def load_controller(name: str) -> Controller:
    """Return a controller by its name.

    Args:
        name: a preset or a baseline; with ``-without-N`` without mechanism or rule N (``ldvs-without-3``), with
            ``-with-N`` with mechanism 2 or 4 (``ldvs-with-2``); ``module:object`` or ``file.py:object``, a controller,
            or a class whose fields all have defaults; an entry point of the group `ENTRY_POINTS`; or a TOML file with
            the weights of a 1998 network, or with the name of a `controller` and a table of its `fields`. The file's
            name becomes the controller's. Judge what a search has found on other starts than its own, those of seed 0
            (for robust-0.3 and robust-0.7 also of 5 and 1), for example on those of 1998.

    Raises:
        InputError: there is no such name, file, module or object, or the object is no controller.
    """
    if name in PRESETS:
        return PRESETS[name]
    if name in BASELINES:
        return BASELINES[name]
    if _is_object(name):
        where, _, what = name.rpartition(":")
        return _object(_module(where), what, name)
    for point in entry_points(group=ENTRY_POINTS, name=name):
        return _object(import_module(point.module), point.attr, name)
    if varied := VARIED.fullmatch(name):
        return _varied(load_controller(varied["name"]), varied["how"], int(varied["which"]))
    path = Path(name)
    if path.suffix == ".py" and path.is_file():
        return _object(_module(name), "", name)
    if not path.is_file():
        raise InputError(
            f"controller {name!r} is neither a file nor one of {', '.join(known_names())}; expected such a name,"
            " file.toml, file.py:object or module:object"
        )
    table = read_toml(path)
    table.pop(SEARCHED, None)
    if "controller" not in table:
        return read_network(table, name, path.stem)
    if table.keys() - {"controller", "fields"}:
        raise InputError(f"{path} holds {', '.join(table)}; expected controller and a table [fields]")
    return _from_table(path, str(table["controller"]), table.get("fields", {}))


def known_names() -> Iterator[str]:
    """Names of the presets, the baselines and the entry points."""
    yield from dict.fromkeys([*PRESETS, *BASELINES, *(point.name for point in entry_points(group=ENTRY_POINTS))])


def parameter_file(name: str) -> Path | None:
    """Return the TOML file that a controller's name means, or None if it means something else."""
    means_other = VARIED.fullmatch(name) or _is_object(name) or name.endswith(".py") or name in known_names()
    return Path(name) if not means_other and Path(name).is_file() else None


def searched_on(name: str, controller: Controller) -> dict[str, list[int]]:
    """Return on which starts searches found a controller: there it looks better than it is.

    Args:
        name: as `load_controller` takes it.
        controller: as `load_controller` returns it.

    Returns:
        Name of the search's result -> seeds of the starts of its search, and of those that it continued. Our own weight
        sets are recognised under any name, and without some of their mechanisms.
    """
    base = PART.sub("", name)
    names = [base] if base in PRESETS else []
    if isinstance(controller, Cruse1998):
        weights = plain(controller.weights)
        names += [preset for preset, usual in PRESETS.items() if plain(usual.weights) == weights]
    tables = {preset: own_tables().get(preset, {}) for preset in names}
    if base == EVOLVED.name or (isinstance(controller, Evolved) and controller == EVOLVED):
        tables[EVOLVED.name] = read_toml(FOUND)
    elif file := parameter_file(base):
        tables[base] = read_toml(file)
    return {found: table[SEARCHED]["seeds"] for found, table in tables.items() if SEARCHED in table}


def _is_object(name: str) -> bool:
    """Whether a name means an object in a module or file."""
    where, _, what = name.rpartition(":")
    return bool(where) and what.isidentifier()


def _varied(controller: Any, how: str, which: int) -> Controller:
    """Return a controller without, or with, a mechanism or rule."""
    change = getattr(controller, "without" if how == "without" else "having", None)
    if change is None:
        raise InputError(f"{controller.name} has no mechanisms or rules to be switched {how} -{how}-{which}")
    return change(which)


def _object(module: ModuleType, what: str, name: str) -> Controller:
    """Return an object of a module, or an instance of a class with its defaults."""
    found: Any = getattr(module, what, None)
    if found is None:
        offered = [key for key, value in vars(module).items() if is_dataclass(value) and hasattr(value, "begin")]
        raise InputError(f"controller {name!r} is not found; controllers there: {', '.join(offered) or 'none'}")
    if isinstance(found, type):
        try:
            found = found()
        except TypeError as error:
            raise InputError(f"controller {name!r} needs defaults for all fields: {error}") from error
    try:
        check_controller_type(found)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    return found


def _module(where: str) -> ModuleType:
    """Import a module, or a file that ends in .py as a module of its own name, also for worker processes."""
    path = Path(where).absolute()
    if path.suffix == ".py":
        if not path.is_file():
            raise InputError(f"{where} does not exist")
        if str(path.parent) not in sys.path:
            sys.path.append(str(path.parent))
    try:
        module = import_module(path.stem if path.suffix == ".py" else where)
    except (ImportError, SyntaxError, ValueError) as error:
        raise InputError(f"{where} cannot be imported: {error!r}") from error
    if path.suffix == ".py" and not path.samefile(str(module.__file__)):
        raise InputError(f"{path}: there is another module {path.stem!r}, {module.__file__}; rename the file")
    return module


def _from_table(path: Path, name: str, values: dict[str, Any]) -> Controller:
    """Return the controller that a file names with the fields that it gives, named like the file by default."""
    if Path(name).suffix == ".toml":
        raise InputError(f"{path}: controller = {name!r}; expected a controller that is no TOML file")
    found: Any = load_controller(name)
    if values and any(field.name == "name" and field.init for field in fields(found)):
        values = {"name": path.stem} | values
    try:
        return _made(type(found), found, values)
    except InputError as error:
        raise InputError(f"{path} [fields]: {error}") from None


def _made(kind: type, usual: Any, values: dict[str, Any]) -> Any:
    """Return a dataclass with values of a TOML table; the others are those of `usual`, or the class's defaults."""
    names = [field.name for field in fields(kind) if field.init]
    if unknown := values.keys() - set(names):
        raise InputError(f"unknown field {min(unknown)}; valid names: {', '.join(names)}")
    hints: dict[str, Any] = {}
    with suppress(NameError):  # of an annotation that only type checkers know
        hints = get_type_hints(kind)
    changed = {
        name: _converted(name, value, hints.get(name), getattr(usual, name, None)) for name, value in values.items()
    }
    try:
        return replace(usual, **changed) if isinstance(usual, kind) else kind(**changed)
    except TypeError as error:
        raise InputError(str(error)) from error


def _converted(name: str, value: Any, kind: Any, usual: Any = None) -> Any:
    """Convert a TOML value to the annotated type of a field.

    Numbers, texts, `Literal`, unions, tuples, enumerations (by name or value), paths, arrays and dataclasses (tables)
    are converted or refused; values for other types are returned as they are.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if kind in (bool, int, float, str):
        if type(value) is kind or (kind is float and type(value) is int):
            return kind(value)
    elif origin is Literal:
        if any(value == option and type(value) is type(option) for option in inner):
            return value
    elif origin in (Union, UnionType):
        for option in sorted(inner, key=lambda option: not (isinstance(option, type) and isinstance(usual, option))):
            with suppress(InputError):
                return _converted(name, value, option, usual)
    elif kind is type(None):
        if value is None:
            return None
    elif kind is tuple or origin in (tuple, list, Sequence):
        if isinstance(value, list):
            of = inner if origin is tuple and Ellipsis not in inner else (inner or (None,))[:1] * len(value)
            if len(of) == len(value):
                items = [_converted(name, item, option) for item, option in zip(value, of, strict=True)]
                return items if origin is list else tuple(items)
    elif np.ndarray in (kind, origin):
        if isinstance(value, list):
            return np.array(value, dtype=usual.dtype if isinstance(usual, np.ndarray) else None)
    elif isinstance(kind, type) and issubclass(kind, Enum):
        for member in kind:
            if value in (member.name, member.value):
                return member
    elif isinstance(kind, type) and issubclass(kind, Path):
        if isinstance(value, str):
            return kind(value)
    elif isinstance(kind, type) and is_dataclass(kind):
        if isinstance(value, dict):
            return _made(type(usual) if isinstance(usual, kind) else kind, usual, value)
    else:
        return value
    raise InputError(f"{name} = {short(value)}; expected {kind}")
