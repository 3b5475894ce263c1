"""Variants: each changes one constant or rule that the paper leaves open.

The authors may have used any variant, so that the best weight sets have a low FLSS under every one.
"""

from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any, TypeVar

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
"""Name -> changed fields of a `Stride` [mm, time units], a network or its model variant; `varied` applies them."""

UNREACHED = {"AEP0 11"}
"""Variants whose tips the stick insect's legs cannot reach; physical walks leave them out."""

Part = TypeVar("Part")


def variants(physical: bool = False) -> list[str]:
    """Return the names of `VARIANTS`; with `physical` those without `UNREACHED`, for physical walks."""
    return [name for name in VARIANTS if not (physical and name in UNREACHED)]


def varied(part: Part, variant: str) -> Part:
    """Return a stride, a network or a searched form of a network with the changes of one of `VARIANTS`.

    Changes of fields that neither the part nor its nested dataclasses have are ignored. A field that already has the
    changed value gets its default value.

    Raises:
        InputError: there is no such variant, or its value does not fit the other fields of the part.
    """
    own: Any = part
    values, changes = VARIANTS[choice("variant", variant, VARIANTS)], {}
    for field in fields(own):
        name, value = field.name, getattr(own, field.name)
        if name in values:
            default = field.default if field.default_factory is MISSING else field.default_factory()
            changes[name] = values[name] if value != values[name] else default
        elif is_dataclass(value) and (inner := varied(value, variant)) is not value:
            changes[name] = inner
    return replace(own, **changes) if changes else part
