"""Controllers by name: presets, baselines, objects in modules and files, entry points and parameter files (TOML)."""

import re
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass, replace
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.baselines.evolved import EVOLVED, FOUND
from hexmj.controllers.baselines.reflexes import Reflexes
from hexmj.controllers.baselines.replanning import Replanning
from hexmj.controllers.cruse1998 import LDVS, OWN_TABLES, PRESETS, TripodLifted, read_network
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml
from hexmj.validate import short

ENTRY_POINTS = "hexmj.controllers"
"""Group of the entry points with which other packages register controllers: a name and `module:object`."""

NAMED: dict[str, Controller] = {
    **PRESETS,
    **BASELINES,
    "ldvs-tripod": TripodLifted(LDVS.weights, name="ldvs-tripod"),
    "ldvs-replans": Replanning(LDVS),
    "ldvs-reflexes": Reflexes(LDVS),
}
"""Name -> controller of this package: the presets, the baselines, LDVS with one tripod lifted at time 0,
LDVS that changes to a gait on five legs when the loss of a leg is announced, and LDVS with reflexes."""

VARIED = re.compile(r"(?P<name>.+?)(?P<parts>(-(without|with)-\d)+)")
"""Pattern of a controller's name that switches mechanisms or rules off or on, such as ldvs-without-3."""


def load_controller(name: str) -> Controller:
    """Return a controller by its name.

    Args:
        name: a name in `NAMED`, or an entry point of the group `ENTRY_POINTS`; such a name with ``-without-N``
            switches mechanism or rule N off (``ldvs-without-3``), with ``-with-N`` mechanism 2 or 4 on
            (``ldvs-with-2``). Or ``module:object`` or ``file.py:object``: a controller, or a class whose fields all
            have defaults. Or a TOML file with the weights of a 1998 network, or with the name of a `controller` and a
            table of its `fields`; the file's name becomes the controller's name. Do not judge a controller that a
            search found on the starts of its search: seed 0, for robust-0.3 also 5, for robust-0.7 also 1.

    Raises:
        InputError: the name, file, module or object does not exist, or the object is not a controller.
    """
    if name in NAMED:
        return NAMED[name]
    where, _, what = name.rpartition(":")
    if where and what.isidentifier():
        return _object(where, what, name)
    for point in entry_points(group=ENTRY_POINTS, name=name):
        return _object(point.module, point.attr, name)
    if varied := VARIED.fullmatch(name):
        controller: Any = load_controller(varied["name"])
        for how, which in re.findall(r"-(without|with)-(\d)", varied["parts"]):
            change = getattr(controller, {"without": "without", "with": "having"}[how], None)
            if change is None:
                raise InputError(f"{controller.name} has no mechanisms or rules to switch off or on: {name}")
            controller = change(int(which))
        return controller
    if file := parameter_file(name):
        table = read_toml(file)
        return _from_table(file, table) if "controller" in table else read_network(table, name, file.stem)
    if name.endswith(".py"):
        raise InputError(f"controller {name!r} lacks a class; expected {name}:CLASS")
    names = [*known_names()]
    expected = f"Expected file.toml, file.py:object, module:object or one of {', '.join(names)}"
    hints = [f"Did you mean {near}?" for near in get_close_matches(name.lower(), names, 1)]
    raise InputError(f"controller {name!r} does not exist. {(hints or [expected])[0]}")


def known_names() -> Iterator[str]:
    """Yield the names in `NAMED` and of the entry points."""
    yield from dict.fromkeys([*NAMED, *(point.name for point in entry_points(group=ENTRY_POINTS))])


def parameter_file(name: str) -> Path | None:
    """Return the path of the TOML file if the controller's name is that of an existing one, else None."""
    return Path(name) if name.endswith(".toml") and Path(name).is_file() else None


def searched_on(name: str) -> dict[str, list[int]]:
    """Return the seeds of the starts on which a controller was searched; on them it looks better than it is.

    Args:
        name: a name for `load_controller`; switches such as ``-without-3`` are ignored.

    Returns:
        Name -> seeds of its search and of the earlier searches that it continued; empty if no search found it.
    """
    varied = VARIED.fullmatch(name)
    base = varied["name"] if varied else name
    tables = {**OWN_TABLES, EVOLVED.name: read_toml(FOUND)}
    if file := parameter_file(base):
        tables[base] = read_toml(file)
    return {base: tables[base][SEARCHED]["seeds"]} if SEARCHED in tables.get(base, {}) else {}


def _object(where: str, what: str, name: str) -> Controller:
    """Return the object `what` of the module or file `where`; a class is instantiated with its defaults."""
    module = _module(where)
    found: Any = getattr(module, what, None)
    if found is None:
        offered = [key for key, value in vars(module).items() if is_dataclass(value) and hasattr(value, "begin")]
        raise InputError(f"controller {name!r} is not found; controllers in {where}: {', '.join(offered) or 'none'}")
    try:
        found = found() if isinstance(found, type) else found
        check_controller_type(found)
    except (InputError, TypeError) as error:  # TypeError: a field has no default
        raise InputError(f"{name}: {error}") from error
    return found


def _module(where: str) -> ModuleType:
    """Import a module or a .py file; the file's directory joins sys.path, so that worker processes import it too."""
    path = Path(where).absolute()
    if path.suffix == ".py" and not path.is_file():
        raise InputError(f"{where} does not exist")
    if path.suffix == ".py" and str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    try:
        module = import_module(path.stem if path.suffix == ".py" else where)
    except (ImportError, SyntaxError, ValueError) as error:
        raise InputError(f"{where} cannot be imported: {error!r}") from error
    if path.suffix == ".py" and not path.samefile(str(module.__file__)):
        raise InputError(f"{path}: the module {path.stem!r} already exists, {module.__file__}; rename the file")
    return module


def _from_table(path: Path, table: dict[str, Any]) -> Controller:
    """Return the controller of a parameter file's table with the file's fields; its default name is the file's."""
    if unknown := table.keys() - {"controller", "fields", SEARCHED}:
        raise InputError(f"{path} has the keys {', '.join(unknown)}; expected only controller and a table [fields]")
    default: Any = load_controller(table["controller"])
    values = table.get("fields", {})
    if values and "name" in default.__dataclass_fields__:
        values = {"name": path.stem} | values
    try:
        return _changed(default, values)
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"{path} [fields]: {error}") from None


def _changed(default: Any, values: dict[str, Any]) -> Any:
    """Return the dataclass `default` with the values of a TOML table, each converted to the type of the default.

    The table gives a tuple as a list, and a dataclass as a table of its fields.
    """
    changes = {}
    for name, value in values.items():
        match getattr(default, name, None):
            case tuple() | Path() as old:
                changes[name] = type(old)(value)
            case np.ndarray() as old:
                changes[name] = np.array(value, dtype=old.dtype)
            case old if is_dataclass(old) and isinstance(value, dict):
                changes[name] = _changed(old, value)
            case int() | float() as old if not isinstance(old, bool) and type(value) in (int, float):
                changes[name] = float(value) if isinstance(old, float) else value
            case old if old is None or type(value) is type(old):
                changes[name] = value
            case old:
                raise InputError(f"{name} = {short(value)}; expected a value like {short(old)}")
    return replace(default, **changes)
