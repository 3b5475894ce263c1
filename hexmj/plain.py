"""Settings as plain data, for the attributes of results and for cache keys."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

import numpy as np

from hexmj.errors import InputError
from hexmj.validate import short

Visit = Callable[[Any], None]
"""Receives the classes and functions that settings consist of."""


def plain(value: Any, visit: Visit = lambda thing: None) -> Any:
    """Return a setting as JSON can hold it: a dataclass or enumeration with its class, an array as a list.

    A path, or a text with a dot, that names a file becomes the file's name and a digest of its content.

    Args:
        value: a number, text, path, array, dataclass, enumeration, class, function, or a list or dict of these.
        visit: called with every class and function.

    Raises:
        InputError: the value is something else.
    """
    match value:
        case Enum():
            return {"class": _label(type(value), visit), "member": value.name}
        case None | bool() | int() | float():
            return value.item() if isinstance(value, np.generic) else value
        case np.ndarray() | np.generic():
            return value.tolist()
        case str() | Path():
            path = Path(value)
            named = (isinstance(value, Path) or "." in value) and path.is_file()
            return f"{path.name}@{digest(path.read_bytes())}" if named else str(value)
        case type() | FunctionType() | MethodType():
            return _label(value, visit)
        case _ if is_dataclass(value):
            members = {field.name: plain(getattr(value, field.name), visit) for field in fields(value)}
            return {"class": _label(type(value), visit)} | members
        case tuple() if names := getattr(value, "_fields", ()):
            members = {name: plain(member, visit) for name, member in zip(names, value, strict=True)}
            return {"class": _label(type(value), visit)} | members
        case tuple() | list():
            return [plain(item, visit) for item in value]
        case Mapping():
            return {str(key): plain(item, visit) for key, item in value.items()}
    raise InputError(
        f"{short(value)} is no setting; expected a number, text, path, array, dataclass, or a list or dict"
    )


def digest(content: bytes) -> str:
    """Return the first digits of the SHA-256 of some bytes."""
    return hashlib.sha256(content).hexdigest()[:12]


def _label(thing: Any, visit: Visit) -> str:
    visit(thing)
    return f"{thing.__module__}:{thing.__qualname__}"
