"""Preset networks, with the paper's weight sets or our own, and networks in parameter files (TOML)."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998.network import Cruse1998, named_variant, variant_name
from hexmj.controllers.cruse1998.weights import NEIGHBOURS, PLACES, Symmetric, Weights
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml
from hexmj.validate import choice

OWN = Path(__file__).with_name("own.toml")
"""File of our own weight sets, with the commands that found or built them."""

OWN_TABLES = read_toml(OWN)
"""Name of each of our own weight sets -> its table: command, seeds of the starts of its search, and weights."""


def read_network(table: dict[str, Any], where: str, name: str) -> Cruse1998:
    """Return a network from the tables of a parameter file.

    Args:
        table: either ``[symmetric]`` with fields of `Symmetric`, or ``[weights.p1]`` ... ``[weights.p4]`` with keys
            ``"d,e"`` (the paper's leg numbers). ``order`` and ``model_variant`` are optional, "printed" by default.
            ``command`` and ``searched``, which a search writes, are ignored.
        where: name of the file in error messages.
        name: name of the weight set.

    Raises:
        InputError: a key or value is invalid.
    """
    order, model_variant = (table.get(key, "printed") for key in ("order", "model_variant"))
    no_weights = ("order", "model_variant", "command", SEARCHED)
    try:
        match {key: value for key, value in table.items() if key not in no_weights}:
            case {"symmetric": dict() as values, **more} if not more:
                weights = Symmetric(**values)
            case {"weights": dict() as kinds, **more} if not more and all(
                isinstance(entries, dict) for entries in kinds.values()
            ):
                values = {f"{kind} {key}": value for kind, entries in kinds.items() for key, value in entries.items()}
                weights = Weights.of({PLACES[choice("weight", name, PLACES)]: value for name, value in values.items()})
            case tables:
                raise InputError(f"tables = {', '.join(tables)}; expected [symmetric], or [weights.p1] to [weights.p4]")
        return Cruse1998(weights, order, name, named_variant(model_variant))
    except (InputError, TypeError) as error:
        raise InputError(f"{where}: {error}") from None


def network_toml(network: Cruse1998) -> str:
    """Return the network as TOML text, which `read_network` reads back to the same bits; zero weights are left out.

    Raises:
        InputError: the model variant is not one of `MODEL_VARIANTS`.
    """
    import tomli_w

    weights = network.weights
    rules = {"order": network.order, "model_variant": variant_name(network.model_variant)}
    named_variant(rules["model_variant"])
    if isinstance(weights, Symmetric):
        tables: dict[str, Any] = {"symmetric": asdict(weights)}
    else:
        tables = {"weights": {kind: {} for kind in NEIGHBOURS}}
        for name, (kind, pair) in PLACES.items():
            if value := getattr(weights, kind)[pair].item():
                tables["weights"][kind][name.removeprefix(f"{kind} ")] = value
    return tomli_w.dumps({key: value for key, value in rules.items() if value != "printed"} | tables)


HWS = Cruse1998(
    Symmetric(p1_i=10.85, p1_c=6.73, p31_i=-2.48, p32_i=4.75, p33_i=0.191, p31_c=-0.34, p32_c=0.09, p4_i=1.0),
    name="hws",
)
"""The hard-wired system: weights from the caption of Fig. 3; P^2 and P^4 from Section 5.1.1."""

LDVS = Cruse1998(
    Symmetric(
        p1_i=11.998, p1_c=5.999, p31_i=-9.32, p32_i=6.23, p33_i=0.083, p34_i=16.058, p31_c=-2.063, p32_c=0.081, p4_i=1.0
    ),
    name="ldvs",
)
"""The linearly velocity-dependent system: weights from the caption of Fig. 4."""

UNCOORDINATED = Cruse1998(Symmetric(), name="uncoordinated")
"""The network without any coordinating mechanism (Section 5.1)."""

PRESETS: dict[str, Cruse1998] = {network.name: network for network in (HWS, LDVS, UNCOORDINATED)}
PRESETS |= {name: read_network(table, f"{OWN.name} [{name}]", name) for name, table in OWN_TABLES.items()}
"""Name -> network: the paper's weight sets `hws` and `ldvs`, `uncoordinated`, and our own: `own-0.1` ... `own-0.9` for
one velocity each, `own` for 0.1 to 0.5 together; `robust-0.1`, `robust-0.3` and `robust-0.7` with a low mean FLSS over
all `hexmj.variants`; `lasting-0.1` ... `lasting-0.9` and `lasting`, searched under the model variant `lasting`."""
