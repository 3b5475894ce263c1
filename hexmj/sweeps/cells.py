"""A cell: a pure function of plain settings, named by them and by the code that computes it."""

import json
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any

from hexmj.checks import check_types
from hexmj.errors import InputError
from hexmj.storage.files import digest, digest_of
from hexmj.sweeps.code import code, files_of_classes, sources_of_users, sources_to_edit
from hexmj.sweeps.named_data import OPEN_BY_THEMSELVES, data_of_users
from hexmj.sweeps.plain_settings import classes, label, named_files, plain, stands_there
from hexmj.user_code.opened_files import (
    also_read,
    changed,
    computing,
    doubt,
    heard,
    opened_by,
    seen,
    spelled,
)

EXECUTION = ("threads", "progress")
"""Arguments that say how a cell is computed, not what: a function that has them is given them by the sweep."""

_HERE = "."
"""Stands among files for the folder from which they are looked for, and its path for a digest."""

_THERE = "there"
"""Stands for the digest of a file that a text names and nobody was heard to open: a log, or one that code looks for."""


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
        except ValueError as error:
            raise InputError(f"the function of {self.name}: {error}; expected one that is written in Python") from None
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
        told, modules = self._told(), self._modules()
        made = code(modules)
        unheard, others = data_of_users(modules)
        seen(sources_to_edit(modules))
        seen(unheard | others if OPEN_BY_THEMSELVES & made.versions.keys() else unheard)
        return json.dumps(told | {"sources": made.sources, "versions": made.versions}, sort_keys=True)

    def settings_now(self) -> str:
        """The function and its settings as they are, as JSON; empty if they cannot be written down."""
        with suppress(InputError):
            return json.dumps(self._told(), sort_keys=True)
        return ""

    def computing(self) -> AbstractContextManager[None]:
        """While it is computed: what it opens beyond what its settings name is noted."""
        return computing(self._told_files(), files_of_classes(self._modules()))

    def tell(self, read: Mapping[str, str], not_kept: str, to_a_cell: bool) -> None:
        """Let those who sweep this one know what it has read, and a cell that does also what its settings name, and
        why it is not kept, unless it is."""
        named = map(spelled, self._told_files() if to_a_cell else ())
        also_read(_beyond({*_files(read), *named}, ()), not_kept, to_a_cell)

    def read(self) -> tuple[dict[str, str], str]:
        """What its code may have read that its record does not tell, file -> digest, empty of one that is not there, or
        `_THERE`; with the folder from which they were looked for, `_HERE`.  And why it cannot be kept, in a sentence,
        else empty."""
        try:
            sources, told = sources_of_users(self._modules()), self._told_files()
            if swept := doubt(sources):
                return {}, f"{self.name} is not kept: {swept}"
            unheard, named = data_of_users(self._modules())
            sources |= (to_edit := sources_to_edit(self._modules()))
            files = _beyond(opened_by(sources) | unheard | heard(named), {*told, *sources})
            if ran := sorted(file for file in files if file.endswith(".py")):
                return {}, (
                    f"{self.name} is not kept: its code opens or runs {ran[0]}, of which an edit would not be noticed;"
                    " expected an import, or a field that names it"
                )
            seen(files)
            read = dict.fromkeys(_beyond(named, told), _THERE) | {file: _held(file) for file in files}
        except InputError as error:
            return {}, f"{self.name} is not kept: {error}"
        if outdated := changed({*told, *files, *to_edit}):
            since = f"{outdated[0]} has changed since it was opened first, and code may remember it"
            return {}, f"{self.name} is not kept: {since}; start the program again"
        return (read | {_HERE: os.getcwd()} if read else {}), ""

    def would_read(self, read: Mapping[str, str]) -> bool:
        """Whether its code would read today what it has read, or may remember from earlier in this program."""
        try:
            same = all(holds(*one) for one in read.items())
            named = set[str]().union(*data_of_users(self._modules()))
        except InputError:
            return False
        return same and not changed(_files(read)) and not _beyond(named - read.keys(), self._told_files())

    def _told_files(self) -> set[Path]:
        """Files that its settings name."""
        return set(named_files([*self.settings.values(), self._owner]))

    def _modules(self) -> frozenset[str]:
        return frozenset(one.__module__ for one in (self.function, *classes([self.settings, self._owner])))

    def _told(self) -> dict[str, Any]:
        if not hasattr(self.function, "__qualname__"):
            raise InputError(f"{self.function!r:.80} of {self.name}; expected a function or a method")
        if "<" not in self.function.__qualname__ and not stands_there(self.function):
            raise InputError(
                f"{self.name}: {label(self.function)} is not what its module has under that name; expected a function"
                " of a module, not one that was wrapped elsewhere"
            )
        return {
            "function": label(self.function),
            "of": plain(self._owner, exact=True),
            "settings": {key: plain(one, exact=True) for key, one in self.settings.items()},
        }

    @property
    def _owner(self) -> Any:
        """What the function is a method of, if it is one."""
        return getattr(self.function, "__self__", None)

    def stem(self, record: str) -> str:
        """The name of its file without the ending."""
        return f"{re.sub(r'[^A-Za-z0-9.+-]+', '-', self.name)[:100].lstrip('.-')}-{digest(record.encode())}"


def check_unchanged(cell: Cell, before: str, now: str) -> None:
    """Refuse what a cell has given if something that it depends on has changed since, as its records tell.

    Raises:
        InputError: it has.
    """
    if not before or now == before:
        return
    if not now:
        cell.record()  # which says what cannot be written down
    raise InputError(
        f"{cell.name}: {difference(before, now)} has changed while it was in use; start again, with fields that stay as"
        " they are and name files that are read, not written"
    )


def unlike(name: str, before: dict[str, str], read: Mapping[str, str]) -> str:
    """A sentence on a result of which one part has read a file as it was, and another one as it is; else empty.

    Args:
        name: of the part that has read last.
        before: what the others have read, see `Cell.read`; the last one's is added.
        read: by the last one.
    """
    found = [file for file in sorted(_files(read)) if before.setdefault(file, read[file]) != read[file]]
    if not found:
        return ""
    return f"{found[0]} has changed before {name} read it, and after others did: what comes of both is mixed"


def _files(read: Mapping[str, str]) -> set[str]:
    """Those that were opened of what a cell has read."""
    return {file for file, held in read.items() if held != _THERE and file != _HERE}


def _beyond(files: set[str], told: Iterable[str | Path]) -> set[str]:
    """Some files without those that are told, and without folders."""
    known = {os.path.realpath(file) for file in told}
    return {file for file in files if os.path.realpath(file) not in known and not os.path.isdir(file)}


def holds(file: str, digest: str) -> bool:
    """Whether a file is what was read, as `Cell.read` tells it.

    Raises:
        InputError: it cannot be read.
    """
    if file == _HERE:
        return digest == os.getcwd()
    return os.path.exists(file) if digest == _THERE else digest == _held(file)


def _held(file: str) -> str:
    """A digest of a file; empty if it is not there."""
    return digest_of(Path(file)) if os.path.exists(file) else ""


def difference(one: str, other: str) -> str:
    """The first thing in which two records differ, by the names that lead to it."""
    names, a, b = list[str](), json.loads(one), json.loads(other)
    while isinstance(a, dict) and isinstance(b, dict):
        names.append(next(name for name in sorted({*a, *b}) if a.get(name) != b.get(name)))
        a, b = a.get(names[-1]), b.get(names[-1])
    return " of ".join(reversed([name for name in names if name != "of" and not name.startswith("\0")]))
