"""Fields as a TOML file tells them: members of an enumeration by name or value, records as tables, rows as lists."""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import is_dataclass, replace
from enum import Enum
from functools import partial
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from hexmj.checks import typed
from hexmj.errors import InputError

_PLAIN = bool, int, float, str
"""Types of fields whose values are as a file tells them."""

_CHOICES = Union, UnionType


def with_fields(usual: Any, values: dict[str, Any]) -> Any:
    """A frozen dataclass with other values of some fields.

    Raises:
        InputError: a value of another type.
        Exception: whatever its class raises, and of fields that are not there.
    """
    return _made(type(usual), partial(replace, usual), values)


def _made(kind: type, make: Callable[..., Any], values: dict[str, Any]) -> Any:
    types = _types(kind)
    made = make(**{name: _fitting(name, value, types.get(name)) for name, value in values.items()})
    for name in values:
        if _is_checked(of := types.get(name)):
            typed(name, getattr(made, name), of)
    return made


def _types(kind: type) -> dict[str, Any]:
    """What a class's fields are annotated with, but for names that only type checkers know."""
    types = {}
    for base in reversed(kind.__mro__):
        known = vars(sys.modules.get(base.__module__, object))
        for name, annotation in vars(base).get("__annotations__", {}).items():
            with suppress(NameError):
                types |= get_type_hints(SimpleNamespace(__annotations__={name: annotation}), dict(known))
    return types


def _is_checked(kind: Any) -> bool:
    """Whether a type is plain, an enumeration, a record, or a choice or row of such."""
    if (origin := get_origin(kind)) in (*_CHOICES, tuple, Sequence):
        return all(one is Ellipsis or _is_checked(one) for one in get_args(kind))
    if origin is Literal or kind in (*_PLAIN, NoneType):
        return True
    return isinstance(kind, type) and (issubclass(kind, Enum) or is_dataclass(kind))


def _fitting(name: str, value: Any, kind: Any) -> Any:
    """What a file tells, as its type has it; of what does not fit a class may make its own, but for plain ones."""
    try:
        return value if kind is None else typed(name, value, kind)
    except InputError:
        if kind in _PLAIN:
            raise
    for one in get_args(kind) if get_origin(kind) in _CHOICES else [kind]:
        if isinstance(one, type) and issubclass(one, Enum):
            if isinstance(value, str) and value in one.__members__:
                return one[value]
            with suppress(ValueError):
                return one(value)
        if isinstance(one, type) and is_dataclass(one) and isinstance(value, dict):
            with suppress(TypeError):  # of other fields
                return _made(one, one, value)
    return value
