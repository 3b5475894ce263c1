"""Sources of a user's modules as this program ran them, whatever became of the files since.

They are noted as modules run, from the first import of this package on; those that ran before are read then.
"""

import ast
import os
import sys
import sysconfig
from collections.abc import Collection, Iterable, Mapping, Sequence
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

DATA = (
    *(".toml", ".xml", ".json", ".jsonl", ".yaml", ".yml", ".csv", ".tsv", ".txt"),
    *(".npy", ".npz", ".pt", ".pkl"),
)
"""Ends of the names of data files, in small letters or capitals."""

DEEPEST = 4
"""Number of folders that may be joined, one text after the other, to where a module lies."""

COMPILED = (*BYTECODE_SUFFIXES, *EXTENSION_SUFFIXES)
"""Ends of the names of modules without a source."""

_RUN: dict[str, list[bytes]] = {}
"""File -> what ran of it, each version once."""

_STALE: set[str] = set()
"""Files of which bytecode ran that is not of their source, which Python knows by its time and size alone."""

_TEXTS: dict[str, set[str]] = {}
"""File -> texts in what ran of it that may name folders."""

_READ: dict[tuple[str, str], list[Any]] = {}
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


def is_users(file: str) -> bool:
    """Whether a file is a user's own: neither of Python, nor installed, nor of this package."""
    return not file.startswith(_NOT_ITS_USERS) and INSTALLED.isdisjoint(Path(file).parts)


def texts(nodes: Iterable[ast.AST]) -> list[str]:
    """Texts in the nodes of a source that may name a file or folder, alone or after a folder in a formatted one."""
    whole = [one.value for one in nodes if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    return sorted({part for one in whole if one.strip("/") for part in (one, one.lstrip("/"))})


def data_names(texts: Iterable[str]) -> list[str]:
    """The data files among texts."""
    return [one for one in texts if one.lower().endswith(DATA)]


def data_folders(file: Path) -> list[Path]:
    """Where the data files of a module of the user's own lie."""
    return [file.parent, Path.cwd()]


def named_folders(file: Path, texts: Collection[str]) -> dict[Path, str]:
    """Further folders for data files of a module: where it really lies if it is a link, and what texts of it name
    there, beside it, in the current folder, or one within another; each with the way to it, which is the same wherever
    the module lies.
    """
    ways = {"beside": str(file.parent), "here": os.getcwd(), "real": os.path.dirname(os.path.realpath(file))}
    found = dict[str, str]()
    for _ in range(1 + DEEPEST):
        real = {os.path.realpath(folder): way for way, folder in reversed(ways.items()) if os.path.isdir(folder)}
        new = {folder: way for folder, way in real.items() if folder not in found}
        found |= new
        ways = {f"{way}/{text}": os.path.join(folder, text) for folder, way in new.items() for text in texts}
    first = {os.path.realpath(one) for one in data_folders(file)}
    return {Path(one): found[one] for one in sorted(found, key=found.__getitem__) if one not in first}


def folders_named_in(file: Path) -> dict[Path, str]:
    """As of `named_folders`, those that what ran of a module names."""
    return named_folders(file, sorted(_TEXTS.get(str(file), ())))


def data(file: Path, name: str, folders: Sequence[Path], more: Mapping[Path, str]) -> str:
    """A digest of what a data file holds in each folder, and of what it held when the file that names it ran, if that
    was something else; empty if it is in none and was not.

    Args:
        file: that names it.
        name: of the data file.
        folders: that count without it, too.
        more: folders that count if it is there, with the way to each.
    """
    now = _held(name, folders, more)
    then = _READ.get((str(file), name), now)
    return digest(repr(now if then == now else (now, then)).encode()) if any((*now, *then)) else ""


def _held(name: str, folders: Sequence[Path], more: Mapping[Path, str]) -> list[Any]:
    """What a file holds in each folder, as a digest, empty where there is none to be read; and where more hold it."""
    first = [folder / name for folder in folders]
    further = {way: path for folder, way in more.items() if (path := folder / name) not in first}
    within = [(way, held) for way, path in further.items() if (held := _digest_if_any(path))]
    return [*map(_digest_if_any, first), *within]


def _digest_if_any(path: Path) -> str:
    try:
        return digest_of(path)
    except InputError:
        return ""


def _note(file: Any, runs: CodeType | None = None) -> None:
    """Note the file of a module, and of what runs whether it is bytecode of another source; not known of what ran."""
    if not isinstance(file, str) or file.endswith(COMPILED) or not is_users(file):
        return
    path = Path(file)
    with suppress(OSError, SyntaxError, ValueError, EOFError, TypeError):  # of what is no file, or none of Python
        if (source := path.read_bytes()) not in (versions := _RUN.setdefault(file, [])):
            versions.append(source)
        named = texts(ast.walk(parsed(source)))
        _TEXTS.setdefault(file, set()).update(named)
        if names := data_names(named):
            folders = data_folders(path), named_folders(path, named)
            for name in names:
                _READ.setdefault((file, name), _held(name, *folders))
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
