"""Networks by name: the paper's sets of weights and our own, and parameter files (TOML)."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

from hexmj.controllers.cruse1998.model_variants import named_variant, variant_name
from hexmj.controllers.cruse1998.network import Cruse1998
from hexmj.controllers.cruse1998.weights import (
    HWS_WEIGHTS,
    LDVS_WEIGHTS,
    NEIGHBOURS,
    NO_WEIGHTS,
    AnyWeights,
    Symmetric,
    Weights,
    pairs,
)
from hexmj.errors import InputError
from hexmj.files import SEARCHED, read_toml

OWN = Path(__file__).with_name("own.toml")
"""Sets of our own, with the commands that found or built them."""


def read_network(table: dict[str, Any], where: str, name: str) -> Cruse1998:
    """A network from the tables of a file.

    Args:
        table: either ``[symmetric]`` with fields of `Symmetric`, or ``[weights.p1]`` ... ``[weights.p4]`` with keys
            ``"d,e"`` (the paper's leg numbers); ``order`` and ``model_variant`` before it, where they are not the printed.
        where: the file, for a sentence.
        name: of the set.

    Raises:
        InputError: a key, type or value that makes no sense.
    """
    rules = {key: table[key] for key in ("order", "model_variant") if key in table}
    weights = _weights({key: value for key, value in table.items() if key not in rules}, where)
    with _of(where):
        model_variant = named_variant(rules.get("model_variant", "printed"))
        return Cruse1998(weights, rules.get("order", "printed"), name, model_variant)


@contextmanager
def _of(where: str) -> Iterator[None]:
    """Say of which file a sentence is."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _weights(table: dict[str, Any], where: str) -> AnyWeights:
    if list(table) == ["symmetric"]:
        told = _numbers(table["symmetric"], [f.name for f in fields(Symmetric)], where := f"{where} [symmetric]")
        with _of(where):
            return Symmetric(**told)
    if list(table) != ["weights"] or not isinstance(weights := table["weights"], dict):
        raise InputError(
            f"{where} holds {', '.join(table) or 'nothing'}; expected one table, [symmetric] or [weights.*],"
            " and before it order and reading where they are not the printed ones"
        )
    if unknown := set(weights) - set(NEIGHBOURS):
        raise InputError(f"{where}: unknown table [weights.{min(unknown)}]; valid names: {', '.join(NEIGHBOURS)}")
    numbers = {}
    for kind, entries in weights.items():
        keys = {f"{d + 1},{e + 1}": (d, e) for d, e in pairs(kind)}
        given = _numbers(entries, list(keys), f"{where} [weights.{kind}]")
        numbers |= {(kind, keys[key]): value for key, value in given.items()}
    with _of(where):
        return Weights.of(numbers)


def network_toml(network: Cruse1998) -> str:
    """The text of a TOML file that `read_network` reads to the same bits; general weights that are 0 are left out.

    Raises:
        InputError: a reading without a name.
    """
    rules, weights = {"order": network.order, "model_variant": variant_name(network.model_variant)}, network.weights
    lines = [f'{key} = "{value}"' for key, value in rules.items() if value != "printed"]
    if isinstance(weights, Symmetric):
        lines += ["[symmetric]", *(f"{key} = {value!r}" for key, value in asdict(weights).items())]
        return "\n".join(lines) + "\n"
    for kind in NEIGHBOURS:
        matrix = getattr(weights, kind)
        lines += ["", f"[weights.{kind}]"]
        lines += [f'"{d + 1},{e + 1}" = {matrix[d, e].item()!r}' for d, e in pairs(kind) if matrix[d, e]]
    return "\n".join(lines).lstrip() + "\n"


def _numbers(table: object, valid: list[str], where: str) -> dict[str, float]:
    """The entries of a TOML table, all of which must be numbers with valid keys."""
    if not isinstance(table, dict):
        raise InputError(f"{where} is {table!r}; expected a table with the keys {', '.join(valid)}")
    for key, value in table.items():
        if key not in valid:
            raise InputError(f"{where}: unknown key {key!r}; valid keys: {', '.join(map(repr, valid))}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e100:
            raise InputError(f"{where}: {key} = {value!r:.40}; expected a number, finite and below 1e100")
    return {key: float(value) for key, value in table.items()}


_PAPER = {
    name: Cruse1998(weights, name=name)
    for name, weights in (("hws", HWS_WEIGHTS), ("ldvs", LDVS_WEIGHTS), ("uncoordinated", NO_WEIGHTS))
}

HWS, LDVS, UNCOORDINATED = _PAPER.values()
"""The paper's hard-wired and linearly velocity-dependent systems, and none (Section 5.1)."""


class _Presets(Mapping[str, Cruse1998]):
    """Sets by name; the file of our own is read when one of them is asked for, not by every command."""

    def __getitem__(self, name: str) -> Cruse1998:
        return _PAPER[name] if name in _PAPER else _own()[name]

    def __iter__(self) -> Iterator[str]:
        yield from _PAPER
        yield from _own()

    def __len__(self) -> int:
        return len(_PAPER) + len(_own())

    def __repr__(self) -> str:
        return repr(dict(self))


PRESETS: Mapping[str, Cruse1998] = _Presets()
"""The paper's sets, none, and our own: `own-0.1` ... `own-0.9` for one velocity each, `own` for 0.1 to 0.5 at once;
`robust-0.1`, `robust-0.3` and `robust-0.7`, good over all `hexmj.variants`; and `lasting-0.1` ... `lasting-0.9` and
`lasting`, which were searched under that reading and walk by it."""


@cache
def _own() -> dict[str, Cruse1998]:
    tables = {name: {key: one[key] for key in one.keys() - {"command", SEARCHED}} for name, one in own_tables().items()}
    return {name: read_network(table, f"{OWN.name} [{name}]", name) for name, table in tables.items()}


@cache
def own_tables() -> dict[str, Any]:
    """What the file tells of each set of our own: its command, on which starts it was searched, and its weights."""
    return read_toml(OWN)
