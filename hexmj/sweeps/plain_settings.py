"""Settings as plain JSON: what a cell is named by and what its file tells."""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from enum import Enum
from functools import cached_property
from inspect import getattr_static
from os.path import isfile
from pathlib import Path
from types import MemberDescriptorType
from typing import Any

import numpy as np

from hexmj.checks import short
from hexmj.errors import InputError
from hexmj.storage.files import digest
from hexmj.storage.mjcf import content, parts
from hexmj.user_code.sources_as_run import SCRIPTS, is_users

PACKAGE = Path(__file__).parents[1]
"""Folder of this package."""

ORDER, LIST, ARRAY, PATH = "\0order", "\0list", "\0array", "\0path"
"""Keys, no names that anybody gives: beside those of a dict that are not sorted, for their order; and of a list, an
array and a path, which would be told as a tuple or a text is."""

NUMBERS = np.bool_, np.int64, np.float64
"""Types of numbers in arrays that are settings."""


def plain(value: Any, folders: Sequence[Path] = (), exact: bool = False) -> Any:
    """A setting as JSON can hold it: a frozen dataclass, named tuple or enumeration with its class, an array as a list.

    A file is its place and a digest of its content; so is a text with a dot that names one.  Its place is told as it is
    given, from the current folder or those of the class's modules where it lies in one, and by its name alone in this
    package.  A field of a user's own class may name a file without a dot, and beside the class's module or those of its
    bases as well.

    Args:
        value: of the setting.
        folders: where files are looked for, beside the current one.
        exact: tell also the type and shape of an array, lists from tuples, paths from texts and the order of a dict,
            which code may go by.

    Raises:
        InputError: it is none of the things that a setting can be.
    """
    if isinstance(value, Enum):
        told: dict[str, Any] = {"class": label(type(value)), "member": value.name}
        with suppress(InputError):  # of what is no setting the class tells, whose code is named, too
            told["value"] = plain(value.value, folders, exact)
        return told
    if (names := field_names(value)) is not None:
        _check_fields(value, names)
        of_class = [*folders, *_folders(type(value))]
        return {"class": label(type(value))} | {name: plain(getattr(value, name), of_class, exact) for name in names}
    if type(value) is np.ndarray and value.dtype in NUMBERS:
        return {ARRAY: [str(value.dtype), list(value.shape), value.tolist()]} if exact else value.tolist()
    if isinstance(value, np.generic) and value.dtype in NUMBERS:
        return value.item()
    if type(value) is str and (folders or "." in value) and (held := _held(value, folders)):
        return f"{value}@{held}"
    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) is list or type(value) is tuple:
        items = [plain(item, folders, exact) for item in value]
        return {LIST: items} if exact and type(value) is list else items
    if type(value) is dict and all(isinstance(key, str) for key in value):
        told = {key: plain(item, folders, exact) for key, item in value.items()}
        return told | {ORDER: list(value)} if exact and sorted(value) != list(value) else told
    if isinstance(value, Path):
        if value.is_dir():
            raise InputError(f"{value}, a folder, is no setting; expected files in fields, or its name as a text")
        name = f"{_place(value, folders)}@{held}" if (held := _held(value, folders)) else str(value)
        return {PATH: name} if exact else name
    raise InputError(
        f"{short(value)} is no setting; expected a number, text, path of a file, frozen dataclass, named tuple,"
        " member of an enumeration, or a tuple, array or dict by text of these; numbers are float64, int64 or bool"
    )


def label(thing: Any) -> str:
    """The name of a class or function: its module, or its file and a digest where it is a user's own, and its name.

    Raises:
        InputError: it stands inside a function, where no other process can find it.
    """
    if "<" in thing.__qualname__:
        raise InputError(f"{thing.__qualname__} stands inside a function; expected one of a module")
    if hasattr(thing, "__dataclass_fields__") and not stands_there(thing):
        raise InputError(f"{thing.__qualname__} is not what its module has under that name; expected one of a module")
    return f"{module_label(thing.__module__)}.{thing.__qualname__}"


