"""Settings as the attributes of a result, which NetCDF can hold, and back."""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.checks import typed
from hexmj.storage.literal import literal

if TYPE_CHECKING:
    import xarray as xr

TEXTS = ("study", "model", "over", "reference", "title", "body", "ground")
"""Attributes whose texts are never JSON, whatever they look like."""


def attributes(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as the attributes of a result: texts and numbers that NetCDF has a type for, all else as JSON text."""

    def plain(value: Any) -> Any:
        if type(value) is str:
            return literal(value)
        value = value.item() if isinstance(value, np.generic) else value
        if type(value) is float or (type(value) is int and abs(value) < 2**63):
            return value
        return json.dumps(value, default=str)

    return {key: plain(value) for key, value in settings.items()}


def settings(result: "xr.Dataset") -> dict[str, Any]:
    """All that a result was made with, from its attributes: controllers, window, starts, seed, conditions; by the names
    of the study's fields, as `n_starts` of `league`, `ablate` and `variants`.

    Args:
        result: of `compare`, `flss` or any study, fresh or read from its file.

    Returns:
        Numbers, texts, lists and dictionaries by name, such as ``settings(result)["conditions"]["vp"]``.

    Raises:
        InputError: it is no dataset.
    """
    import xarray as xr

    told = typed("result", result, xr.Dataset).attrs
    return {str(key): value if key in TEXTS else _told(value) for key, value in told.items()}


def _told(value: Any) -> Any:
    """What was made an attribute."""
    if not isinstance(value, str):
        return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
    try:
        return json.loads(value)
    except ValueError:
        return value
