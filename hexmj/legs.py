"""The six legs: numbering, sides, neighbours (paper, Section 2) and Fig. 1's geometry.

The only place that knows which leg is which.  Index ``i`` of every ``leg`` axis is the
paper's leg ``i + 1``: 1-3 on the left from front to rear, 4-6 on the right.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from hexmj.checks import check_types
from hexmj.errors import InputError
from hexmj.labels import columns_of, falling, labels_of, rows_of

LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")
"""Names by index: side, then segment from front (1) to rear (3)."""

SIDE = (1, 1, 1, -1, -1, -1)
"""Sign of the leg's y coordinate: left is positive."""

MIRROR = (3, 4, 5, 0, 1, 2)
"""Index of the contralateral leg of the same segment."""

N1: tuple[tuple[int, ...], ...] = ((1, 3), (2, 4), (5,), (4, 0), (5, 1), (2,))
"""Mechanism 1 acts on leg ``d`` from the legs ``N1[d]``: ipsilateral rear, contralateral."""

N2: tuple[tuple[int, ...], ...] = ((1,), (2,), (), (4,), (5,), ())
"""Mechanism 2: ipsilateral rear leg."""

N3: tuple[tuple[int, ...], ...] = ((3,), (0, 4), (1, 5), (0,), (3, 1), (4, 2))
"""Mechanism 3: ipsilateral anterior leg, contralateral."""

N4: tuple[tuple[int, ...], ...] = ((), (0,), (1,), (), (3,), (4,))
"""Mechanism 4: ipsilateral anterior leg."""


@dataclass(frozen=True)
class Geometry:
    """The lines on which the tips move, seen from above (Fig. 1)."""

    origins: tuple[float, float, float] = (28.0, 4.0, -20.0)
    """Origins O_1, O_2, O_3 of the leg axes ahead of the centre of mass [mm]; inferred from Fig. 1's D4, D5, D6."""
    lateral: tuple[float, float, float] = (18.0, 20.0, 15.0)
    """Distance of the lines of legs 1, 2, 3 from the body axis [mm]; Fig. 1's D1, D2, D3."""

    def __post_init__(self) -> None:
        check_types(self)
        if not all(map(math.isfinite, self.origins + self.lateral)) or not min(self.lateral) > 0:
            raise InputError(f"{self}; expected finite origins and lateral distances above 0 mm")

    @property
    def origin(self) -> tuple[float, ...]:
        """Origin O_i of each leg's axis ahead of the centre of mass, (leg,) [mm]."""
        return self.origins * 2

    @property
    def y(self) -> tuple[float, ...]:
        """Signed distance of each leg's line from the body axis, (leg,) [mm]."""
        return tuple(side * y for side, y in zip(SIDE, self.lateral * 2, strict=True))


FIG1 = Geometry()
"""Our reading of Fig. 1: D4 = O_1 - O_2, D5 = O_2 - O_3, D6 = centre of mass ahead of O_3."""

CENTRED = Geometry(origins=(24.0, 0.0, -24.0))
"""The other reading: centre of mass above O_2, D6 = step range.  Fits the paper almost as well."""

GEOMETRIES = {"fig1": FIG1, "centred": CENTRED}


def in_order(values: Any, name: str = "starts", behind: int = 0) -> Any:
    """Values as (..., leg), see `ordered`."""
    return ordered(values, name, behind)[0]


def ordered(values: Any, name: str, behind: int = 0) -> tuple[Any, list[str]]:
    """Values as (..., leg), the legs as `LEGS` has them where xarray or pandas labels them, but by rising numbers; and
    which legs these are, where labels tell.

    Args:
        values: of legs, or of some of them; an axis `leg`, or one that has all labels, may stand anywhere, the others
            in their order.
        name: of the values, for sentences.
        behind: how many axes come after that of the legs.

    Raises:
        InputError: labels of other legs, of one twice, or that could be of two axes.
    """
    rows = rows_of(values)
    if any(hasattr(one, "iloc") or _is_of_xarray(one) or columns_of(one) for one in rows):
        return [in_order(one, name, behind) for one in rows], []
    labels = [] if behind else columns_of(values)
    if hasattr(values, "iloc") and values.ndim > behind:  # of pandas
        on_its_side = not behind and values.ndim == 2 and _name_legs(values.index) and not _name_legs(labels)
        values = values.T if on_its_side and len(values) == len(LEGS) else values
        labels = [*values.axes[-1 - behind]]
    elif _is_of_xarray(values) and len(values.dims) > behind:
        values, labels = _of_xarray(values, name, behind)
    numbered = all(isinstance(one, Integral) for one in labels) and labels == sorted({*labels})
    if numbered or hasattr(values, "data_vars") or np.ndim(values) <= behind:
        return values, []
    legs = [leg for leg in LEGS if leg in labels]
    if len(legs) != len(labels):
        raise InputError(f"{name} of the legs {', '.join(map(str, labels)):.80}; expected {', '.join(LEGS)}")
    return np.take(np.asarray(values), [labels.index(leg) for leg in legs], axis=-1 - behind), legs


def check_order(values: Any, name: str) -> None:
    """Refuse values of which xarray or pandas labels an axis by legs, but in another order than `LEGS`, or by numbers
    that do not rise.

    Raises:
        InputError: they are such.
    """
    for labels in labels_of(values):
        if falling(labels) or (_name_legs(labels) and labels != [*LEGS]):
            raise InputError(
                f"{name} of the legs {', '.join(map(str, labels)):.80}; expected {', '.join(LEGS)}, in order"
            )


def _is_of_xarray(values: Any) -> bool:
    return hasattr(values, "dims") and hasattr(values, "sizes")


def _of_xarray(values: Any, name: str, behind: int) -> tuple[Any, list[Any]]:
    """Values, their axis of the legs where it is expected, and its labels: its own, or the only others with a leg's
    name.

    Raises:
        InputError: labels that could be of two axes, or several along one.
    """
    single = {name: one for name, one in getattr(values, "coords", {}).items() if len(one.dims) == 1}
    whole = [axis for axis in values.dims if axis in single and {*map(str, single[axis].values)} == {*LEGS}]
    axis = "leg" if "leg" in values.dims else whole[0] if len(whole) == 1 else [*values.dims][-1 - behind]
    if "leg" in single:
        axis = single["leg"].dims[0]
    others = [one for one in values.dims if one != axis]
    values = values.transpose(*others[: len(others) - behind], axis, *others[len(others) - behind :])
    named = {key: one for key, one in single.items() if _name_legs(one.values)}
    beside = [one.values for one in named.values() if one.dims == (axis,)]
    own = [single["leg"].values] if "leg" in single else [named[axis].values] if axis in named else []
    elsewhere = [one for one in named.values() if one.dims != (axis,) and len(one) == len(LEGS) == values.sizes[axis]]
    if not own and (len(beside) > 1 or (elsewhere and not beside and axis != "leg")):
        raise InputError(f"{name} have several labels of legs, or none along {axis}; expected those of an axis leg")
    return values, [label for labels in own or beside for label in labels]


def _name_legs(labels: Iterable[Any]) -> bool:
    """Whether one of some labels is a leg's name, if only in small letters."""
    return not {str(one).upper() for one in labels}.isdisjoint(LEGS)
