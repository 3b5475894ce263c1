"""Forms: which numbers of a controller a search chooses, as a vector.

A form of the 1998 network has nine or ten numbers if all legs of a side are alike (Appendix A), 29 if only the two
sides are alike (half of the 58 general weights of Section 2), or all 58. Of other controllers float fields are free.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hexmj.controllers.cruse1998 import Cruse1998, ModelVariant, Order
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
from hexmj.controllers.registry import PART, load_controller, parameter_file
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.plain import plain
from hexmj.validate import choice, numbers

FormName = Literal["hws", "ldvs", "mirrored", "general"]

_ALL = [(kind, pair) for kind in NEIGHBOURS for pair in pairs(kind)]
_LEFT = [(kind, pair) for kind, pair in _ALL if pair[0] < 3]


@runtime_checkable
class Form(Protocol):
    """A frozen dataclass that turns vectors into controllers."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the vector."""
        ...

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) which are 0 or 1."""
        ...

    @property
    def begin(self) -> np.ndarray | None:
        """(parameter,) vector from which a search begins by default; None leaves it to the algorithm."""
        ...

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return least and greatest values of the first population, (parameter,) each.

        At a reach of 1 the greater magnitude of the two is the unit of a parameter.
        """
        ...

    def controller(self, vector: np.ndarray) -> Controller:
        """Return the controller of a vector, (parameter,)."""
        ...

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the parameters of a controller, (parameter,).

        Raises:
            InputError: the controller does not have this form.
        """
        ...


@dataclass(frozen=True)
class FieldsForm:
    """The fields of a controller that are annotated as float; the other fields keep their values."""

    usual: Controller
    """The controller with its usual values, from which the search begins."""
    name: str = ""
    """Name by which `load_controller` finds the controller, for the file of what a search finds; by default the module
    and the class."""

    def __post_init__(self) -> None:
        check_controller_type(self.usual)
        if not self.names:
            raise InputError(f"{self.usual.name} has no field of the type float, which could be searched")
        if not self.name:
            kind = type(self.usual)
            object.__setattr__(self, "name", f"{kind.__module__}:{kind.__qualname__}")

    @property
    def names(self) -> tuple[str, ...]:
        """See `Form.names`."""
        controller: Any = self.usual
        return tuple(one.name for one in fields(controller) if one.init and one.type in (float, "float"))

    @property
    def binary(self) -> np.ndarray:
        """See `Form.binary`; no field is."""
        return np.zeros(len(self.names), dtype=bool)

    @property
    def begin(self) -> np.ndarray:
        """The usual values."""
        return self.vector(self.usual)

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return 0 and `reach` times the usual value, or 0 and `reach` if that is 0."""
        ends = reach * np.where(self.begin == 0, 1.0, self.begin)
        return np.minimum(0.0, ends), np.maximum(0.0, ends)

    def controller(self, vector: np.ndarray) -> Controller:
        """See `Form.controller`."""
        controller: Any = self.usual
        return replace(controller, **dict(zip(self.names, _parameters(vector, self.names).tolist(), strict=True)))

    def vector(self, controller: Controller) -> np.ndarray:
        """See `Form.vector`."""
        usual, other = self.usual, controller
        if type(other) is not type(usual):
            raise InputError(f"begin = {other.name}; expected a {type(usual).__name__}, which is searched")
        kept = [one.name for one in fields(usual) if one.init and one.name not in (*self.names, "name")]  # pyright: ignore
        if different := [name for name in kept if plain(getattr(other, name)) != plain(getattr(usual, name))]:
            raise InputError(f"begin = {other.name} has another {different[0]} than the controller that is searched")
        return np.array([float(getattr(other, name)) for name in self.names])


class _Weights(NamedTuple):
    """The meaning of a network form's vector."""

    names: tuple[str, ...]
    """In the order of the vector; those of general weights contain destination and source leg."""
    weights: Callable[[np.ndarray], AnyWeights]
    """From a vector, (parameter,)."""
    vector: Callable[[AnyWeights], np.ndarray]
    """The parameters of any weights, (parameter,), for comparison; NaN if these have no parameter of that name."""


def _symmetric(size: Literal[9, 10]) -> _Weights:
    names = [one.name for one in fields(Symmetric) if one.name != "p34_i" or size == 10]

    def vector(weights: AnyWeights) -> np.ndarray:
        known = isinstance(weights, Symmetric)
        return np.array([getattr(weights, name) if known else np.nan for name in names])

    return _Weights(tuple(names), Symmetric.from_vector, vector)


def _mirrored(vector: np.ndarray) -> Weights:
    matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
    for (kind, (d, e)), value in zip(_LEFT, vector, strict=True):
        matrices[kind][d, e] = matrices[kind][MIRROR[d], MIRROR[e]] = value
    return Weights(**matrices)


