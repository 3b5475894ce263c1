"""Networks by name: the paper's weight sets and our own, and parameter files (TOML)."""

from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998.network import Cruse1998, named_variant, variant_name
from hexmj.controllers.cruse1998.weights import (
    HWS_WEIGHTS,
    LDVS_WEIGHTS,
    NEIGHBOURS,
    NO_WEIGHTS,
    PLACES,
    AnyWeights,
    Symmetric,
    Weights,
)
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml
from hexmj.validate import choice, number

OWN = Path(__file__).with_name("own.toml")
"""Our own weight sets, with the commands that found or built them."""


def read_network(table: dict[str, Any], where: str, name: str) -> Cruse1998:
    """Return a network from the tables of a file.

    Args:
        table: either ``[symmetric]`` with fields of `Symmetric`, or ``[weights.p1]`` ... ``[weights.p4]`` with keys
            ``"d,e"`` (the paper's leg numbers); before it ``order`` and ``model_variant``, by default as printed.
        where: the file, for error messages.
        name: name of the weight set.

    Raises:
        InputError: a key or value is invalid.
    """
    rules = {key: table[key] for key in ("order", "model_variant") if key in table}
    try:
        weights = _weights({key: value for key, value in table.items() if key not in rules})
        model_variant = named_variant(rules.get("model_variant", "printed"))
        return Cruse1998(weights, rules.get("order", "printed"), name, model_variant)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def network_toml(network: Cruse1998) -> str:
    """Return the text of a TOML file that `read_network` reads to the same bits; weights that are 0 are left out.

    Raises:
        InputError: the model variant has no name.
    """
    variant, weights = variant_name(network.model_variant), network.weights
    named_variant(variant)
    rules = {"order": network.order, "model_variant": variant}
    lines = [f'{key} = "{value}"' for key, value in rules.items() if value != "printed"]
    if isinstance(weights, Symmetric):
        lines += ["[symmetric]", *(f"{key} = {value!r}" for key, value in asdict(weights).items())]
        return "\n".join(lines) + "\n"
    for kind in NEIGHBOURS:
        values = {(d, e): getattr(weights, kind)[d, e].item() for of, (d, e) in PLACES if of == kind}
        lines += ["", f"[weights.{kind}]"]
        lines += [f'"{d + 1},{e + 1}" = {value!r}' for (d, e), value in values.items() if value]
    return "\n".join(lines).lstrip() + "\n"


def _weights(table: dict[str, Any]) -> AnyWeights:
    match table:
        case {"symmetric": dict() as values} if len(table) == 1:
            return Symmetric(**_numbers(values, [field.name for field in fields(Symmetric)]))
        case {"weights": dict() as kinds} if len(table) == 1 and all(isinstance(one, dict) for one in kinds.values()):
            places = {f"{kind} {d + 1},{e + 1}": (kind, (d, e)) for kind, (d, e) in PLACES}
            values = {f"{kind} {key}": value for kind, entries in kinds.items() for key, value in entries.items()}
            return Weights.of({places[name]: value for name, value in _numbers(values, [*places]).items()})
    raise InputError(
        f"tables {', '.join(table) or 'none'}; expected [symmetric], or [weights.*] with {', '.join(NEIGHBOURS)}, and"
        " before them order and model_variant"
    )


def _numbers(table: dict[str, Any], valid: list[str]) -> dict[str, float]:
    """Return the entries of a table if all are numbers with valid names."""
    return {choice("weight", name, valid): number(name, value) for name, value in table.items()}


@cache
def own_tables() -> dict[str, Any]:
    """Return the table of each of our own sets: its command, the starts on which it was searched, and its weights."""
    return read_toml(OWN)


def _own(name: str, table: dict[str, Any]) -> Cruse1998:
    weights = {key: value for key, value in table.items() if key not in ("command", SEARCHED)}
    return read_network(weights, f"{OWN.name} [{name}]", name)


HWS = Cruse1998(HWS_WEIGHTS, name="hws")
"""The paper's hard-wired system."""

LDVS = Cruse1998(LDVS_WEIGHTS, name="ldvs")
"""The paper's linearly velocity-dependent system."""

UNCOORDINATED = Cruse1998(NO_WEIGHTS, name="uncoordinated")
"""No coordination (Section 5.1)."""

PRESETS: dict[str, Cruse1998] = {network.name: network for network in (HWS, LDVS, UNCOORDINATED)}
PRESETS |= {name: _own(name, table) for name, table in own_tables().items()}
"""The paper's weight sets, no coordination, and our own: `own-0.1` ... `own-0.9` for one velocity each, `own` for 0.1
to 0.5 at once; `robust-0.1`, `robust-0.3` and `robust-0.7`, good over all `hexmj.variants`; and `lasting-0.1` ...
`lasting-0.9` and `lasting`, which were searched under that model variant and use it."""
