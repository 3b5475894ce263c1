"""Labels of xarray, pandas or another table along the axes of values that are read by their places."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexmj.checks import numbers
from hexmj.errors import InputError


def labels_of(values: Any) -> list[list[Any]]:
    """What labels each axis of values; nothing for those without labels."""
    if hasattr(values, "iloc"):
        return [[*axis] for axis in values.axes]
    columns = getattr(values, "columns", ())  # of a table that has no index, as polars' tables
    return [[*axis] for axis in (*getattr(values, "indexes", {}).values(), columns)]


def check_labels(values: Any, names: Sequence[str], name: str) -> None:
    """Refuse values of which an axis is labelled by some of these names, and not by all of them in order.

    Raises:
        InputError: they are such.
    """
    for labels in labels_of(values):
        if labels != [*names] and not {*map(str, labels)}.isdisjoint(names):
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
