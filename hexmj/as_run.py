"""Sources of a user's modules as this program ran them, whatever became of the files since.

They are noted as modules run, from the first import of this package on; those that ran before are read then.
"""

import ast
import os
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib.machinery import BYTECODE_SUFFIXES, EXTENSION_SUFFIXES, SourceFileLoader
from importlib.util import cache_from_source
from pathlib import Path
from types import CodeType
from typing import Any

from hexmj.errors import InputError
from hexmj.files import digest, digest_of
from hexmj.parsing import compiled, parsed

INSTALLED = {"site-packages", "dist-packages"}
"""Folders of installed packages, this Python's own or another's."""

_NOT_ITS_USERS = tuple(
    f"{folder}{os.sep}"
    for folder in (
        *(sysconfig.get_path(one) for one in ("stdlib", "platstdlib", "purelib", "platlib")),
        Path(__file__).parent,
    )
)

DATA = (".toml", ".xml", ".json")
"""Ends of the names of data files."""

COMPILED = (*BYTECODE_SUFFIXES, *EXTENSION_SUFFIXES)
"""Ends of the names of modules without a source."""

_RUN: dict[str, list[bytes]] = {}
"""File -> what ran of it, each version once."""

_STALE: set[str] = set()
"""Files of which bytecode ran that is not of their source, which Python knows by its time and size alone."""

_READ: dict[tuple[str, str], list[str]] = {}
"""File, and a data file that it names -> what was held where that is looked for when the file first ran: it may have
read it then."""


def as_run(file: Path, stamp: str = "") -> bytes | None:
    """The source of a file as it ran; None of one that did not.

    Args:
        file: of Python.
        stamp: the first digits of the digest of the version that is meant.

    Raises:
        InputError: it ran in several versions, and none or more than one is meant; or as none that it has.
    """
    if str(file) in _STALE:
        raise InputError(f"{file} ran as {cache_from_source(file)} keeps it, not as it is; delete that and start again")
    if (versions := _RUN.get(str(file))) is None:
        return None
    meant = [one for one in versions if digest(one).startswith(stamp)]
    if len(meant) != 1:
        raise InputError(f"{file} was edited while this program used it; start it again")
    return meant[0]


def data_names(nodes: Iterable[ast.AST]) -> list[str]:
    """The data files that the nodes of a source name, in texts of their own or after a folder in a formatted one."""
    texts = [one.value for one in nodes if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    return sorted({part for one in texts if one.endswith(DATA) for part in (one, one.lstrip("/"))})


def data_folders(file: Path) -> list[Path]:
    """Where the data files of a module of the user's own lie."""
    return [file.parent, Path.cwd()]


def data(file: Path, name: str, folders: Sequence[Path]) -> str:
    """A digest of what a data file holds in each folder, and of what it held when the file that names it ran, if that
    was something else; empty if it is in none and was not."""
    now = _held(name, folders)
    then = _READ.get((str(file), name), now)
    return digest(repr(now if then == now else (now, then)).encode()) if any((*now, *then)) else ""


def _held(name: str, folders: Sequence[Path]) -> list[str]:
    """What a file holds in each folder, as a digest; empty where there is none to be read."""
    held = []
    for folder in folders:
        try:
            held.append(digest_of(folder / name))
        except InputError:
            held.append("")
    return held


def _note(file: Any, runs: CodeType | None = None) -> None:
    """Note the file of a module, and of what runs whether it is bytecode of another source; not known of what ran."""
    if not isinstance(file, str) or file.endswith(COMPILED) or file.startswith(_NOT_ITS_USERS):
        return
    if not INSTALLED.isdisjoint((path := Path(file)).parts):
        return
    with suppress(OSError, SyntaxError, ValueError, EOFError, TypeError):  # of what is no file, or none of Python
        if (source := path.read_bytes()) not in (versions := _RUN.setdefault(file, [])):
            versions.append(source)
        for name in data_names(ast.walk(parsed(source))):
            _READ.setdefault((file, name), _held(name, data_folders(path)))
        if os.path.exists(cache_from_source(file)):
            kept = _what_runs(SourceFileLoader(file, file).get_code(file))
            if kept != _what_runs(compiled(source, file)) and (runs is None or kept == _what_runs(runs)):
                _STALE.add(file)


def _what_runs(one: Any) -> Any:
    """A code, or a constant of one, as what it does: of any line numbers, and with a NaN that is equal to itself."""
    if isinstance(one, CodeType):
        counts = one.co_argcount, one.co_posonlyargcount, one.co_kwonlyargcount, one.co_flags
        names = one.co_name, one.co_qualname, one.co_names, one.co_varnames, one.co_freevars, one.co_cellvars
        return one.co_code, one.co_exceptiontable, counts, names, _what_runs(one.co_consts)
    if isinstance(one, tuple):
        return tuple(_what_runs(inner) for inner in one)
    return type(one), sorted(map(repr, one)) if isinstance(one, frozenset) else repr(one)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "exec" and getattr(arguments[0], "co_name", "") == "<module>":
        _note(arguments[0].co_filename, arguments[0])


for _module in list(sys.modules.values()):
    _note(getattr(_module, "__file__", None))
sys.addaudithook(_hear)
