"""Readings of the paper's ambiguous sentences on the network: each a named choice; what is printed is the default."""

from dataclasses import dataclass, fields
from typing import Literal

from hexmj.checks import check_types
from hexmj.errors import InputError


@dataclass(frozen=True)
class ModelVariant:
    """How Section 2 is read, where its words and its equations allow more than one network.

    The order of updates, a lag between legs, is `Cruse1998.order`.
    """

    ipsilateral: Literal["standing", "lasting"] = "standing"
    """When the anterior leg acts on the PEP (Eq. 4): while it stands, as the factor s_e(t) has it, or all the time:
    'the value of the influence depends on the position of the distal point of the influencing leg'."""
    contralateral: Literal["standing", "lasting"] = "standing"
    """When the contralateral leg acts by mechanism 3, likewise."""
    cap: Literal["above", "both", "sum"] = "above"
    """What the 4 mm of Eq. 4 bound: each influence from above, as printed; each between -4 and 4; or the sum over N^3
    ('the influences of the anterior and contralateral legs') from above."""
    rear: Literal["sum", "strongest"] = "sum"
    """What mechanism 1 amounts to where two legs act ('the effects ... come from the ipsilateral rear leg (if it
    exists) and the contralateral one'): the sum, as Eq. 6 has it, or the strongest."""
    neutral: Literal["present", "final"] = "present"
    """Which V_r moves the neutral position P^nr while the insect accelerates: that of Eq. 6, or the desired V_r*."""

    __post_init__ = check_types


MODEL_VARIANTS = {"printed": ModelVariant(), "lasting": ModelVariant(ipsilateral="lasting")}
"""Readings by name: to the letter, and with the anterior leg's influence lasting while that leg protracts."""


def named_variant(name: str) -> ModelVariant:
    """A reading by its name.

    Raises:
        InputError: no such name.
    """
    if not isinstance(name, str) or name not in MODEL_VARIANTS:
        raise InputError(f"reading = {name!r}; valid names: {', '.join(MODEL_VARIANTS)}")
    return MODEL_VARIANTS[name]


def variant_name(model_variant: ModelVariant) -> str:
    """The name of a reading.

    Raises:
        InputError: it has none.
    """
    for name, one in MODEL_VARIANTS.items():
        if one == model_variant:
            return name
    raise InputError(f"{model_variant} has no name; named ones: {', '.join(MODEL_VARIANTS)}")


def in_words(model_variant: ModelVariant) -> str:
    """Its name, or where it has none its choices that are not as printed, such as 'cap sum, neutral final'."""
    if model_variant in MODEL_VARIANTS.values():
        return variant_name(model_variant)
    chosen = [(one.name, getattr(model_variant, one.name)) for one in fields(ModelVariant)]
    return ", ".join(f"{name} {choice}" for name, choice in chosen if choice != getattr(ModelVariant, name))
