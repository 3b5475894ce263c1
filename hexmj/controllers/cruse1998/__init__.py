"""The coordination network of Cymbalyuk, Borisyuk, Mueller-Wilm and Cruse (1998)."""

from hexmj.controllers.cruse1998.model_variants import MODEL_VARIANTS, ModelVariant
from hexmj.controllers.cruse1998.network import Cruse1998, Order
from hexmj.controllers.cruse1998.presets import HWS, LDVS, PRESETS, UNCOORDINATED
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
]
