"""Sources of a user's modules as this program ran them, whatever became of the files since; of those that are
installed, or compiled, their sizes and times.

They are noted as modules run, from the first import of this package on; those that ran before are read then.
"""

import os
import sys
import sysconfig
from collections.abc import Iterable
from contextlib import suppress
from importlib.machinery import BYTECODE_SUFFIXES, EXTENSION_SUFFIXES, SourceFileLoader
from importlib.util import cache_from_source
from pathlib import Path
from types import CodeType
from typing import Any

from hexmj.errors import InputError
from hexmj.storage.files import digest
from hexmj.user_code.parsing import compiled

_INSTALLED = {"site-packages", "dist-packages"}
"""Folders of installed packages, this Python's own or another's."""

SCRIPTS = {"__main__", "__mp_main__"}
"""What a script is called where it runs, and in the workers that it starts."""

_PACKAGE = Path(__file__).parents[1]
_FOLDERS = *(sysconfig.get_path(one) for one in ("stdlib", "platstdlib", "purelib", "platlib")), _PACKAGE
_NOT_ITS_USERS = (
    *(f"{folder}{os.sep}" for folder in _FOLDERS),
    str(_PACKAGE.parent / "assets" / "stick_insect.xml"),
    str(Path(sysconfig.get_path("stdlib")).with_name(f"python{sysconfig.get_config_var('py_version_nodot')}.zip")),
)

COMPILED = (*BYTECODE_SUFFIXES, *EXTENSION_SUFFIXES)
"""Ends of the names of modules without a source."""

RUN: dict[str, list[bytes]] = {}
"""File -> what ran of it, each version once."""

_RAN: dict[str, dict[str, tuple[int, ...]]] = {}
"""Installed package or module, or compiled file of a user's own -> its files that ran, each with its size and time."""

_STALE: set[str] = set()
"""Files of which bytecode ran that is not of their source, which Python knows by its time and size alone."""


def as_run(file: Path, module: str) -> bytes | None:
    """The source of a file as it ran; None of one that did not.

    Args:
        file: of Python.
        module: its name; that of a loaded file tells by a digest which version is meant.

    Raises:
        InputError: it ran in several versions, and none or more than one is meant; or as none that it has.
    """
    if str(file) in _STALE:
        raise InputError(f"{file} ran as {cache_from_source(file)} keeps it, not as it is; delete that and start again")
    if (versions := RUN.get(str(file))) is None:
        return None
    meant = [one for one in versions if digest(one).startswith(module.partition("@")[2])]
    if len(meant) != 1:
        raise InputError(f"{file} was edited while this program used it; start it again")
    return meant[0]


def made_anew(names: Iterable[str]) -> str:
    """A file of some installed packages, or compiled ones, that is another than the one that ran; empty if there is
    none."""
    ran = (one for name in names for one in _RAN.get(name, {}).items())
    return next((file for file, then in ran if _size_and_time(file) != then), "")


def is_installed(file: str | Path) -> bool:
    """Whether it lies among installed packages, this Python's own or another's."""
    return bool(within_installed(file))


def installed_package(file: str) -> str:
    """The name of the installed package, or module, that a file belongs to; empty if it is none's."""
    return within_installed(file).partition(os.sep)[0].partition(".")[0]


def within_installed(file: str | Path) -> str:
    """The path of a file from the folder of installed packages on; empty if it lies in none."""
    parts = Path(file).parts
    begin = max((i for i, one in enumerate(parts) if one in _INSTALLED), default=len(parts))
    return os.sep.join(parts[begin + 1 :])


def is_users(file: str) -> bool:
    """Whether a file is a user's own: neither of Python, nor installed, nor of this package."""
    return not file.startswith(_NOT_ITS_USERS) and not is_installed(file)


def _note(file: Any, runs: CodeType | None = None) -> None:
    """Note the file of a module, and of what runs whether it is bytecode of another source; not known of what ran."""
    if not isinstance(file, str):
        return
    file = str(Path(file))  # without ./ and //, which a path of modules may have
    package = installed_package(file)
    if package or file.endswith(COMPILED):
        _RAN.setdefault(package or file, {}).setdefault(file, _size_and_time(file))
    if file.endswith(COMPILED) or not is_users(file):
        return
    with suppress(OSError, SyntaxError, ValueError, EOFError, TypeError):  # of what is no file, or none of Python
        if (source := Path(file).read_bytes()) not in (versions := RUN.setdefault(file, [])):
            versions.append(source)
        if os.path.exists(cache_from_source(file)):
            kept = _what_runs(SourceFileLoader(file, file).get_code(file))
            if kept != _what_runs(compiled(source, file)) and (runs is None or kept == _what_runs(runs)):
                _STALE.add(file)


def _size_and_time(file: str) -> tuple[int, ...]:
    """What tells whether a file is another one; nothing of one that is not there.  When its name or rights changed does
    not count: installers link the files of one environment into another."""
    with suppress(OSError, ValueError):
        told = os.stat(file)
        return told.st_size, told.st_mtime_ns
    return ()


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
    elif event == "import" and len(arguments) > 1:
        _note(arguments[1])  # of what is compiled; of others nobody knows a file yet


for _module in list(sys.modules.values()):
    _note(getattr(_module, "__file__", None))

BEFORE = frozenset(RUN)
"""Files of modules that ran before anybody noted them."""

sys.addaudithook(_hear)
