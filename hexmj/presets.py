"""Models by name: presets, those of the paper and our own, and parameter files (TOML)."""

import tomllib
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from hexmj.errors import InputError
from hexmj.parameters import HWS, LDVS, NEIGHBOURS, UNCOORDINATED, Model, Symmetric, Weights, pairs

OWN = Path(__file__).with_name("own.toml")
"""Sets of our own, with the commands that found or built them."""


def load_model(name: str) -> Model:
    """A preset by its name, or the model in a TOML file.

    The file holds either a table ``[symmetric]`` with fields of `Symmetric`, or tables
    ``[weights.p1]`` ... ``[weights.p4]`` with keys ``"d,e"`` (the paper's leg numbers).

    Raises:
        InputError: no such preset or file, or a key, type or value that makes no sense.
    """
    if name in PRESETS:
        return PRESETS[name]
    path = Path(name)
    try:
        exists = path.is_file()
    except OSError:
        exists = False
    if not exists:
        raise InputError(f"model {name!r} is neither a preset ({', '.join(PRESETS)}) nor a TOML file that exists")
    try:
        table = tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from None
    if list(table) == ["symmetric"]:
        return Symmetric(**_numbers(table["symmetric"], [f.name for f in fields(Symmetric)], f"{path} [symmetric]"))
    if list(table) == ["weights"] and isinstance(table["weights"], dict):
        return _read_weights(table["weights"], str(path))
    raise InputError(f"{path} holds {', '.join(table) or 'nothing'}; expected one table: [symmetric] or [weights.*]")


def model_title(name: str) -> str:
    """What a model is called in titles: a preset's name, or that of its file."""
    return name if name in PRESETS else Path(name).stem


def model_toml(model: Model) -> str:
    """The text of a TOML file that `load_model` reads to the same bits; general weights that are 0 are left out."""
    if isinstance(model, Symmetric):
        return "\n".join(["[symmetric]", *(f"{key} = {value!r}" for key, value in asdict(model).items())]) + "\n"
    lines = []
    for kind in NEIGHBOURS:
        matrix = getattr(model, kind)
        lines += ["", f"[weights.{kind}]"]
        lines += [f'"{d + 1},{e + 1}" = {matrix[d, e].item()!r}' for d, e in pairs(kind) if matrix[d, e]]
    return "\n".join(lines[1:]) + "\n"


def _read_weights(table: dict[str, object], where: str) -> Weights:
    if unknown := set(table) - set(NEIGHBOURS):
        raise InputError(f"{where}: unknown table [weights.{min(unknown)}]; valid names: {', '.join(NEIGHBOURS)}")
    matrices = {kind: np.zeros((6, 6)) for kind in NEIGHBOURS}
    for kind, entries in table.items():
        keys = {f"{d + 1},{e + 1}": (d, e) for d, e in pairs(kind)}
        for key, value in _numbers(entries, list(keys), f"{where} [weights.{kind}]").items():
            matrices[kind][keys[key]] = value
    return Weights(**matrices)


def _numbers(table: object, valid: list[str], where: str) -> dict[str, float]:
    """The entries of a TOML table, all of which must be numbers with valid keys."""
    if not isinstance(table, dict):
        raise InputError(f"{where} is {table!r}; expected a table with the keys {', '.join(valid)}")
    for key, value in table.items():
        if key not in valid:
            raise InputError(f"{where}: unknown key {key!r}; valid keys: {', '.join(valid)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e100:
            raise InputError(f"{where}: {key} = {str(value)[:40]!r}; expected a number, finite and below 1e100")
    return {key: float(value) for key, value in table.items()}


def _own() -> dict[str, Model]:
    """The sets of `OWN` by their names."""
    table = tomllib.loads(OWN.read_text(encoding="utf-8"))
    return {name: _read_weights(entry["weights"], f"{OWN.name} [{name}]") for name, entry in table.items()}


PRESETS: dict[str, Model] = {"hws": HWS, "ldvs": LDVS, "uncoordinated": UNCOORDINATED} | _own()
"""The paper's sets, none, and our own: `own-0.1` ... `own-0.9` for one velocity each, `own` for 0.1 to 0.5 at once."""
