"""Networks by name: the paper's weight sets and our own, and parameter files (TOML)."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998.network import Cruse1998, named_variant, variant_name
from hexmj.controllers.cruse1998.weights import NEIGHBOURS, PLACES, Symmetric, Weights
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml
from hexmj.validate import choice

OWN = Path(__file__).with_name("own.toml")
"""Our own weight sets, with the commands that found or built them."""

OWN_TABLES = read_toml(OWN)
"""Table of each of our own sets: its command, the starts on which it was searched, and its weights."""


def read_network(table: dict[str, Any], where: str, name: str) -> Cruse1998:
    """Return a network from the tables of a file.

    Args:
        table: either ``[symmetric]`` with fields of `Symmetric`, or ``[weights.p1]`` ... ``[weights.p4]`` with keys
            ``"d,e"`` (the paper's leg numbers); before it ``order`` and ``model_variant``, by default as printed. The
            ``command`` of a search and the starts on which it ``searched`` are not read.
        where: the file, for error messages.
        name: name of the weight set.

    Raises:
        InputError: a key or value is invalid.
    """
    order, model_variant = (table.get(key, "printed") for key in ("order", "model_variant"))
    others = ("order", "model_variant", "command", SEARCHED)
    try:
        match {key: value for key, value in table.items() if key not in others}:
            case {"symmetric": dict() as values, **more} if not more:
                weights = Symmetric(**values)
            case {"weights": dict() as kinds, **more} if not more and all(
                isinstance(one, dict) for one in kinds.values()
            ):
                values = {f"{kind} {key}": value for kind, entries in kinds.items() for key, value in entries.items()}
                weights = Weights.of({PLACES[choice("weight", name, PLACES)]: one for name, one in values.items()})
            case tables:
                raise InputError(f"tables {', '.join(tables)}; expected [symmetric], or [weights.p1] to [weights.p4]")
        return Cruse1998(weights, order, name, named_variant(model_variant))
    except (InputError, TypeError) as error:
        raise InputError(f"{where}: {error}") from None


def network_toml(network: Cruse1998) -> str:
    """Return the text of a TOML file that `read_network` reads to the same bits; weights that are 0 are left out.

    Raises:
        InputError: the model variant has no name.
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
"""The hard-wired system: printed in the caption of Fig. 3; P^2 and P^4 from Section 5.1.1."""

LDVS = Cruse1998(
    Symmetric(
        p1_i=11.998, p1_c=5.999, p31_i=-9.32, p32_i=6.23, p33_i=0.083, p34_i=16.058, p31_c=-2.063, p32_c=0.081, p4_i=1.0
    ),
    name="ldvs",
)
"""The linearly velocity-dependent system: printed in the caption of Fig. 4."""

UNCOORDINATED = Cruse1998(Symmetric(), name="uncoordinated")
"""No coordinating mechanism (Section 5.1)."""

PRESETS: dict[str, Cruse1998] = {network.name: network for network in (HWS, LDVS, UNCOORDINATED)}
PRESETS |= {name: read_network(table, f"{OWN.name} [{name}]", name) for name, table in OWN_TABLES.items()}
"""The paper's weight sets, no coordination, and our own: `own-0.1` ... `own-0.9` for one velocity each, `own` for 0.1
to 0.5 at once; `robust-0.1`, `robust-0.3` and `robust-0.7`, good over all `hexmj.variants`; and `lasting-0.1` ...
`lasting-0.9` and `lasting`, which were searched under that model variant and use it."""
