"""How types of this package are read from the command line, and which options are not as usual."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
)

from hexmj.conditions import Conditions, check_ground
from hexmj.legs import GEOMETRIES, Geometry

registry = ConstructorRegistry()
"""How types of this package are read."""


@registry.primitive_rule
def _named_geometry(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Geometry] | None:
    """On the command line a geometry is given by its name."""
    if info.type is not Geometry:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="{" + ",".join(GEOMETRIES) + "}",
        instance_from_str=lambda words: GEOMETRIES[words[0]],
        is_instance=lambda value: isinstance(value, Geometry),
        str_from_instance=lambda value: [name for name, g in GEOMETRIES.items() if g == value],
        choices=tuple(GEOMETRIES),
    )


@registry.struct_rule
def _conditions(info: StructTypeInfo) -> StructConstructorSpec | None:
    """On the command line conditions hold for the stick insect; those that `hiding` hides keep their values."""
    if not (isinstance(info.type, type) and issubclass(info.type, Conditions)):
        return None
    usual = info.default if isinstance(info.default, Conditions) else Conditions()
    hints = get_type_hints(Conditions)
    shown = [name for name in usual.values() if name not in getattr(info.type, "HIDDEN", ())]

    def conditions(**given: Any) -> Conditions:
        chosen = Conditions(**(usual.values() | given))
        if {"ground", "ground_seed"} <= given.keys():
            check_ground(chosen)
        return chosen

    return StructConstructorSpec(
        conditions, tuple(StructFieldSpec(name, hints[name], getattr(usual, name)) for name in shown)
    )


def changed(given: Any, usual: Any) -> Iterator[str]:
    """Names of the options, of their parts too, that are not as usual; both are of one dataclass."""
    for name in (one.name for one in fields(given) if one.name != "body"):
        value, other = getattr(given, name), getattr(usual, name)
        if value != other:
            yield from changed(value, other) if is_dataclass(value) and not isinstance(value, Geometry) else [name]
