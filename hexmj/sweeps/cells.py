"""A cell: a pure function of plain settings, named by them and by the code that computes it."""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from typing import Any

from hexmj.checks import check_types
from hexmj.errors import InputError
from hexmj.files import digest
from hexmj.sweeps.code import code
from hexmj.sweeps.plain import classes, label, plain

EXECUTION = ("threads", "progress")
"""Arguments that say how a cell is computed, not what: a function that has them is given them by the sweep."""


@dataclass(frozen=True)
class Cell:
    """A piece of a sweep, which depends on nothing but its settings."""

    name: str
    """For people: begins the name of its file."""
    function: Callable[..., Any]
    """Of a module, or a method of a frozen dataclass, whose fields are settings too; gives an `xarray.Dataset`."""
    settings: Mapping[str, Any]
    """Its arguments, each as `plain` takes it; objects rather than their names, so that their code is known."""
    work: float = 1.0
    """Relative cost, for the progress bar."""

    def __post_init__(self) -> None:
        check_types(self)
        if not 0 < self.work < math.inf:
            raise InputError(f"work = {self.work} of {self.name}; expected a finite number above 0")
        if taken := [name for name in EXECUTION if name in self.settings]:
            raise InputError(f"setting {taken[0]!r} of {self.name}; expected it to be left to the sweep")
        try:
            signature(self.function).bind_partial(**self.settings)
        except TypeError as error:
            raise InputError(f"settings of {self.name}: {error}; expected arguments of its function") from None

    def compute(self, *first: Any, **execution: Any) -> Any:
        """What the function gives, told how to compute it as far as it asks."""
        asked = signature(self.function).parameters
        return self.function(*first, **self.settings, **{key: execution[key] for key in execution if key in asked})

    def record(self) -> str:
        """All that the cell depends on, as JSON: function, settings, sources and versions.

        Raises:
            InputError: a setting, or the function, is nothing that can be written down.
        """
        owner = getattr(self.function, "__self__", None)
        if not hasattr(self.function, "__qualname__"):
            raise InputError(f"{self.function!r:.80} of {self.name}; expected a function or a method")
        made = code(frozenset(one.__module__ for one in (self.function, *classes([self.settings, owner]))))
        told = {"function": label(self.function), "of": plain(owner), "settings": plain(self.settings)}
        return json.dumps(told | {"sources": made.sources, "versions": made.versions}, sort_keys=True)

    def stem(self, record: str) -> str:
        """The name of its file without the ending."""
        return f"{re.sub(r'[^A-Za-z0-9.+-]+', '-', self.name)[:100].lstrip('.-')}-{digest(record.encode())}"


def check_unedited(cell: Cell, record: str) -> None:
    """Refuse what a cell has given if something that it depends on was edited since its record was made.

    Raises:
        InputError: it was.
    """
    if (now := cell.record()) != record:
        raise InputError(
            f"{cell.name}: {difference(record, now)} was edited while it was in use; start again, and let fields"
            " name files that are read, not written"
        )


def difference(one: str, other: str) -> str:
    """The first thing in which two records differ, by the names that lead to it."""
    names, a, b = list[str](), json.loads(one), json.loads(other)
    while isinstance(a, dict) and isinstance(b, dict):
        names.append(next(name for name in sorted({*a, *b}) if a.get(name) != b.get(name)))
        a, b = a.get(names[-1]), b.get(names[-1])
    return " of ".join(reversed(names))