def stands_there(thing: Any) -> bool:
    """Whether a class or function is what its name leads to in its module."""
    found: Any = sys.modules.get(thing.__module__)
    for name in thing.__qualname__.split("."):
        found = getattr(found, name, None)
    return found == getattr(thing, "__func__", thing)


def module_label(module: str) -> str:
    """A module's name; that of the file where it is a script or a loaded file, wherever that lies."""
    name, _, stamp = module.partition("@")
    if name not in SCRIPTS and not stamp:
        return module
    file = Path(getattr(sys.modules[module], "__file__", name))
    return f"{file.name}@{stamp}" if stamp else file.name


def classes(value: Any) -> Iterator[type]:
    """Those of all dataclasses, named tuples and enumerations in a setting."""
    if isinstance(value, Enum):
        yield type(value)
    elif (names := field_names(value)) is not None:
        yield type(value)
        yield from classes([getattr(value, name) for name in names])
    elif isinstance(value, Mapping):
        yield from classes(list(value.values()))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from classes(item)


def named_files(value: Any, folders: Sequence[Path] = ()) -> Iterator[Path]:
    """Files that a setting names, with their parts, whether they are there or not; as `plain` finds them."""
    if (names := field_names(value)) is not None:
        of_class = [*folders, *_folders(type(value))]
        for name in names:
            yield from named_files(getattr(value, name), of_class)
    elif isinstance(value, Mapping):
        yield from named_files(list(value.values()), folders)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from named_files(item, folders)
    elif (isinstance(value, Path) or (type(value) is str and (folders or "." in value))) and "\0" not in str(value):
        for path in _paths(value, folders):
            yield from parts(path) if isfile(path) else [path]


def _held(name: str | Path, folders: Sequence[Path]) -> str:
    """Digests of what a file holds in the current folder and in others, each empty without it; none if all are."""
    held = [digest(content(path)) if isfile(path) else "" for path in _paths(name, folders)]
    return ",".join(held) if any(held) else ""


def _paths(name: str | Path, folders: Sequence[Path]) -> list[Path]:
    """Where a file may lie that a setting names."""
    return [*dict.fromkeys(folder / name for folder in (Path(), *folders))]


def _place(file: Path, folders: Sequence[Path]) -> str:
    """Where a file lies, as far as that does not change as a project is moved."""
    if not is_users(str(file.absolute())):
        return file.name
    for i, home in enumerate([*folders, Path.cwd()] if file.is_absolute() else []):
        with suppress(ValueError):  # of another drive
            if os.path.commonpath([file, home]) != home.anchor:
                return f"{i}:{os.path.relpath(file, home)}"
    return os.path.normpath(file)


def _folders(kind: type) -> list[Path]:
    """Where the modules of a user's own class and of its bases lie."""
    names = [one.__module__ for one in kind.__mro__ if one.__module__.partition(".")[0] not in sys.stdlib_module_names]
    files = [Path(file) for name in names if (file := getattr(sys.modules.get(name), "__file__", None))]
    return [file.parent for file in files if not file.is_relative_to(PACKAGE)]


def _check_fields(value: Any, names: tuple[str, ...]) -> None:
    """Refuse what keeps anything else, but what it computes once, where no name and no file would tell it."""
    kind = type(value)
    slots = {name for base in kind.__mro__ for name, one in vars(base).items() if isinstance(one, MemberDescriptorType)}
    beside = {*getattr(value, "__dict__", ()), *(name for name in slots if hasattr(value, name))} - set(names)
    if hidden := {name for name in beside if not is_computed_once(kind, name)}:
        raise InputError(f"{label(kind)} keeps {min(hidden)!r} beside its fields; expected all settings as fields")


def is_computed_once(kind: type, name: str) -> bool:
    """Whether objects of a class keep under a name what they have computed of their fields."""
    return isinstance(getattr_static(kind, name, None), cached_property)


def field_names(value: Any) -> tuple[str, ...] | None:
    """Names of the fields of a frozen dataclass or of a named tuple; none of anything else."""
    parameters = getattr(type(value), "__dataclass_params__", None)
    if parameters is not None and parameters.frozen:
        return tuple(one.name for one in fields(value))
    return getattr(value, "_fields", None) if isinstance(value, tuple) else None
