"""Controllers by name: presets, parameter files, objects in modules and files, entry points."""

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from hexmj.controllers.cruse1998 import PRESETS, Cruse1998
from hexmj.controllers.cruse1998.presets import read_weights
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.files import read_toml
from hexmj.literal import literal
from hexmj.loaded import importable

ENTRY_POINTS = "hexmj.controllers"
"""Group of the entry points by which other packages bring controllers: a name and `module:object`."""


def load_controller(name: str) -> Controller:
    """A controller by its name.

    Args:
        name: a preset; ``module:object`` or ``file.py:object``, a controller or a class of controllers, which is made
            with its defaults; an entry point of the group `ENTRY_POINTS`; or a TOML file with weights of the 1998
            network, or with the name of a `controller` and a table of its `fields`.

    Raises:
        InputError: no such name, file, module or object, or an object that is no controller.
    """
    if name in PRESETS:
        return PRESETS[name]
    where, colon, what = name.rpartition(":")
    if colon and where and what.isidentifier():
        return _controller(_object(_module(where, name), what, name), name)
    for point in entry_points(group=ENTRY_POINTS, name=name):
        return _controller(_object(_module(point.module, name), point.attr, name), name)
    path = Path(name)
    if _is_file(path):
        return _with_fields(path) or Cruse1998(read_weights(path), name=literal(path.stem))
    raise InputError(
        f"controller {name!r} is neither one of {', '.join(known_names())}, nor a TOML file that exists,"
        " nor module:object or file.py:object"
    )


def known_names() -> Iterator[str]:
    """Names of the presets and entry points."""
    yield from PRESETS
    yield from (point.name for point in entry_points(group=ENTRY_POINTS))


def _with_fields(path: Path) -> Controller | None:
    """The controller that a file names, with its fields; None of other files."""
    table = read_toml(path)
    if set(table) != {"controller", "fields"} or not isinstance(table["fields"], dict):
        return None
    if ":" not in (named := str(table["controller"])):
        raise InputError(f"{path}: controller = {named!r}; expected module:object or file.py:object")
    found: Any = load_controller(named)
    try:
        return replace(found, **table["fields"])
    except Exception as error:  # whatever the user's class raises
        raise InputError(f"{path} [fields]: {error}; expected fields of {named}") from None


def _module(where: str, name: str) -> ModuleType:
    """A module by its name, or from a file that ends in .py."""
    try:
        if not where.endswith(".py"):
            return import_module(where)
        if _is_file(Path(where)):
            return importable(Path(where))
    except InputError as error:
        raise InputError(f"controller {name!r}: {error}") from None
    except (Exception, SystemExit) as error:  # whatever the user's code raises
        raise InputError(f"controller {name!r}: {where} cannot be imported: {error!r:.300}") from error
    raise InputError(f"controller {name!r}: {where} is no file; expected one that ends in .py")


def _object(module: ModuleType, what: str, name: str) -> object:
    if not hasattr(module, what):
        found = [key for key, value in vars(module).items() if isinstance(value, type) and hasattr(value, "begin")]
        raise InputError(f"controller {name!r}: no {what} there; controllers there: {', '.join(found) or 'none'}")
    return getattr(module, what)


def _controller(found: object, name: str) -> Controller:
    """A controller, or one of a class with its defaults."""
    if isinstance(found, type):
        try:
            found = found()
        except Exception as error:  # whatever the user's code raises
            raise InputError(
                f"controller {name!r}: {found.__name__} cannot be made: {error};"
                " expected a class with defaults for all fields"
            ) from None
    try:
        check_controller_type(found)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    return found  # pyright: ignore[reportReturnType]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
