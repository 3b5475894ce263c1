"""Controllers by name: presets, parameter files, objects in modules and files, entry points."""

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getattr_static, signature
from operator import attrgetter
from os.path import isfile
from pathlib import Path
from types import ModuleType
from typing import Any

from hexmj.checks import typed
from hexmj.controllers.cruse1998 import PRESETS
from hexmj.controllers.cruse1998.presets import read_network
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.controllers.toml_fields import with_fields
from hexmj.controllers.varied_names import PART, VARIED
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml

ENTRY_POINTS = "hexmj.controllers"
"""Group of the entry points by which other packages bring controllers: a name and `module:object`."""

NO_FILE = "expected the path of one from the current folder; ~ is expanded by shells, in front of a word"
"""What is said of a file that is not there."""


def load_controller(name: str) -> Controller:
    """A controller by its name.

    Args:
        name: a preset or a rival, also without one of its mechanisms or rules (``ldvs-without-3``), or with mechanism 2
            or 4 (``ldvs-with-2``); ``module:object`` or ``file.py:object``, a controller or a class of controllers,
            which is made with its defaults; an entry point of the group `ENTRY_POINTS`; or a TOML file with weights of
            the 1998 network, or with the name of a `controller` and, unless all are usual, a table of its `fields`.
            With other weights or fields it has the name of the file.  What a search has found is judged by other starts
            than its own, those of seed 0 (of robust-0.3 and robust-0.7 also of 5 and 1), as by those of 1998.

    Raises:
        InputError: no such name, file, module or object, or an object that is no controller.
    """
    if typed("name", name, str) in PRESETS:
        return PRESETS[name]
    if name in (rivals := _rivals()):
        return rivals[name]
    if _object(name):
        where, _, what = name.rpartition(":")
        return _found(where, what, name)
    varied, ours = VARIED.fullmatch(name), PART.sub("", name) in {*PRESETS, *rivals}
    points = {one.value: one for one in entry_points(group=ENTRY_POINTS, name=name)} if not (varied and ours) else {}
    if len(points) > 1:
        raise InputError(f"controller {name!r} is that of several packages; expected one of {', '.join(points)}")
    for point in points.values():
        if not point.attr:
            raise InputError(f"entry point {name!r} = {point.value!r:.200}; expected module:object")
        return _found(point.module, point.attr, name)
    if varied:
        return _varied(varied["name"], varied["how"], int(varied["which"]))
    path = Path(name)
    if path.suffix == ".py" and isfile(path):
        return _found(name, "", name)
    if not isfile(path):
        if path.suffix in (".py", ".toml"):
            raise InputError(f"controller {name!r} is no file; {NO_FILE}")
        raise InputError(
            f"controller {name!r} is neither one of {', '.join(known_names())}, nor a TOML file that exists,"
            " nor module:object or file.py:object"
        )
    table = read_toml(path)
    table.pop(SEARCHED, None)
    if "controller" in table:
        if not (table.keys() <= {"controller", "fields"} and isinstance(table.get("fields", {}), dict)):
            raise InputError(f"{path} holds {', '.join(table):.300}; expected controller and a table [fields]")
        return _with_fields(path, str(table["controller"]), table.get("fields", {}))
    return read_network(table, name, path.stem)


def parameter_file(name: str) -> Path | None:
    """The TOML file that a name of a controller means, if it means one that is there."""
    means_other = VARIED.fullmatch(name) or _object(name) or name.endswith(".py")
    return Path(name) if isfile(name) and not means_other and name not in known_names() else None


def known_names() -> Iterator[str]:
    """Names of the presets, the rivals and the entry points."""
    ours = [*PRESETS, *_rivals()]
    yield from dict.fromkeys([*ours, *(point.name for point in entry_points(group=ENTRY_POINTS))])


def _object(name: str) -> bool:
    """Whether a name is that of an object in a module or file."""
    where, _, what = name.rpartition(":")
    return bool(where) and what.isidentifier()


def _rivals() -> dict[str, Controller]:
    """By their names; imported once one is asked for."""
    from hexmj.controllers.baselines.table import BASELINES

    return BASELINES


