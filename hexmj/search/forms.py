"""Forms of the model whose parameters a search can choose, as vectors.

Appendix A makes all legs of a side alike: nine numbers, or ten.  In the form 'mirrored' only the two sides are alike,
and each leg's neighbours have weights of their own: 29 of the 58 general weights of Section 2.  In the form 'general'
all 58 are free.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from hexmj.legs import MIRROR
from hexmj.parameters import BINARY, NEIGHBOURS, Model, Symmetric, Weights, weights

Form = Literal["hws", "ldvs", "mirrored", "general"]
"""Names of the forms."""

_NEUTRAL = ("p31", "p34")
_ALL = [(kind, d, e) for kind, neighbours in NEIGHBOURS.items() for d in range(6) for e in neighbours[d]]
_LEFT = [(kind, d, e) for kind, d, e in _ALL if d < 3]


@dataclass(frozen=True)
class Parameters:
    """What a form's vector means."""

    names: tuple[str, ...]
    """In the order of the vector; of general weights with destination and source leg."""
    model: Callable[[np.ndarray], Model]
    """From a vector, (parameter,)."""
    vector: Callable[[Model], np.ndarray]
    """The parameters of a model of another form too, for comparison, (parameter,)."""

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) P^2 and P^4."""
        return np.array([name.startswith(BINARY) for name in self.names])

    @property
    def neutral(self) -> np.ndarray:
        """(parameter,) neutral positions and their change with velocity [mm]."""
        return np.array([name.startswith(_NEUTRAL) for name in self.names])


def _symmetric(size: Literal[9, 10]) -> Parameters:
    names = [f.name for f in fields(Symmetric) if f.name != "p34_i" or size == 10]

    def vector(model: Model) -> np.ndarray:
        return np.array([getattr(model, name, np.nan) for name in names])

    return Parameters(tuple(names), Symmetric.from_vector, vector)


def _names(places: list[tuple[str, int, int]]) -> tuple[str, ...]:
    return tuple(f"{kind} {d + 1},{e + 1}" for kind, d, e in places)


def _mirrored(vector: np.ndarray) -> Weights:
    matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
    for (kind, d, e), value in zip(_LEFT, vector, strict=True):
        matrices[kind][d, e] = matrices[kind][MIRROR[d], MIRROR[e]] = value
    return Weights(**matrices)


def _left(model: Model) -> np.ndarray:
    general = weights(model)
    return np.array([getattr(general, kind)[d, e] for kind, d, e in _LEFT])


FORMS: dict[Form, Parameters] = {
    "hws": _symmetric(9),
    "ldvs": _symmetric(10),
    "mirrored": Parameters(_names(_LEFT), _mirrored, _left),
    "general": Parameters(_names(_ALL), Weights.from_vector, lambda model: weights(model).to_vector()),
}
"""Forms by their names."""
