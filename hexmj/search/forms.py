"""Forms: which numbers of a controller a search chooses, as a vector.

A form of the 1998 network has nine or ten numbers if all legs of a side are alike (Appendix A), 29 if only the two
sides are alike (half of the 58 general weights of Section 2), or all 58. Of other controllers float fields are free.
"""

from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np

from hexmj.controllers.cruse1998 import Cruse1998, ModelVariant, Order
from hexmj.controllers.cruse1998.weights import BINARY, AnyWeights, Symmetric, Weights, general
from hexmj.controllers.cruse1998.weights import PLACES as ALL
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.controllers.registry import load_controller
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.plain import plain
from hexmj.validate import choice

FormName = Literal["hws", "ldvs", "mirrored", "general"]

_SYMMETRIC = tuple(one.name for one in fields(Symmetric))

PLACES = {"mirrored": {name: (kind, pair) for name, (kind, pair) in ALL.items() if pair[0] < 3}, "general": ALL}
"""Forms of general weights -> names of their parameters -> kind, destination and source leg."""

FORMS: dict[FormName, tuple[str, ...]] = {
    "hws": tuple(name for name in _SYMMETRIC if name != "p34_i"),
    "ldvs": _SYMMETRIC,
    "mirrored": tuple(PLACES["mirrored"]),
    "general": tuple(ALL),
}
"""Forms of the 1998 network -> names of their parameters, in the order of the vector."""


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
        if not np.isfinite(self.begin).all():
            raise InputError(f"box of the form: {self.usual.name} has a field that is not finite")
        if not self.name:
            kind = type(self.usual)
            object.__setattr__(self, "name", f"{kind.__module__}:{kind.__qualname__}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the vector."""
        controller: Any = self.usual
        return tuple(one.name for one in fields(controller) if one.init and one.type in (float, "float"))

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) which are 0 or 1: none."""
        return np.zeros(len(self.names), dtype=bool)

    @property
    def begin(self) -> np.ndarray:
        """(parameter,) vector from which a search begins by default: the usual values."""
        return np.array([float(getattr(self.usual, name)) for name in self.names])

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return least and greatest values of the first population, (parameter,) each.

        They are 0 and `reach` times the usual value, or 0 and `reach` if that is 0.
        """
        ends = reach * np.where(self.begin == 0, 1.0, self.begin)
        return np.minimum(0.0, ends), np.maximum(0.0, ends)

    def controller(self, vector: np.ndarray) -> Controller:
        """Return the controller of a vector, (parameter,)."""
        controller: Any = self.usual
        return replace(controller, **dict(zip(self.names, vector.tolist(), strict=True)))

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the parameters of a controller, (parameter,).

        Raises:
            InputError: it is of another class, or differs in a field that is not searched.
        """
        if type(controller) is type(self.usual):
            vector = FieldsForm(controller).begin
            if plain(controller) | {"name": ""} == plain(self.controller(vector)) | {"name": ""}:
                return vector
        raise InputError(f"begin = {controller.name}; expected {self.usual.name}, with other {', '.join(self.names)}")


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
        self.controller(np.zeros(len(self.names)))  # checks order and model variant

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters; those of general weights contain destination and source leg."""
        return FORMS[self.name]

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) which are 0 or 1: P^2 and P^4."""
        return np.array([name.startswith(BINARY) for name in self.names])

    @property
    def begin(self) -> None:
        """None: the algorithm begins with the paper's '0'-individual, or with the middle of the box."""
        return None

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the box of the first population, which the paper does not print, (parameter,) each.

        It is -reach to reach for neutral positions and their change with velocity [mm], 0 to reach for shifts [mm] and
        weights (the signs of the printed sets), and 0 to 1 for binary parameters.
        """
        neutral = np.array([name.startswith(("p31", "p34")) for name in self.names])
        return np.where(neutral, -reach, 0.0), np.where(self.binary, 1.0, reach)

    def controller(self, vector: np.ndarray) -> Cruse1998:
        """Return the network of a vector, (parameter,)."""
        return Cruse1998(self._weights(vector), self.order, model_variant=self.model_variant)

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the weights of a network, (parameter,). Its order of updates and model variant are not part of them.

        Raises:
            InputError: no network, or one whose weights do not have this form.
        """
        if type(controller) is not Cruse1998:
            raise InputError(f"begin = {controller.name}; expected a weight set of the 1998 network")
        vector, weights = self.parameters(controller.weights), general(controller.weights).to_vector()
        if np.isnan(vector).any() or not np.array_equal(general(self._weights(vector)).to_vector(), weights):
            raise InputError(f"begin = {controller.name}; expected weights of the form {self.name}")
        return vector

    def parameters(self, weights: AnyWeights) -> np.ndarray:
        """Return the numbers in any weights that this form names, (parameter,); NaN if these have no such number."""
        if self.name in PLACES:
            return np.array([getattr(general(weights), kind)[pair] for kind, pair in PLACES[self.name].values()])
        known = isinstance(weights, Symmetric)
        return np.array([getattr(weights, name) if known else np.nan for name in self.names])

    def _weights(self, vector: np.ndarray) -> AnyWeights:
        if self.name not in PLACES:
            return Symmetric(**dict(zip(self.names, vector.tolist(), strict=True)))
        numbers = dict(zip(PLACES[self.name].values(), vector, strict=True))
        if self.name == "mirrored":
            numbers |= {(kind, (MIRROR[d], MIRROR[e])): value for (kind, (d, e)), value in numbers.items()}
        return Weights.of(numbers)


Form = FieldsForm | NetworkForm


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
    try:
        return FieldsForm(load_controller(name), name)
    except InputError as error:
        raise InputError(f"form: {error}; forms of the 1998 network: {', '.join(FORMS)}") from None
