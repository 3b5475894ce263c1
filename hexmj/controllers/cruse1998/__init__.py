"""The coordination network of Cymbalyuk, Borisyuk, Mueller-Wilm and Cruse (1998)."""

from hexmj.controllers.cruse1998.network import (
    MODEL_VARIANTS,
    Cruse1998,
    ModelVariant,
    Order,
    in_words,
    named_variant,
    variant_name,
)
from hexmj.controllers.cruse1998.presets import (
    HWS,
    LDVS,
    PRESETS,
    UNCOORDINATED,
    network_toml,
    own_tables,
    read_network,
)
from hexmj.controllers.cruse1998.weights import Symmetric, Weights

__all__ = [
    "HWS",
    "LDVS",
    "MODEL_VARIANTS",
    "PRESETS",
    "UNCOORDINATED",
    "Cruse1998",
    "ModelVariant",
    "Order",
    "Symmetric",
    "Weights",
    "in_words",
    "named_variant",
    "network_toml",
    "own_tables",
    "read_network",
    "variant_name",
]
