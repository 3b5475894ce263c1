"""Two files of results beside each other: which of their numbers are equal to the last bit, and how far others are."""

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexmj.errors import InputError
from hexmj.storage import netcdf
from hexmj.storage.files import SEARCHED, STAMP, read_bytes, read_text, read_toml, unsealed

ATTRIBUTES = "(attributes)"
"""Stands for all attributes of a NetCDF file and of its variables."""

STRUCTURE = "(structure)"
"""Stands for the keys and lists of a JSON or TOML file, whatever they hold; of a NetCDF file for the axes of each
variable in their order, and for which variables are coordinates."""


@dataclass(frozen=True)
class Compared:
    """A variable of a file beside that of another."""

    name: str
    """Of the variable; for JSON and TOML the keys that lead to it, for all items of a list at once.  One that could be
    taken for several, or for what stands for a whole file, is in quotation marks."""
    values: int
    """How many it has."""
    differ: int
    """How many of them are not equal to the last bit."""
    most: float | None
    """Greatest distance of two that differ, infinite where one alone is a finite number; None where none differ, or
    texts do."""
    misfit: str = ""
    """Why the two cannot be compared value by value: only one is there, or of another shape or type."""


def holds_numbers(name: str) -> bool:
    """Whether a file of this name is one that can be compared."""
    return Path(name).suffix in _READERS


def check_readable(path: Path) -> None:
    """Refuse a file that cannot be compared.

    Raises:
        InputError: it cannot be read.
    """
    _READERS[path.suffix](path)


def compared(then: Path, now: Path) -> list[Compared]:
    """Every variable of a file beside the same one of another file.

    Raises:
        InputError: one cannot be read.
    """
    before, after = (_READERS[path.suffix](path) for path in (then, now))
    lone = [(name, one.size, "not there now") for name, one in before.items() if name not in after]
    lone += [(name, one.size, "not there then") for name, one in after.items() if name not in before]
    return [
        *(_beside(name, one, after[name]) for name, one in before.items() if name in after),
        *(Compared(name, size, size, None, misfit) for name, size, misfit in lone),
    ]


def _beside(name: str, then: np.ndarray, now: np.ndarray) -> Compared:
    for what, before, after in (("shape", then.shape, now.shape), ("type", then.dtype, now.dtype)):
        if before != after:
            return Compared(name, then.size, then.size, None, f"{what} {before} then, {after} now")
    unlike = _unlike(then.ravel(), now.ravel())
    pairs = list(zip(then.ravel()[unlike], now.ravel()[unlike], strict=True))
    distances = [_distance(*pair) for pair in pairs if all(isinstance(one, int | float | np.number) for one in pair)]
    return Compared(name, then.size, len(pairs), max(distances, default=None))


def _unlike(then: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Which values of two rows of one type differ in any bit."""
    if then.dtype == object:  # texts, or numbers of JSON, whose digits say every bit
        return np.array([repr(a) != repr(b) for a, b in zip(then, now, strict=True)], dtype=bool)
    before, after = (np.ascontiguousarray(one).view(np.uint8).reshape(one.size, one.itemsize) for one in (then, now))
    return np.any(before != after, axis=1)


def _distance(a: Any, b: Any) -> float:
    """Between two numbers whose bits differ: 0.0 of both zeros, infinite where one alone is finite."""
    distance = abs(float(a) - float(b))
    return distance if np.isfinite(distance) else 0.0 if np.isnan(a) and np.isnan(b) else np.inf


def _of_netcdf(path: Path) -> dict[str, np.ndarray]:
    """Variables, all attributes as one, and all axes as one text; with the seal or without it, since a number may have
    been changed."""
    content = read_bytes(path)
    data = netcdf.decode(unsealed(content) or content, f"{path} cannot be read as NetCDF")
    variables = {str(name): one for name, one in sorted(data.variables.items())}
    owners: dict[tuple[str, ...], Any] = {(): data} | {(name,): one for name, one in variables.items()}
    attributes = [
        f"{_name(*of, str(key))} = {_exact(value)}"
        for of, one in owners.items()
        for key, value in sorted(one.attrs.items())
    ]
    found = {_name(name): one.values for name, one in variables.items()}
    texts = {name: one.astype(object) for name, one in found.items() if one.dtype.kind not in "biuf"}
    axes = {name: [*map(str, one.dims), name in data.coords] for name, one in variables.items()}
    told = {ATTRIBUTES: attributes, STRUCTURE: [json.dumps(axes, sort_keys=True)]}
    return found | texts | {name: np.array(one, dtype=object) for name, one in told.items()}


def _exact(attribute: Any) -> str:
    """Type and value of a text, a number or a row of them, with all digits; of a text without the digests of files, of
    which manifests tell whether they are the same."""
    array = np.asarray(attribute)
    told = f"{array.tolist()!r} ({array.dtype})"
    return STAMP.sub("", re.sub(r"<U\d+", "text", told)) if array.dtype.kind == "U" else told


def _name(*keys: str) -> str:
    """Keys as one name, which no other keys have."""
    return ".".join(key if re.fullmatch(r'[^."(]+', key) else json.dumps(key) for key in keys)


def _of_json(path: Path) -> dict[str, np.ndarray]:
    try:
        return _gathered(json.loads(read_text(path, 100_000_000)))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as JSON: {error}") from None


def _gathered(table: Any) -> dict[str, np.ndarray]:
    """Values of nested dictionaries and lists by the keys that lead to them, and how they are nested as one text."""
    found: dict[str, list[Any]] = {}
    for keys, value in _leaves(table):
        found.setdefault(_name(*keys), []).append(value)
    found[STRUCTURE] = [json.dumps(_structure(table), sort_keys=True)]
    return {name: np.array(values, dtype=object) for name, values in found.items()}


def _structure(value: Any) -> Any:
    """The same without what dictionaries and lists hold in the end."""
    if isinstance(value, dict):
        return {key: _structure(one) for key, one in value.items()}
    return [_structure(one) for one in value] if isinstance(value, list) else None


def _leaves(value: Any, *keys: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(value, dict):
        for key, one in value.items():
            yield from _leaves(one, *keys, key)
    elif isinstance(value, list):
        for one in value:
            yield from _leaves(one, *keys)
    else:
        yield keys, math.nan if value is None else value  # what JSON has for numbers that are not finite


def _of_toml(path: Path) -> dict[str, np.ndarray]:
    """What was found, but not on which starts, of which older files tell nothing."""
    return _gathered({key: one for key, one in read_toml(path).items() if key != SEARCHED})


_READERS = {".nc": _of_netcdf, ".json": _of_json, ".toml": _of_toml}
"""End of a file's name -> what reads all that it holds, by name."""