def _left(weights: AnyWeights) -> np.ndarray:
    matrices = general(weights)
    return np.array([getattr(matrices, kind)[pair] for kind, pair in _LEFT])


FORMS: dict[FormName, _Weights] = {
    "hws": _symmetric(9),
    "ldvs": _symmetric(10),
    "mirrored": _Weights(names_of(_LEFT), _mirrored, _left),
    "general": _Weights(names_of(_ALL), Weights.from_vector, lambda weights: general(weights).to_vector()),
}
"""Forms of the 1998 network by name."""


@dataclass(frozen=True)
class NetworkForm:
    """The weights of the 1998 network, which walks with one order of updates and one model variant."""

    name: FormName = "ldvs"
    """Free weights: nine parameters (hws), ten with a neutral position that depends on the velocity (ldvs), 29 if only
    left and right are alike (mirrored), or all 58 (general)."""
    order: Order = "printed"
    """See `Cruse1998.order`."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """See `Cruse1998.model_variant`."""

    def __post_init__(self) -> None:
        choice("form", self.name, FORMS)
        Cruse1998(FORMS[self.name].weights(np.zeros(len(self.names))), self.order, model_variant=self.model_variant)

    @property
    def names(self) -> tuple[str, ...]:
        """See `Form.names`."""
        return FORMS[self.name].names

    @property
    def binary(self) -> np.ndarray:
        """See `Form.binary`: P^2 and P^4."""
        return np.array([name.startswith(BINARY) for name in self.names])

    @property
    def begin(self) -> None:
        """None: the paper's '0'-individual, or the middle of the box."""
        return None

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the box, which the paper does not print.

        It is -reach to reach for neutral positions and their change with velocity [mm], 0 to reach for shifts [mm] and
        weights (the signs of the printed sets), and 0 to 1 for binary parameters.
        """
        neutral = np.array([name.startswith(("p31", "p34")) for name in self.names])
        return np.where(neutral, -reach, 0.0), np.where(self.binary, 1.0, reach)

    def controller(self, vector: np.ndarray) -> Cruse1998:
        """See `Form.controller`."""
        weights = FORMS[self.name].weights(_parameters(vector, self.names))
        return Cruse1998(weights, self.order, model_variant=self.model_variant)

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the weights of a network, (parameter,). Its order of updates and model variant are not part of them.

        Raises:
            InputError: no network, or one whose weights do not have this form.
        """
        if type(controller) is not Cruse1998:
            raise InputError(f"begin = {controller.name}; expected a weight set of the 1998 network")
        if not _has_form(self.name, controller.weights):
            others = ", ".join(name for name in FORMS if _has_form(name, controller.weights))
            raise InputError(f"begin = {controller.name} has no weights of the form {self.name}; valid forms: {others}")
        return FORMS[self.name].vector(controller.weights)


def _has_form(form: FormName, weights: AnyWeights) -> bool:
    """Whether a form's parameters determine the weights."""
    vector = FORMS[form].vector(weights)
    if not np.isfinite(vector).all():
        return False
    return np.array_equal(general(FORMS[form].weights(vector)).to_vector(), general(weights).to_vector())


def _parameters(vector: ArrayLike, names: tuple[str, ...]) -> np.ndarray:
    values = numbers("vector", vector)
    if values.shape != (len(names),):
        raise InputError(f"vector has the shape {values.shape}; expected ({len(names)},), one number a parameter")
    return values


def named_form(
    name: str, begin: Controller | None = None, order: Order | None = None, model_variant: ModelVariant | None = None
) -> Form:
    """Return a form by name.

    Args:
        name: a key of `FORMS`, or a controller as `load_controller` takes it.
        begin: network from which the search begins; order and model variant are its own by default.
        order: of updates, of the 1998 network only.
        model_variant: of the 1998 network only.

    Raises:
        InputError: no such form or controller, or an order or model variant with another controller.
    """
    if name in FORMS:
        usual = begin if type(begin) is Cruse1998 else Cruse1998(Symmetric())
        return NetworkForm(name, order or usual.order, model_variant or usual.model_variant)
    if order or model_variant:
        raise InputError(f"order and model_variant need one of the forms {', '.join(FORMS)}; form = {name}")
    if (whole := PART.sub("", name)) != name and parameter_file(whole):
        raise InputError(f"form = {name}; expected {whole}, without the ending")
    try:
        return FieldsForm(load_controller(name), name)
    except InputError as error:
        raise InputError(f"form: {error}; forms of the 1998 network: {', '.join(FORMS)}") from None
