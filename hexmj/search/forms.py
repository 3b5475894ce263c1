"""Forms: which numbers of a controller a search chooses, as a vector; `network_forms` has those of the 1998 network."""

from dataclasses import dataclass, fields, replace
from inspect import signature
from typing import Any, Protocol, runtime_checkable

import numpy as np

from hexmj.checks import short, typed
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError
from hexmj.labels import vector_of
from hexmj.plain import plain


@runtime_checkable
class Form(Protocol):
    """A frozen dataclass that turns vectors into controllers."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, in the order of the vector."""
        ...

    @property
    def binary(self) -> np.ndarray:
        """(parameter,) which are 0 or 1."""
        ...

    @property
    def begin(self) -> np.ndarray | None:
        """(parameter,) where a search begins unless told; None where its algorithm knows better."""
        ...

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest values of the first population, (parameter,) each; the greater magnitude of them at a
        reach of 1 is what counts as 1 of a parameter."""
        ...

    def controller(self, vector: np.ndarray) -> Controller:
        """From a vector, (parameter,)."""
        ...

    def vector(self, controller: Controller) -> np.ndarray:
        """The parameters of a controller, (parameter,).

        Raises:
            InputError: it has none of this form.
        """
        ...


@dataclass(frozen=True)
class FieldsForm:
    """The fields of a controller that are annotated as float; the others stay."""

    usual: Controller
    """With its usual values, from which the search begins."""

    def __post_init__(self) -> None:
        check_controller_type(self.usual)
        if not self.names:
            raise InputError(f"{self.usual.name} has no field of the type float; expected one that can be searched")
        of: Any = self.usual
        if beside := signature(type(of)).parameters.keys() - {one.name for one in fields(of)}:
            raise InputError(f"{of.name} is made of {min(beside)}, too; expected one that its fields alone tell")

    @property
    def names(self) -> tuple[str, ...]:
        """See `Form.names`."""
        of: Any = self.usual
        return tuple(one.name for one in fields(of) if one.init and one.type in (float, "float"))

    @property
    def binary(self) -> np.ndarray:
        """None is."""
        return np.zeros(len(self.names), dtype=bool)

    @property
    def begin(self) -> np.ndarray:
        """The usual values."""
        return self.vector(self.usual)

    def box(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """0 to `reach` times the usual value, or to `reach` itself where that is 0."""
        with np.errstate(over="ignore"):  # of usual values that are refused as such
            ends = reach * np.where(self.begin == 0, 1.0, self.begin)
        return np.minimum(0.0, ends), np.maximum(0.0, ends)

    def controller(self, vector: np.ndarray) -> Controller:
        """See `Form.controller`."""
        of: Any = self.usual
        values = vector_of(vector, self.names, "parameters").tolist()
        return replace(of, **dict(zip(self.names, values, strict=True)))

    def vector(self, controller: Controller) -> np.ndarray:
        """See `Form.vector`."""
        check_controller_type(controller)
        if type(controller) is not type(self.usual):
            raise InputError(f"{controller.name} to begin with; expected a {type(self.usual).__name__}")
        of: Any = self.usual
        for name in (one.name for one in fields(of) if one.init and one.name not in (*self.names, "name")):
            values = [getattr(one, name) for one in (of, controller)]
            plainly = [repr(plain(value)) for value in values]
            if plainly[0] != plainly[1]:  # nan is nan
                here, there = map(short, values) if short(values[0]) != short(values[1]) else plainly
                told = f"{name} = {there}; expected {here}, as of what is searched"
                raise InputError(f"{controller.name} to begin with has {told}")
        return np.array([typed(name, getattr(controller, name), float) for name in self.names])
