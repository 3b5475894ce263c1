"""The six legs: numbering, sides, neighbours (paper, Section 2) and the geometry of Fig. 1.

Index i of every axis `leg` is the paper's leg i + 1: 1 to 3 on the left from front to rear, 4 to 6 on the right.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from hexmj.errors import InputError

LEGS = ("L1", "L2", "L3", "R1", "R2", "R3")
"""Names of the legs by index: side, then segment from front (1) to rear (3)."""

SIDE = (1, 1, 1, -1, -1, -1)
"""Sign of the leg's y coordinate: left is positive."""

MIRROR = (3, 4, 5, 0, 1, 2)
"""Index of the contralateral leg of the same segment."""

N1: tuple[tuple[int, ...], ...] = ((1, 3), (2, 4), (5,), (4, 0), (5, 1), (2,))
"""Mechanism 1 acts on leg ``d`` from the legs ``N1[d]``: ipsilateral rear leg, contralateral leg."""

N2: tuple[tuple[int, ...], ...] = ((1,), (2,), (), (4,), (5,), ())
"""Mechanism 2 acts on leg ``d`` from the legs ``N2[d]``: ipsilateral rear leg."""

N3: tuple[tuple[int, ...], ...] = ((3,), (0, 4), (1, 5), (0,), (3, 1), (4, 2))
"""Mechanism 3 acts on leg ``d`` from the legs ``N3[d]``: ipsilateral anterior leg, contralateral leg."""

N4: tuple[tuple[int, ...], ...] = ((), (0,), (1,), (), (3,), (4,))
"""Mechanism 4 acts on leg ``d`` from the legs ``N4[d]``: ipsilateral anterior leg."""


@dataclass(frozen=True)
class Workspace:
    """Boxes in which the tips of the legs 1, 2, 3 stand and swing, relative to their origins O_i and lines.

    The unit is half of the step range AEP_0 - PEP_0, 10 mm for the stick insect, which reaches each point of its boxes
    on the ground and lifted to the step height (`tests/test_command.py`).
    """

    behind: tuple[float, float, float] = (-2.0, -1.1, -1.1)
    """Rear ends of the boxes."""
    ahead: tuple[float, float, float] = (1.2, 0.9, 0.8)
    """Front ends of the boxes."""
    inner: tuple[float, float, float] = (0.0, -0.2, 0.0)
    """Ends of the boxes toward the body; outside of the line is positive."""
    outer: tuple[float, float, float] = (1.6, 0.9, 1.6)
    """Ends of the boxes away from the body."""


WORKSPACE = Workspace()
"""Workspace of the stick insect."""


@dataclass(frozen=True)
class Geometry:
    """The lines on which the tips move, seen from above (Fig. 1)."""

    origins: tuple[float, float, float] = (28.0, 4.0, -20.0)
    """Origins O_1, O_2, O_3 of the leg axes, ahead of the centre of mass [mm]; inferred from D4, D5, D6 of Fig. 1."""
    lateral: tuple[float, float, float] = (18.0, 20.0, 15.0)
    """Distances of the lines of legs 1, 2, 3 from the body axis [mm]; D1, D2, D3 of Fig. 1."""

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.origins, *self.lateral))) or not min(self.lateral) > 0:
            raise InputError(f"{self}; expected finite origins and lateral distances above 0 mm")

    @cached_property
    def origin(self) -> tuple[float, ...]:
        """Distance of each leg's origin O_i ahead of the centre of mass, (leg,) [mm]."""
        return self.origins * 2

    @cached_property
    def y(self) -> tuple[float, ...]:
        """Distance of each leg's line from the body axis, left positive, (leg,) [mm]."""
        return tuple(side * y for side, y in zip(SIDE, self.lateral * 2, strict=True))


FIG1 = Geometry()
"""Our interpretation of Fig. 1: D4 = O_1 - O_2, D5 = O_2 - O_3, D6 = distance of the centre of mass ahead of O_3."""

CENTRED = Geometry(origins=(24.0, 0.0, -24.0))
"""Another interpretation of Fig. 1: centre of mass above O_2, D6 = step range; it fits the paper almost as well."""

GEOMETRIES = {"fig1": FIG1, "centred": CENTRED}
