"""Coupling weights of the 1998 network (paper, Section 2 and Appendix A), in general and symmetric form.

Names follow the paper: ``p1``, ``p2`` and ``p4`` are P^1, P^2 and P^4, ``p31`` ... ``p34`` are
P^{3,1} ... P^{3,4}; the suffix ``_i`` means ipsilateral, ``_c`` contralateral.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np

from hexmj.errors import InputError
from hexmj.legs import LEGS, N1, N2, N3, N4
from hexmj.validate import number, numbers

NEIGHBOURS = {"p1": N1, "p2": N2, "p31": N3, "p32": N3, "p33": N3, "p34": N3, "p4": N4}
"""Kind of weight -> for each destination leg, the source legs that act on it."""

BINARY = ("p2", "p4")
"""Kinds of weights that are either 0 or 1."""

PLACES = {
    f"{kind} {d + 1},{e + 1}": (kind, (d, e))
    for kind, table in NEIGHBOURS.items()
    for d, sources in enumerate(table)
    for e in sources
}
"""Name of each of the 58 general weights, such as ``p1 1,2`` -> kind, and indices of destination and source leg."""


@dataclass(frozen=True, eq=False)
class Weights:
    """General weights P_{d,e} of each destination leg d and source leg e: 58 numbers, or 48 if p34 = 0.

    Every field is an array (destination leg, source leg), which is zero where the source is not in the
    paper's neighbour set N^1 ... N^4 of the destination.
    """

    p1: np.ndarray
    """Mechanism 1: shift of the destination's PEP to the rear while the source leg protracts [mm]."""
    p2: np.ndarray
    """Mechanism 2: off (0) or on (1)."""
    p31: np.ndarray
    """Mechanism 3: neutral position of the source leg at V_r = 0 [mm]."""
    p32: np.ndarray
    """Mechanism 3: weight while the source leg is behind its neutral position."""
    p33: np.ndarray
    """Mechanism 3: weight while the source leg is ahead of its neutral position."""
    p34: np.ndarray
    """Mechanism 3: shift of the source leg's neutral position at V_r = 1, in proportion to V_r [mm]."""
    p4: np.ndarray
    """Mechanism 4: off (0) or on (1)."""

    def __post_init__(self) -> None:
        for kind in NEIGHBOURS:
            matrix = numbers(kind, getattr(self, kind))
            if matrix.shape != (6, 6) or not np.isfinite(matrix).all():
                raise InputError(f"{kind}: weights of the shape {matrix.shape}; expected 6 x 6 finite numbers")
            for d, e in np.argwhere(matrix):
                if e not in NEIGHBOURS[kind][d]:
                    raise InputError(f"{kind} from {LEGS[e]} to {LEGS[d]} = {matrix[d, e]:g}; expected 0 for this pair")
            if kind in BINARY and not np.isin(matrix, (0.0, 1.0)).all():
                raise InputError(f"{kind} has a weight other than 0 and 1; expected only 0 (off) or 1 (on)")
            matrix.setflags(write=False)
            object.__setattr__(self, kind, matrix)

    @classmethod
    def of(cls, numbers: Mapping[tuple[str, tuple[int, int]], float]) -> "Weights":
        """Return weights from (kind, (destination, source)) -> number, with legs from 0 to 5; missing weights are 0."""
        matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
        for (kind, pair), value in numbers.items():
            matrices[kind][pair] = number(f"{kind} {pair}", value)
        return cls(**matrices)

    def to_vector(self) -> np.ndarray:
        """Return the 58 weights in the order of `PLACES`."""
        return np.array([getattr(self, kind)[pair] for kind, pair in PLACES.values()])


@dataclass(frozen=True)
class Symmetric:
    """Weights with the symmetries of Appendix A: ten numbers (LDVS), nine where p34_i = 0 (HWS)."""

    p1_i: float = 0.0
    """P_i^1: shift of the PEP to the rear while the ipsilateral rear leg protracts [mm]."""
    p1_c: float = 0.0
    """P_c^1: shift of the PEP to the rear while the contralateral leg protracts [mm]."""
    p2: float = 0.0
    """P^2: mechanism 2 off (0) or on (1)."""
    p31_i: float = 0.0
    """P_i^{3,1}: neutral position of the ipsilateral anterior leg at V_r = 0 [mm]."""
    p32_i: float = 0.0
    """P_i^{3,2}: weight of mechanism 3 while the ipsilateral anterior leg is behind its neutral position."""
    p33_i: float = 0.0
    """P_i^{3,3}: weight of mechanism 3 while the ipsilateral anterior leg is ahead of its neutral position."""
    p34_i: float = 0.0
    """P_i^{3,4}: shift of the ipsilateral anterior leg's neutral position at V_r = 1, in proportion to V_r [mm]."""
    p31_c: float = 0.0
    """P_c^{3,1}: neutral position of the contralateral leg [mm]."""
    p32_c: float = 0.0
    """P_c^{3,2} = P_c^{3,3}: weight of mechanism 3 from the contralateral leg."""
    p4_i: float = 0.0
    """P_i^4: mechanism 4 off (0) or on (1)."""

    def __post_init__(self) -> None:
        for key, value in asdict(self).items():
            if not math.isfinite(number(key, value)) or (key.startswith(BINARY) and value not in (0, 1)):
                allowed = "0 or 1, as in the paper" if key.startswith(BINARY) else "a finite number"
                raise InputError(f"{key} = {value}; expected {allowed}")
            object.__setattr__(self, key, float(value))

    def expand(self) -> Weights:
        """Return the general weights that Appendix A derives: equal on both sides and along each side."""
        sides = {  # ipsilateral, contralateral
            "p1": (self.p1_i, self.p1_c),
            "p2": (self.p2, 0.0),
            "p31": (self.p31_i, self.p31_c),
            "p32": (self.p32_i, self.p32_c),
            "p33": (self.p33_i, self.p32_c),
            "p34": (self.p34_i, 0.0),
            "p4": (self.p4_i, 0.0),
        }
        return Weights.of({(kind, (d, e)): sides[kind][abs(d - e) == 3] for kind, (d, e) in PLACES.values()})


AnyWeights = Symmetric | Weights


@lru_cache(maxsize=64)
def general(weights: AnyWeights) -> Weights:
    """Return the weights in general form; symmetric weights are expanded."""
    return weights.expand() if isinstance(weights, Symmetric) else weights
