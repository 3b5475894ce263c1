"""Fields as a TOML file tells them: members of enumerations by name or value, records as tables, rows as lists."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import partial
from inspect import signature
from itertools import repeat
from pathlib import PurePath
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from hexmj.checks import typed
from hexmj.errors import InputError

_PLAIN = bool, int, float, str
"""Types of fields whose values are as a file tells them."""

_TAKES = {"i": "iu", "u": "iu", "f": "iuf", "c": "iuf"}
"""Kind of an array's numbers, as NumPy calls it -> the kinds that it takes."""

_CHOICES, _ROWS = (Union, UnionType), (tuple, Sequence)


def with_fields(usual: Any, values: dict[str, Any], name: str) -> Any:
    """A frozen dataclass with other values of some fields, and of this name, if it can have one and they tell none.

    Raises:
        InputError: a value of another type.
        Exception: whatever its class raises, and of fields that are not there.
    """
    named = any(one.name == "name" and one.init and one.type in (str, "str") for one in fields(usual))
    if named and "name" not in values:
        with suppress(Exception):  # of a class that takes no other name
            return _made(type(usual), usual, {"name": name} | values)
    return _made(type(usual), usual, values)


def _made(kind: type, usual: Any, values: dict[str, Any]) -> Any:
    """A record; what is not told is as in the usual one, if that is of this kind, else as its class has it."""
    types, usual = _types(kind), usual if type(usual) is kind else None
    told = {name: _fitting(name, value, types.get(name), getattr(usual, name, None)) for name, value in values.items()}
    change = kind if usual is None else partial(replace, usual) if is_dataclass(kind) else usual._replace
    made = change(**told)
    for name, value in told.items():
        if _is_checked(of := types.get(name)) and not _fits(value, of):
            typed(name, getattr(made, name), of)
    return made


def _fits(value: Any, kind: Any) -> bool:
    with suppress(InputError):
        typed("", value, kind)
        return True
    return False


def _types(kind: type) -> dict[str, Any]:
    """What a class's fields are annotated with, but for names that only type checkers know."""
    types = {}
    if not is_dataclass(kind):
        with suppress(NameError, AttributeError, TypeError, SyntaxError):
            types = get_type_hints(kind)
    for one in fields(kind) if is_dataclass(kind) else ():
        own = (base for base in kind.__mro__[::-1] if vars(base).get("__dataclass_fields__", {}).get(one.name) is one)
        base = next(own, kind)
        alone = type("", (), {"__annotations__": {one.name: one.type}, "__module__": base.__module__})
        module = vars(sys.modules.get(base.__module__, object))
        with suppress(NameError, AttributeError, TypeError, SyntaxError):  # of whatever an annotation says
            types |= get_type_hints(alone, dict(vars(base)), dict(module))
    return types


def _is_checked(kind: Any) -> bool:
    """Whether a type is plain, an enumeration, a record, or a choice or row of such."""
    if (origin := get_origin(kind)) in (*_CHOICES, *_ROWS):
        of = get_args(kind)
        return bool(of) and all(one is Ellipsis or _is_checked(one) for one in of)
    if origin in (Literal, np.ndarray) or kind in (*_PLAIN, NoneType, tuple, list):
        return True
    return isinstance(kind, type) and (issubclass(kind, Enum | PurePath | np.ndarray) or _is_record(kind))


def _is_record(kind: Any) -> bool:
    """Whether a type is a dataclass or a named tuple."""
    return isinstance(kind, type) and (is_dataclass(kind) or (issubclass(kind, tuple) and hasattr(kind, "_fields")))


def _fitting(name: str, value: Any, kind: Any, usual: Any = None) -> Any:
    """What a file tells, as its type has it; of what does not fit a class may make its own, but for plain ones.  What a
    protocol is may be told as the record that is usual."""
    if getattr(kind, "_is_protocol", False) and _is_record(type(usual)):
        kind = type(usual)
    try:
        return value if kind is None else typed(name, value, kind)
    except InputError:
        if kind in _PLAIN:
            raise
    choices = get_args(kind) if get_origin(kind) in _CHOICES else (kind,)
    for one in sorted(choices, key=lambda one: one not in type(usual).__mro__):
        with suppress(*[Exception] if len(choices) > 1 else ()):
            if (made := _as_one(name, value, one, usual)) is not None:
                return made
    return value


def _as_one(name: str, value: Any, kind: Any, usual: Any) -> Any:
    """A member of an enumeration, path, record, row or array, as a file tells them; None where it tells something
    else."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        if isinstance(value, str) and value in kind.__members__:
            return kind[value]
        with suppress(ValueError):
            member = kind(value)
            return member if isinstance(member.value, bool) == isinstance(value, bool) else None
    elif isinstance(kind, type) and issubclass(kind, PurePath):
        return kind(value) if isinstance(value, str) else None
    elif _is_record(kind) and isinstance(value, dict):
        kind = type(usual) if isinstance(usual, kind) else kind
        if value.keys() <= signature(kind).parameters.keys():
            return _made(kind, usual, value)
    elif np.ndarray in (kind, get_origin(kind)) and isinstance(value, list):
        return _as_array(value, kind, usual)
    elif kind is tuple and isinstance(value, list):
        return tuple(value)
    elif get_origin(kind) in _ROWS and isinstance(value, list):
        of = get_args(kind)
        each = of[:1] * len(value) if Ellipsis in of or get_origin(kind) is Sequence else of
        if len(each) == len(value):
            with suppress(InputError):  # the sentence is of the whole row
                return tuple(map(_fitting, repeat(name), value, each))
    return None


def _as_array(value: list[Any], kind: Any, usual: Any) -> np.ndarray | None:
    """An array of numbers, truth values or texts, as it is annotated, or as the usual one where that has floats; None
    of a mixture, of rows of several lengths, and of numbers that the type does not hold."""
    with suppress(ValueError):
        made = np.array(value)
        kinds = {float if type(one) is int else type(one) for one in np.array(value, dtype=object).flat}
        if len(kinds) > 1 or made.dtype.kind not in "biufU":
            return None
        as_usual = isinstance(usual, np.ndarray) and (usual.dtype.kind == "f" or not made.size)
        wanted = _annotated(kind) or (usual.dtype if as_usual else made.dtype)
        if made.size and made.dtype.kind not in _TAKES.get(wanted.kind, wanted.kind):
            return None
        with np.errstate(over="ignore", under="ignore"):
            cast = made.astype(wanted)
        if wanted.kind in "fc":  # may be rounded, but not to zero or infinity
            held = (np.isfinite(cast) == np.isfinite(made)) & ((cast == 0) == (made == 0))
        else:
            held = cast.astype(object) == made.astype(object)
        return cast if held.all() else None
    return None


def _annotated(kind: Any) -> np.dtype | None:
    """The type of an array's elements, as `NDArray[np.float64]` has it; None where it tells no single one."""
    for inner in (one for of in get_args(kind)[1:] for one in get_args(of)):
        one = {np.floating: np.float64, np.inexact: np.float64, np.integer: np.int64}.get(inner, inner)
        if isinstance(one, type) and issubclass(one, np.generic) and not one.__subclasses__():
            return np.dtype(one)
    return None
