"""Settings as plain data (numbers, texts, lists and dicts), for the attributes of results and for cache keys."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

import numpy as np

from hexmj.errors import InputError
from hexmj.validate import short

Visit = Callable[[Any], None]
"""Function that receives each class and function in a setting."""


def plain(value: Any, visit: Visit = lambda definition: None) -> Any:
    """Convert a setting to data for JSON: an array becomes a list, a dataclass a dict of its class and fields.

    If a path, or a text with a dot, is an existing file, it becomes the file's name and a digest of its content.

    Args:
        value: a number, text, path, array, dataclass, class, function, or a list or dict of these.
        visit: function that is called with every class and function in the value.

    Raises:
        InputError: the value, or a part of it, has another type.
    """
    match value:
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
        f"{short(value)} cannot be a setting; expected a number, text, path, array, dataclass, or a list or dict"
    )


def digest(content: bytes) -> str:
    """Return the first twelve hexadecimal digits of the SHA-256 of `content`."""
    return hashlib.sha256(content).hexdigest()[:12]


def _label(definition: Any, visit: Visit) -> str:
    visit(definition)
    return f"{definition.__module__}:{definition.__qualname__}"
