"""Variants: one constant or rule that the paper leaves open, changed at a time.

A set of weights is worth most if its FLSS is low whichever of them the authors used.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Any, TypeVar

from hexmj.errors import InputError
from hexmj.legs import CENTRED

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
"""Name -> which fields of a `Stride` [mm, time units], a network or its reading it changes, to what; see `varied`."""

UNREACHED = {"AEP0 11"}
"""Variants that legs of the stick insect do not reach on their usual lines, left out of all physical walks."""

INNER = ("controller", "model_variant")
"""Fields that are varied within: what reads the legs, and how the paper is read."""

Part = TypeVar("Part")


def variants(physical: bool = False) -> list[str]:
    """The names of `VARIANTS`, or of those that are walked in physics, without `UNREACHED`."""
    return [name for name in VARIANTS if not (physical and name in UNREACHED)]


def varied(part: Part, variant: str) -> Part:
    """A stride, a network or a form of its weights under one of `VARIANTS`; fields that it lacks stand elsewhere.

    What has the changed value already gets the default instead, see `instead`.

    Raises:
        InputError: no such variant, or its value makes no sense with the part's others.
    """
    if variant not in VARIANTS:
        raise InputError(f"variant {variant!r:.80}; valid names: {', '.join(VARIANTS)}")
    if variant == "usual":
        return part
    own: Any = part
    wanted = {one.name: VARIANTS[variant][one.name] for one in fields(own) if one.name in VARIANTS[variant]}
    changes = {name: _default(own, name) if getattr(own, name) == value else value for name, value in wanted.items()}
    inner = {name: varied(getattr(own, name), variant) for name in INNER if is_dataclass(getattr(own, name, None))}
    with naming(variant):
        return replace(own, **changes | inner)


def _default(part: Any, name: str) -> Any:
    """Of a field, in the first class that has it, whatever its heirs make of it."""
    classes = [one for one in type(part).__mro__ if is_dataclass(one)]
    field = next(one for cls in reversed(classes) for one in fields(cls) if one.name == name)
    return field.default if field.default_factory is MISSING else field.default_factory()


def instead(part: Any, variant: str) -> dict[str, Any]:
    """Fields of a part that have the value of a variant already, and the defaults that `varied` gives them instead.

    A set of the reading 'lasting' is read as printed under the variant of that name.
    """
    changed = varied(part, variant)
    own = {
        name: getattr(changed, name)
        for name, value in VARIANTS[variant].items()
        if getattr(part, name, MISSING) == value
    }
    inner = [instead(getattr(part, name), variant) for name in INNER if is_dataclass(getattr(part, name, None))]
    return own | dict(pair for one in inner for pair in one.items())


@contextmanager
def naming(variant: str) -> Iterator[None]:
    """A sentence on a value that nobody gave names the variant that has it."""
    try:
        yield
    except InputError as error:
        if variant == "usual":
            raise
        raise InputError(f"variant {variant}: {error}") from None
