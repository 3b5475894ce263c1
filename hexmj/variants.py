"""Variants: one constant or rule that the paper leaves open, changed at a time.

A weight set is worth most if its FLSS is low for every variant that the authors may have used.
"""

from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any, TypeVar

from hexmj.errors import InputError
from hexmj.legs import CENTRED
from hexmj.validate import choice

VARIANTS: dict[str, dict[str, Any]] = {
    "usual": {},
    "centred": {"geometry": CENTRED},
    "PEP_min -15": {"pep_min": -15.0},
    "PEP_min -18": {"pep_min": -18.0},
    "PEP_min -25": {"pep_min": -25.0},
    "AEP0 9": {"aep0": 9.0},
    "AEP0 11": {"aep0": 11.0},
    "PEP0 -9": {"pep0": -9.0},
    "PEP0 -9.9": {"pep0": -9.9},
    "PEP0 -11": {"pep0": -11.0},
    "dt 0.05": {"dt": 0.05},
    "dt 0.2": {"dt": 0.2},
    "undelayed": {"order": "undelayed"},
    "sequential": {"order": "sequential"},
    "lasting": {"ipsilateral": "lasting"},
}
"""Name -> changed fields of a `Stride` [mm, time units], a network or its model variant; see `varied`."""

UNREACHED = {"AEP0 11"}
"""Variants that are out of reach of the stick insect's legs, left out of all physical walks."""

INNER = ("controller", "model_variant")
"""Fields that are varied themselves: a controller with feedback, and a model variant."""

Part = TypeVar("Part")


def variants(physical: bool = False) -> list[str]:
    """Return the names of `VARIANTS`, for physical walks without `UNREACHED`."""
    return [name for name in VARIANTS if not (physical and name in UNREACHED)]


def varied(part: Part, variant: str) -> Part:
    """Return a stride, a network or a form of its weights under one of `VARIANTS`.

    Fields that the part does not have are left out. A part that has the changed value already gets the default instead,
    see `instead`.

    Raises:
        InputError: there is no such variant, or its value does not fit the part's others.
    """
    own: Any = part
    wanted = VARIANTS[choice("variant", variant, VARIANTS)]
    changes = {}
    for field in fields(own):
        value = getattr(own, field.name)
        if field.name in wanted:
            changes[field.name] = wanted[field.name] if value != wanted[field.name] else _default(field)
        elif field.name in INNER and is_dataclass(value):
            changes[field.name] = varied(value, variant)
    try:
        return replace(own, **changes) if wanted else part
    except InputError as error:
        raise InputError(f"variant {variant}: {error}") from None


def instead(part: Any, variant: str) -> dict[str, Any]:
    """Return the defaults that `varied` gives to fields that have the value of a variant already."""
    found: dict[str, Any] = {}
    for field in fields(part):
        value = getattr(part, field.name)
        if field.name in INNER and is_dataclass(value):
            found |= instead(value, variant)
        elif value == VARIANTS[variant].get(field.name, MISSING):
            found[field.name] = _default(field)
    return found


def _default(field: Any) -> Any:
    return field.default if field.default_factory is MISSING else field.default_factory()
