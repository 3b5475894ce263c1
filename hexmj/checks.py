"""Whether a value is of the type that was asked for; if not, one sentence names it, shows it and says what is expected.

NumPy's scalars are taken for the Python numbers that they are; True and False are no numbers.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from enum import EnumType
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError

Of = TypeVar("Of")

LABEL = 200
"""Characters of the longest name."""

NO_ARRAY = ValueError, TypeError, RuntimeError, AttributeError
"""What objects raise that are asked for an array and cannot be one, as a dataset or a tensor with gradients."""

TILDE = "expected the path of the folder for which ~ stands: only shells put it there, in front of a word"
"""What is said of a path that begins with ~."""

_NAMES = {
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "a text",
    NoneType: "None",
    np.ndarray: "an array",
    Callable: "a function",
    Mapping: "a dict",
}
"""What is expected, by type; of any other class one of its objects."""


def typed(name: str, value: Any, wanted: Any) -> Any:
    """A value if it is of an annotated type: a class, a union, names (`Literal`) or a tuple.

    Raises:
        InputError: it is not.
    """
    try:
        return _fitted(value, wanted)
    except TypeError:
        names = _names(wanted)
        expected = f"valid names: {', '.join(names)}" if names else f"expected {_kind(wanted)}"
        raise InputError(f"{name} = {short(value)}; {expected}") from None


def given(name: str, value: Of | None, usual: Callable[[], Of]) -> Of:
    """What was given, an object of the class `usual`, or a usual one where nothing was.

    Raises:
        InputError: something else was given.
    """
    return usual() if value is None else typed(name, value, usual)


def whole(name: str, value: Any, least: int, most: float = math.inf, more: str = "") -> int:
    """A whole number within bounds; `more` is said of them, too.

    Raises:
        InputError: it is none.
    """
    with suppress(TypeError):
        if least <= (number := _fitted(value, int)) <= most:
            return number
    bounds = f"at least {least}" + (f" and at most {most}" if most < math.inf else "")
    raise InputError(f"{name} = {short(value)}; expected a whole number of {bounds}{more}")


def numbers(name: str, values: ArrayLike) -> np.ndarray:
    """A new array of real numbers, laid out in memory as they are: the order of sums is part of the bits.

    Raises:
        InputError: values that are none, some that are masked, or rows of different lengths.
    """
    with suppress(*NO_ARRAY):
        array = np.asarray(values)
        if (array.dtype.kind in "iuf" or not array.size) and not np.ma.is_masked(values):
            return np.array(array, dtype=float)
    raise InputError(f"{name} = {short(values)}; expected numbers")


def path_of(path: Path | str) -> Path:
    """A path as the system takes it.

    Raises:
        InputError: it is none.
    """
    if "\0" in str(typed("path", path, Path | str)):
        raise InputError(f"path = {str(path)!r:.80}; expected one without a null character")
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        raise InputError(f"path = {str(path)!r:.80}; expected characters that names of files can have") from None
    if stands_for_home(path):
        raise InputError(f"path = {str(path)!r:.80}; {TILDE}")
    if path == "":
        raise InputError("path = ''; expected a name, or '.' for the current folder")
    return Path(path)


def stands_for_home(path: Path | str) -> bool:
    """Whether a path begins with ~ or ~name as shells expand it, but none has."""
    first = os.fspath(path).partition("/")[0]
    return first == "~" or os.path.expanduser(first) != first


def printable(name: str, value: Any) -> str:
    """A short text of one line, fit to be shown and to stand in the name of a file.

    Raises:
        InputError: it is none.
    """
    if not (0 < len(typed(name, value, str)) <= LABEL and value.isprintable()):
        raise InputError(f"{name} = {short(value)}; expected 1 to {LABEL} printable characters")
    return value


def states(name: str, values: ArrayLike) -> np.ndarray:
    """A new array of booleans, which may be given as 0 and 1.

    Raises:
        InputError: values that are none, or some that are masked.
    """
    with suppress(*NO_ARRAY):
        array = np.asarray(values)
        known = array.dtype.kind == "b" or (array.dtype.kind in "iu" and np.isin(array, (0, 1)).all())
        if known and not np.ma.is_masked(values):
            return np.array(array, dtype=bool, order="C")
    raise InputError(f"{name} = {short(values)}; expected True and False")


def check_types(thing: Any) -> None:
    """Refuse a frozen dataclass with a field that is not of the type it is annotated with; its `__post_init__`.

    Raises:
        InputError: such a field.
    """
    for name, wanted in _annotations(type(thing)).items():
        object.__setattr__(thing, name, typed(name, getattr(thing, name), wanted))


@cache
def _annotations(of: type) -> dict[str, Any]:
    hints = get_type_hints(of)
    return {one.name: hints[one.name] for one in fields(of)}


def _fitted(value: Any, wanted: Any) -> Any:
    """The value as its type has it; a TypeError where it is of another."""
    if type(value) is wanted and wanted is not float:
        return value
    origin, inner = get_origin(wanted), get_args(wanted)
    if origin in (Union, UnionType):
        for one in inner:
            with suppress(TypeError):
                return _fitted(value, one)
        raise TypeError
    if origin in (tuple, Sequence):
        if isinstance(value, list | tuple | range) or getattr(value, "ndim", 0):
            kinds = inner[:1] * len(value) if _is_of_any_length(wanted) else inner
            if len(kinds) == len(value):
                itself = isinstance(value, list | tuple | range | np.ndarray)
                values = value if itself else getattr(value, "values", value)  # a DataArray's own are DataArrays
                return tuple(_fitted(one, kind) for one, kind in zip(values, kinds, strict=True))
    elif wanted in (int, float):
        if isinstance(value, Integral if wanted is int else Real) and not isinstance(value, bool | np.timedelta64):
            with suppress(OverflowError):  # a whole number beyond all floats stays what it is
                number: Any = value
                return wanted(number) + 0  # and -0.0 is 0.0
            return value
    elif origin is Literal:
        for one in inner if isinstance(value, str | int) else ():
            if one == value and isinstance(one, bool) == isinstance(value, bool):
                return one
    elif getattr(wanted, "_is_protocol", False) or wanted is Any:
        return value  # looked at where it is used
    elif wanted is str and isinstance(value, np.str_):
        return str(value)
    elif isinstance(value, origin or wanted) and not (origin is Callable and isinstance(value, type)):
        return value
    elif wanted is bool and isinstance(value, np.bool_):
        return bool(value)
    raise TypeError


def _is_of_any_length(wanted: Any) -> bool:
    return get_origin(wanted) is Sequence or Ellipsis in get_args(wanted)


def _names(wanted: Any) -> list[str]:
    """Of a `Literal` or an enumeration; none of anything else."""
    if get_origin(wanted) is Literal:
        return [str(one) for one in get_args(wanted)]
    return list(wanted.__members__) if isinstance(wanted, EnumType) else []


def _kind(wanted: Any) -> str:
    origin, inner = get_origin(wanted), get_args(wanted)
    if names := _names(wanted):
        return f"one of {', '.join(names)}"
    if origin in (tuple, Sequence):
        count = "some" if _is_of_any_length(wanted) else len(inner)
        kinds = [_kind(one) for one in inner if one is not Ellipsis]
        return f"{count} values" + (f", each {kinds[0]}" if len({*kinds}) == 1 else f": {', '.join(kinds)}")
    if origin in (Union, UnionType):
        return " or ".join(map(_kind, inner))
    name = (origin or wanted).__name__
    return _NAMES.get(origin or wanted, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")


def short(value: Any) -> str:
    """A value as sentences show it: on one line, its beginning."""
    return f"{' '.join(repr(value).split()):.80}"
