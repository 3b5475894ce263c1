"""Forms: the free parameters of a controller, which a search chooses, as a vector.

A form of the 1998 network has nine or ten weights if all legs of a side are alike (Appendix A), 29 if only the two
sides are alike (half of the 58 general weights of Section 2), or all 58. Other forms have a controller's float fields.
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

_SYMMETRIC = tuple(item.name for item in fields(Symmetric))

PLACES = {"mirrored": {name: (kind, pair) for name, (kind, pair) in ALL.items() if pair[0] < 3}, "general": ALL}
"""Form of general weights -> name of each parameter -> kind of weight, (destination, source) leg."""

FORMS: dict[FormName, tuple[str, ...]] = {
    "hws": tuple(name for name in _SYMMETRIC if name != "p34_i"),
    "ldvs": _SYMMETRIC,
    "mirrored": tuple(PLACES["mirrored"]),
    "general": tuple(ALL),
}
"""Name of each form of the 1998 network -> names of its parameters, in the order of the vector."""


@dataclass(frozen=True)
class FieldsForm:
    """Form with the fields of a controller that are annotated as float; all other fields keep their values."""

    usual: Controller
    """Controller whose field values are the defaults, from which the search begins."""
    name: str = ""
    """Name by which `load_controller` finds the controller; it is written into the file of the found controller. By
    default MODULE:CLASS."""

    def __post_init__(self) -> None:
        check_controller_type(self.usual)
        if not self.names:
            raise InputError(f"{self.usual.name} has no fields of type float, which a search needs")
        if not self.name:
            kind = type(self.usual)
            object.__setattr__(self, "name", f"{kind.__module__}:{kind.__qualname__}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the vector."""
        controller: Any = self.usual
        return tuple(item.name for item in fields(controller) if item.init and item.type in (float, "float"))

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) whether a parameter is binary: all False."""
        return np.zeros(len(self.names), dtype=bool)

    @property
    def begin(self) -> np.ndarray:
        """(parameter,) vector from which a search begins by default: the field values of `usual`."""
        return np.array([float(getattr(self.usual, name)) for name in self.names])

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest values of the initial population, (parameter,) each.

        A parameter lies between 0 and `reach` times its default, or between 0 and `reach` if the default is 0.
        """
        ends = reach * np.where(self.begin == 0, 1.0, self.begin)
        return np.minimum(0.0, ends), np.maximum(0.0, ends)

    def controller(self, vector: np.ndarray) -> Controller:
        """Return the controller whose free fields have the values of a vector, (parameter,)."""
        controller: Any = self.usual
        return replace(controller, **dict(zip(self.names, vector.tolist(), strict=True)))

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the values of a controller's free fields, (parameter,).

        Raises:
            InputError: the controller differs from `usual` in its class or in a field that is not free.
        """
        if type(controller) is type(self.usual):
            vector = FieldsForm(controller).begin
            if plain(controller) | {"name": ""} == plain(self.controller(vector)) | {"name": ""}:
                return vector
        raise InputError(f"begin = {controller.name}; expected {self.usual.name} with other {', '.join(self.names)}")


@dataclass(frozen=True)
class NetworkForm:
    """Form with weights of the 1998 network, whose order of updates and model variant are fixed."""

    name: FormName = "ldvs"
    """Free weights: nine for all legs alike (hws), ten with a neutral position that changes with velocity (ldvs), 29 if
    only left and right legs are alike (mirrored), or all 58 (general)."""
    order: Order = "printed"
    """Order of updates, see `Cruse1998.order`."""
    model_variant: ModelVariant = field(default_factory=ModelVariant)
    """Model variant, see `Cruse1998.model_variant`."""

    def __post_init__(self) -> None:
        choice("form", self.name, FORMS)
        self.controller(np.zeros(len(self.names)))  # raises if order or model variant is invalid

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters; the name of a general weight contains its destination and source leg."""
        return FORMS[self.name]

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) whether a parameter is binary: True for P^2 and P^4."""
        return np.array([name.startswith(BINARY) for name in self.names])

    begin = None
    """By default each algorithm begins with its own vector, see `Effort.begin`."""

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest values of the initial population, (parameter,) each.

        The paper does not print them. They are -reach and reach for neutral positions and their change with velocity
        [mm], 0 and reach for shifts [mm] and weights (the signs of the printed sets), 0 and 1 for binary parameters.
        """
        neutral = np.array([name.startswith(("p31", "p34")) for name in self.names])
        return np.where(neutral, -reach, 0.0), np.where(self.binary, 1.0, reach)

    def controller(self, vector: np.ndarray) -> Cruse1998:
        """Return the network with the weights of a vector, (parameter,)."""
        return Cruse1998(self._weights(vector), self.order, model_variant=self.model_variant)

    def vector(self, controller: Controller) -> np.ndarray:
        """Return the weights of a network, (parameter,), without its order of updates and model variant.

        Raises:
            InputError: the controller is not a 1998 network, or its weights do not have this form.
        """
        if type(controller) is not Cruse1998:
            raise InputError(f"begin = {controller.name}; expected a 1998 network, which the form {self.name} needs")
        vector, weights = self.parameters(controller.weights), general(controller.weights).to_vector()
        if np.isnan(vector).any() or not np.array_equal(general(self._weights(vector)).to_vector(), weights):
            raise InputError(f"begin = {controller.name}; expected weights of the form {self.name}")
        return vector

    def parameters(self, weights: AnyWeights) -> np.ndarray:
        """Return this form's parameters from weights of any form, (parameter,); NaN if the weights lack them."""
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
        name: a key of `FORMS`, or the name of a controller that `load_controller` accepts.
        begin: network from which the search begins; it provides the defaults of order and model variant.
        order: order of updates, only for forms of the 1998 network.
        model_variant: model variant, only for forms of the 1998 network.

    Raises:
        InputError: there is no such form or controller, or order or model variant is given with another controller.
    """
    if name in FORMS:
        network = begin if type(begin) is Cruse1998 else Cruse1998(Symmetric())
        return NetworkForm(name, order or network.order, model_variant or network.model_variant)
    if order or model_variant:
        raise InputError(f"form = {name} has no order and no model_variant; only these forms do: {', '.join(FORMS)}")
    try:
        return FieldsForm(load_controller(name), name)
    except InputError as error:
        raise InputError(f"form: {error}; forms of the 1998 network: {', '.join(FORMS)}") from None
