"""The coordination network of Cymbalyuk, Borisyuk, Mueller-Wilm and Cruse (1998)."""

from hexmj.controllers.cruse1998.network import MODEL_VARIANTS as MODEL_VARIANTS
from hexmj.controllers.cruse1998.network import Cruse1998 as Cruse1998
from hexmj.controllers.cruse1998.network import ModelVariant as ModelVariant
from hexmj.controllers.cruse1998.network import Order as Order
from hexmj.controllers.cruse1998.network import TripodLifted as TripodLifted
from hexmj.controllers.cruse1998.network import named_variant as named_variant
from hexmj.controllers.cruse1998.network import variant_name as variant_name
from hexmj.controllers.cruse1998.presets import HWS as HWS
from hexmj.controllers.cruse1998.presets import LDVS as LDVS
from hexmj.controllers.cruse1998.presets import OWN_TABLES as OWN_TABLES
from hexmj.controllers.cruse1998.presets import PRESETS as PRESETS
from hexmj.controllers.cruse1998.presets import UNCOORDINATED as UNCOORDINATED
from hexmj.controllers.cruse1998.presets import network_toml as network_toml
from hexmj.controllers.cruse1998.presets import read_network as read_network
from hexmj.controllers.cruse1998.weights import Symmetric as Symmetric
from hexmj.controllers.cruse1998.weights import Weights as Weights
