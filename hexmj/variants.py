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

Part = TypeVar("Part")


def variants(physical: bool = False) -> list[str]:
    """Return the names of `VARIANTS`, for physical walks without `UNREACHED`."""
    return [name for name in VARIANTS if not (physical and name in UNREACHED)]


def varied(part: Part, variant: str) -> Part:
    """Return a stride, a network or a form of its weights under one of `VARIANTS`.

    Fields that the part does not have are left out; parts of it are varied within. A field that has the changed value
    already gets its default instead.

    Raises:
        InputError: there is no such variant, or its value does not fit the part's others.
    """
    own: Any = part
    wanted, changes = VARIANTS[choice("variant", variant, VARIANTS)], {}
    for field in fields(own):
        name, value = field.name, getattr(own, field.name)
        if name in wanted:
            usual = field.default if field.default_factory is MISSING else field.default_factory()
            changes[name] = wanted[name] if value != wanted[name] else usual
        elif is_dataclass(value) and (inner := varied(value, variant)) is not value:
            changes[name] = inner
    try:
        return replace(own, **changes) if changes else part
    except InputError as error:
        raise InputError(f"variant {variant}: {error}") from None
