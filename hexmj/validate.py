"""Checks of arguments: each returns the value, or raises `InputError` with the argument's name and value."""

import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from hexmj.errors import InputError

Choice = TypeVar("Choice", bound=str)


def number(name: str, value: Any, least: float = -math.inf, most: float = math.inf, above: bool = False) -> float:
    """Return a number as a float if it lies in [least, most]; with `above`, in (least, most]."""
    if not isinstance(value, Real) or isinstance(value, bool) or not least <= float(value) <= most:
        raise InputError(f"{name} = {short(value)}; expected a number{_range(least, most)}")
    if above and value <= least:
        raise InputError(f"{name} = {short(value)}; expected a number above {least:g}")
    return float(value) + 0.0  # -0.0 becomes 0.0


def whole(name: str, value: Any, least: int, most: float = math.inf) -> int:
    """Return a whole number if it lies in [least, most]."""
    if not isinstance(value, Integral) or isinstance(value, bool) or not least <= int(value) <= most:
        raise InputError(f"{name} = {short(value)}; expected a whole number{_range(least, most)}")
    return int(value)


def choice(name: str, value: Choice, valid: Iterable[str]) -> Choice:
    """Return a name if it is one of the valid names."""
    if not isinstance(value, str) or value not in valid:
        raise InputError(f"{name} = {short(value)}; valid names: {', '.join(valid)}")
    return value


def distinct(name: str, values: Sequence[Any]) -> None:
    """Raise InputError unless there is at least one value and no value repeats."""
    if len(values) == 0 or len(set(values)) < len(values):
        raise InputError(f"{name} = {short(list(values))}; expected one or more distinct values")


def numbers(name: str, values: ArrayLike) -> np.ndarray:
    """Return a new array of floats; it keeps the memory layout of the values, on which the bits of sums depend."""
    try:
        return np.array(values, dtype=float)
    except (ValueError, TypeError):
        raise InputError(f"{name} = {short(values)}; expected numbers") from None


def leg_last(values: Any) -> Any:
    """Return a DataArray with its dimension `leg` moved to the end; return other values as they are."""
    return values.transpose(..., "leg") if "leg" in getattr(values, "dims", ()) else values


def states(name: str, values: ArrayLike) -> np.ndarray:
    """Return a new array of booleans from booleans or from the integers 0 and 1."""
    array = np.asarray(values)
    if array.dtype.kind == "b" or (array.dtype.kind in "iu" and np.isin(array, (0, 1)).all()):
        return np.array(array, dtype=bool, order="C")
    raise InputError(f"{name} = {short(values)}; expected only True or False")


def short(value: Any) -> str:
    """Return the first 80 characters of a value's repr, on one line."""
    return f"{' '.join(repr(value).split()):.80}"


def _range(least: float, most: float) -> str:
    if least == -math.inf and most == math.inf:
        return ""
    return f" of at least {least:g}" + (f" and at most {most:g}" if most < math.inf else "")
