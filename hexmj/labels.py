"""Labels of xarray, pandas or another table along the axes of values that are read by their places."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from numbers import Integral
from typing import Any

import numpy as np

from hexmj.checks import numbers
from hexmj.errors import InputError


def labels_of(values: Any) -> list[list[Any]]:
    """What labels each axis of values, in order; nothing for an axis without labels."""
    if hasattr(values, "iloc"):
        return [[*axis] for axis in values.axes]
    if hasattr(values, "dims") and hasattr(values, "indexes"):  # of xarray
        along = {values[name].dims[0]: [*labels] for name, labels in values.indexes.items()}
        return [along.get(axis, []) for axis in values.dims]
    return [[], columns_of(values)]


def columns_of(values: Any) -> list[Any]:
    """Names of a table's columns, of one without an index, too, as of polars, or of a named row's numbers, of which
    `_0`, `_1`, ... tell only places; nothing for other values."""
    names = getattr(values, "_fields", ()) if isinstance(values, tuple) else ()
    if names and all(map(_is_single, values)):
        return [int(name[1:]) if name[0] == "_" and name[1:].isdecimal() else name for name in names]
    columns = getattr(values, "columns", ())
    return [*columns] if isinstance(columns, Iterable) else []


def _is_single(value: Any) -> bool:
    with suppress(ValueError):  # of rows of different lengths
        return np.ndim(value) == 0
    return False


def rows_of(values: Any) -> Sequence[Any]:
    """The values of a list, tuple or the like, each of which may have labels of its own; nothing for other values, nor
    for a memoryview, which Python calls a sequence whatever its axes."""
    return values if isinstance(values, Sequence) and not isinstance(values, memoryview) else ()


def falling(labels: Sequence[Any]) -> bool:
    """Whether labels are whole numbers that do not rise."""
    return all(isinstance(one, Integral) for one in labels) and list(labels) != sorted({*labels})


def check_labels(values: Any, names: Sequence[str], name: str) -> None:
    """Refuse values, (..., parameter), of which an axis is labelled by some of these names, unless the last one is by
    all of them in order; or the last one by numbers that do not rise.

    Raises:
        InputError: they are such.
    """
    for one in (values, *rows_of(values)):
        *others, last = labels_of(one) or [[]]
        for labels in (*others, last):
            named = not {*map(str, labels)}.isdisjoint(names)
            if (named and (labels is not last or labels != [*names])) or (labels is last and falling(labels)):
                raise InputError(
                    f"{name} of {', '.join(map(str, labels)):.80}; expected {', '.join(names):.200}, in this order"
                )


def vector_of(values: Any, names: Sequence[str], name: str) -> np.ndarray:
    """Numbers, one for each of these names, (parameter,); labels, if there are any, are the names in order.

    Raises:
        InputError: other labels, or other values.
    """
    check_labels(values, names, name)
    if (vector := numbers(name, values)).shape != (len(names),):
        raise InputError(f"{name} of the shape {vector.shape}; expected {len(names)}: {', '.join(names):.200}")
    return vector