def _varied(name: str, how: str, which: int) -> Controller:
    """A controller with one mechanism or rule more or less."""
    found: Any = load_controller(name)
    change = getattr(found, "without" if how == "without" else "having", None)
    if change is None:
        whole = f"controller {name}-{how}-{which}: {name} has no mechanisms or rules that can be switched"
        off = f" on; expected {name}-without-{which}" if hasattr(found, "without") else ""
        raise InputError(whole + off)
    return _made(lambda: change(which), f"{name}-{how}-{which}", "expected a controller, or an InputError")


def _with_fields(path: Path, named: str, values: dict[str, Any]) -> Controller:
    """The controller that a file names, with these fields; named like the file, unless it tells a name."""
    varied = VARIED.fullmatch(named)
    if not _object(PART.sub("", named)) and {named, varied["name"] if varied else named}.isdisjoint(known_names()):
        raise InputError(
            f"{path}: controller = {named!r}; expected module:object, file.py:object, a preset, a rival or an entry"
            " point"
        )
    found = load_controller(named)
    try:
        return with_fields(found, values, path.stem) if values else found
    except Exception as error:  # whatever the user's class raises
        of: Any = found
        known = [one.name for one in fields(of) if one.init]
        odd = [name for name in values if name not in of.__dataclass_fields__]  # which knows `InitVar`s, too
        told = (
            f"{odd[0]}; valid names of {named}: {', '.join(known)}" if odd else f"{error}; expected fields of {named}"
        )
        raise InputError(f"{path} [fields]: {told}") from None


def _found(where: str, what: str, name: str) -> Controller:
    """An object of a module, or of a file that ends in .py: a controller, or one of a class with its defaults."""
    module = _module(where, name)
    if what.partition(".")[0] not in vars(module) and not hasattr(module, "__getattr__"):
        there = [key for key, value in vars(module).items() if _offers(value)]
        missing = f"no {what} there" if what else f"a file, and which controller of it? expected {name}:NAME"
        raise InputError(f"controller {name!r}: {missing}; controllers there: {', '.join(there) or 'none'}")

    def make() -> Any:
        found = attrgetter(what)(module)
        return found() if isinstance(found, type) else found

    return _made(make, name, "expected a class with defaults for all fields")


def _offers(value: Any) -> bool:
    """Whether something looks like a controller, or like a class of them with defaults."""
    kind = value if isinstance(value, type) else type(value)
    if (
        not is_dataclass(kind)
        or getattr_static(kind, "begin", None) is None
        or "begin" in {one.name for one in fields(kind)}
    ):
        return False
    try:
        asked = signature(kind).parameters.values() if value is kind else ()
    except (TypeError, ValueError):  # of a class that a built-in one makes
        return False
    return not any(one.default is one.empty and one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD) for one in asked)


def _made(make: Callable[[], Any], name: str, expected: str) -> Controller:
    """A controller that a user's code makes, whatever that raises; what is no `InputError` is the cause of ours."""
    try:
        found = make()
        check_controller_type(found)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except (Exception, SystemExit) as error:
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise InputError(f"controller {name!r} cannot be made: {told:.300}; {expected}") from error
    return found


def _module(where: str, name: str) -> ModuleType:
    if not where.endswith(".py") and (os.sep in where or ("." in where and isfile(where))):
        raise InputError(f"controller {name!r}: {where} is neither a module nor a file that ends in .py")
    try:
        if not where.endswith(".py"):
            return import_module(where)
        if isfile(where):
            return _file_module(Path(where))
    except InputError as error:
        raise InputError(f"controller {name!r}: {error}") from None
    except (Exception, SystemExit) as error:  # whatever the user's code raises
        raise InputError(f"controller {name!r}: {where} cannot be imported: {error!r:.300}") from error
    raise InputError(f"controller {name!r}: {where} is no file; {NO_FILE}")


def _file_module(path: Path) -> ModuleType:
    """Import a file as a module of its own name; its directory joins `sys.path`, also for worker processes."""
    path = path.absolute()
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    module = import_module(path.stem)
    if not path.samefile(str(module.__file__)):
        raise InputError(f"{path}: there is another module {path.stem!r}, {module.__file__}; rename the file")
    return module
