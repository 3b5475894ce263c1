"""Settings as plain JSON: what a cell is named by and what its file tells."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from inspect import getattr_static
from os.path import isfile
from pathlib import Path
from typing import Any

import numpy as np

from hexmj.checks import short
from hexmj.errors import InputError
from hexmj.files import digest
from hexmj.mjcf import content

PACKAGE = Path(__file__).parents[1]
"""Folder of this package."""


def plain(value: Any, folders: Sequence[Path] = ()) -> Any:
    """A setting as JSON can hold it: a frozen dataclass or named tuple with the name of its class, an array as a list.

    A file is its name and a digest of its content, wherever it lies; so is a text with a dot that names one.  A field
    of a user's own class may name one without a dot, and beside the class's module or those of its bases as well.

    Args:
        value: of the setting.
        folders: where files are looked for, beside the current one.

    Raises:
        InputError: it is none of the things that a setting can be.
    """
    if (names := field_names(value)) is not None:
        _check_fields(value, names)
        of_class = [*folders, *_folders(type(value))]
        return {"class": label(type(value))} | {name: plain(getattr(value, name), of_class) for name in names}
    if (type(value) is np.ndarray or isinstance(value, np.generic)) and value.dtype in (np.bool_, np.int64, np.float64):
        return value.tolist()
    if type(value) is str and (folders or "." in value) and (held := _held(value, folders)):
        return f"{value}@{held}"
    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) is list or type(value) is tuple:
        return [plain(item, folders) for item in value]
    if type(value) is dict and all(isinstance(key, str) for key in value):
        return {key: plain(item, folders) for key, item in value.items()}
    if isinstance(value, Path) and not value.is_dir():
        return f"{value.name}@{held}" if (held := _held(value, folders)) else str(value)
    raise InputError(
        f"{short(value)} is no setting; expected a number, text, path of a file, frozen dataclass, named tuple, or a"
        " tuple, dict or array (float64, int64, bool) of these"
    )


def label(thing: Any) -> str:
    """The name of a class or function: its module, or its file and a digest where it is a user's own, and its name.

    Raises:
        InputError: it stands inside a function, where no other process can find it.
    """
    if "<" in thing.__qualname__:
        raise InputError(f"{thing.__qualname__} stands inside a function; expected one of a module")
    return f"{module_label(thing.__module__)}.{thing.__qualname__}"


def module_label(module: str) -> str:
    """A module's name; that of the file where it is a script or a loaded file, wherever that lies."""
    name, _, stamp = module.partition("@")
    if name not in ("__main__", "__mp_main__") and not stamp:
        return module
    file = Path(getattr(sys.modules[module], "__file__", name))
    return f"{file.name}@{stamp}" if stamp else file.name


def classes(value: Any) -> Iterator[type]:
    """Those of all dataclasses and named tuples in a setting."""
    if (names := field_names(value)) is not None:
        yield type(value)
        yield from classes([getattr(value, name) for name in names])
    elif isinstance(value, Mapping):
        yield from classes(list(value.values()))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from classes(item)


def _held(name: str | Path, folders: Sequence[Path]) -> str:
    """Digests of what a file holds in the current folder and in others, each empty without it; none if all are."""
    paths = dict.fromkeys(folder / name for folder in (Path(), *folders))
    held = [digest(content(path)) if isfile(path) else "" for path in paths]
    return ",".join(held) if any(held) else ""


def _folders(kind: type) -> list[Path]:
    """Where the modules of a user's own class and of its bases lie."""
    names = [one.__module__ for one in kind.__mro__ if one.__module__.partition(".")[0] not in sys.stdlib_module_names]
    files = [Path(file) for name in names if (file := getattr(sys.modules.get(name), "__file__", None))]
    return [file.parent for file in files if not file.is_relative_to(PACKAGE)]


def _check_fields(value: Any, names: tuple[str, ...]) -> None:
    """Refuse what keeps anything else, but what it computes once, where no name and no file would tell it."""
    kind = type(value)
    beside = set(getattr(value, "__dict__", ())) - set(names)
    if hidden := {name for name in beside if not isinstance(getattr_static(kind, name, None), cached_property)}:
        raise InputError(f"{label(kind)} keeps {min(hidden)!r} beside its fields; expected all settings as fields")


def field_names(value: Any) -> tuple[str, ...] | None:
    """Names of the fields of a frozen dataclass or of a named tuple; none of anything else."""
    parameters = getattr(type(value), "__dataclass_params__", None)
    if parameters is not None and parameters.frozen:
        return tuple(one.name for one in fields(value))
    return getattr(value, "_fields", None) if isinstance(value, tuple) else None
