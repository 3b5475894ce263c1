"""Forms of the 1998 network's weights.

Appendix A makes all legs of a side alike: nine numbers, or ten.  In the form 'mirrored' only the two sides are alike,
and each leg's neighbours have weights of their own: 29 of the 58 general weights of Section 2.  In the form 'general'
all 58 are free.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np

from hexmj.checks import check_types
from hexmj.controllers.cruse1998 import Cruse1998, Order
from hexmj.controllers.cruse1998.model_variants import ModelVariant, in_words
from hexmj.controllers.cruse1998.weights import (
    BINARY,
    NEIGHBOURS,
    AnyWeights,
    Symmetric,
    Weights,
    general,
    names_of,
    pairs,
)
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.labels import vector_of
from hexmj.legs import MIRROR

FormName = Literal["hws", "ldvs", "mirrored", "general"]

_ALL = [(kind, pair) for kind in NEIGHBOURS for pair in pairs(kind)]
_LEFT = [(kind, pair) for kind, pair in _ALL if pair[0] < 3]


@dataclass(frozen=True)
class Parameters:
    """What a form's vector means."""

    names: tuple[str, ...]
    """In the order of the vector; of general weights with destination and source leg."""
    weights: Callable[[np.ndarray], AnyWeights]
    """From a vector, (parameter,)."""
    vector: Callable[[AnyWeights], np.ndarray]
    """The parameters of weights of another form too, for comparison; NaN where those have none of a name."""


def _symmetric(size: Literal[9, 10]) -> Parameters:
    names = [f.name for f in fields(Symmetric) if f.name != "p34_i" or size == 10]

    def vector(weights: AnyWeights) -> np.ndarray:
        known = isinstance(weights, Symmetric)
        return np.array([getattr(weights, name) if known else np.nan for name in names])

    return Parameters(tuple(names), Symmetric.from_vector, vector)


def _mirrored(vector: np.ndarray) -> Weights:
    matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
    for (kind, (d, e)), value in zip(_LEFT, vector, strict=True):
        matrices[kind][d, e] = matrices[kind][MIRROR[d], MIRROR[e]] = value
    return Weights(**matrices)


def _left(weights: AnyWeights) -> np.ndarray:
    every = general(weights)
    return np.array([getattr(every, kind)[pair] for kind, pair in _LEFT])


FORMS: dict[FormName, Parameters] = {
    "hws": _symmetric(9),
    "ldvs": _symmetric(10),
    "mirrored": Parameters(names_of(_LEFT), _mirrored, _left),
    "general": Parameters(names_of(_ALL), Weights.from_vector, lambda weights: general(weights).to_vector()),
}
"""Forms by their names."""


def _holds(form: FormName, weights: AnyWeights) -> bool:
    """Whether a form's parameters are all that weights are made of."""
    vector = FORMS[form].vector(weights)
    if not np.isfinite(vector).all():
        return False
    return np.array_equal(general(FORMS[form].weights(vector)).to_vector(), general(weights).to_vector())


@dataclass(frozen=True)
class NetworkForm:
    """Weights of the 1998 network, with its order of updates."""

    name: FormName = "ldvs"
    """Which weights are free."""
    order: Order = "printed"
    """See `Cruse1998.order`."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """See `Cruse1998.model_variant`."""

    __post_init__ = check_types

    @property
    def names(self) -> tuple[str, ...]:
        """See `forms.Form.names`."""
        return FORMS[self.name].names

    @property
    def binary(self) -> np.ndarray:
        """P^2 and P^4."""
        return np.array([name.startswith(BINARY) for name in self.names])

    @property
    def begin(self) -> None:
        """The paper's '0'-individual, or the middle of the box."""
        return None

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Not printed in the paper: -reach to reach for the neutral positions and their change with velocity [mm], 0 to
        reach for shifts [mm] and weights (the signs of the printed sets), 0 to 1 for the binary ones."""
        neutral = np.array([name.startswith(("p31", "p34")) for name in self.names])
        return np.where(neutral, -reach, 0.0), np.where(self.binary, 1.0, reach)

    def controller(self, vector: np.ndarray) -> Cruse1998:
        """See `forms.Form.controller`."""
        weights = FORMS[self.name].weights(vector_of(vector, self.names, "parameters"))
        return Cruse1998(weights, self.order, model_variant=self.model_variant)

    def vector(self, controller: Controller) -> np.ndarray:
        """See `forms.Form.vector`."""
        check_controller_type(controller)
        if type(controller) is not Cruse1998:
            raise InputError(f"{controller.name} is not made of weights alone; expected a set of the 1998 network")
        rules = [(one.order, in_words(one.model_variant)) for one in (controller, self)]
        for rule, own, wanted in zip(("order", "model_variant"), *rules, strict=True):
            if own not in (wanted, "printed"):
                told = f"{rule} = {own}; expected {wanted}, as of what is searched"
                raise InputError(f"{controller.name} to begin with has {told}")
        if not _holds(self.name, controller.weights):
            others = ", ".join(name for name in FORMS if _holds(name, controller.weights))
            told = f"the form {self.name} lacks; expected a set of it; forms that have them: {others}"
            raise InputError(f"{controller.name} has weights that {told}")
        return FORMS[self.name].vector(controller.weights)
