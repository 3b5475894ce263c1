"""Files that a user's code opens, or finds and runs, as it is imported and as cells are computed.

What a cell is named by tells its settings, with the files that they name, and its sources.  What its code reads beyond
these is kept with it.  Opens are noted from the first import of this package on.
"""

import os
import re
import sys
import sysconfig
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from traceback import walk_stack
from types import FrameType
from typing import Any
from urllib.parse import unquote

from hexmj.storage.files import state_of
from hexmj.user_code.sources_as_run import (
    SCRIPTS,
    installed_package,
    is_installed,
    is_users,
    within_installed,
)

_OPENS = "open", "exec", "sqlite3.connect", "ctypes.dlopen"
"""Events of Python's audit hooks whose first argument tells a path."""

_MAKES = "tempfile.mkdtemp", "tempfile.mkstemp"
"""Events of what makes a file, or a folder, to be used and thrown away; the path comes first."""

_URI = re.compile(r"^file:(?://[^/?]*)?([^?]*)(\?.*)?$")
"""Of a database of SQLite."""

_NO_DATA = re.compile(
    r"[/\\](__pycache__|\.(cache|config|git|ipython|jupyter|local|matplotlib|venv))[/\\]"
    r"|\.(egg|dist)-info[/\\]|[/\\](\.part-|dask-scratch-space|torchinductor_|fontlist-v)|\.(py[cod]|nb[ic])$|-[0-9a-f]{12}\.(nc|jsonl)$"
)
"""In paths of what Python, libraries and tools keep of their own, and of kept cells and values."""

_SYSTEMS = "/etc/", "/lib/", "/lib64/", "/proc/", "/sys/", "/usr/lib/", "/usr/share/"
_SYSTEMS += tuple(f"/dev/{one}" for one in ("fd/", "null", "pts", "random", "std", "tty", "urandom", "zero"))

_OURS = f"{Path(__file__).parents[1]}{os.sep}"
_SWEEPS = f"{_OURS}sweeps{os.sep}"
_PYTHONS = f"{sysconfig.get_path('stdlib')}{os.sep}"

_READS_SOURCES = "tokenize.py", "<frozen importlib._bootstrap_external>"
"""Ends of the names of the code that reads sources to import them or to show their lines."""

_WALKERS = "os", "shutil"
"""Modules of Python that open folders by their names within another one."""

_OPENED: dict[str, set[str]] = {}
"""Source, or `_ANYBODY` -> what was opened or ran while a function or module of it was called, if no cell told it."""

_ANYBODY = ""
"""Stands for a source where a thread opens data of which no function is a user's."""

_DOUBTS: dict[str, str] = {}
"""Source -> why something that a cell has swept is not kept, while a function of it was called."""

_COMPUTING: dict[int, tuple[set[str], set[str]]] = {}
"""Thread that computes a cell -> files that the cell tells by itself, as they really are, and those of its classes."""

_NOTHING = set[str](), set[str]()
"""The same of a thread that computes none."""

_TEMPORARY = set[str]()
"""What cells have had made as they were computed, to be used and thrown away."""

_LOGS = set[str]()
"""What was opened to be appended to as a cell was computed."""

_AT_FIRST: dict[str, tuple[int, ...]] = {}
"""File -> its size, time and place on the disk as anybody opened it first, but for a sweep that looks what it holds."""


@contextmanager
def computing(told: Iterable[Path], sources: set[str]) -> Iterator[None]:
    """While this thread computes a cell that tells some files by itself and whose classes stand in some sources."""
    mine = threading.get_ident()
    outer = _COMPUTING.get(mine, _NOTHING)
    _COMPUTING[mine] = {os.path.realpath(file) for file in told}, sources | outer[1]
    try:
        yield
    finally:
        _COMPUTING.pop(mine, None)
        if outer is not _NOTHING:
            _COMPUTING[mine] = outer


def computes() -> bool:
    """Whether this thread computes a cell."""
    return threading.get_ident() in _COMPUTING


def serves() -> bool:
    """Whether this thread computes a cell, or may do something for one."""
    return computes() or (bool(_COMPUTING) and threading.current_thread() is not threading.main_thread())


def opened_by(sources: set[str]) -> set[str]:
    """What the code of some sources, if there are any, has opened, or found and run, and may remember."""
    return set[str]().union(*(_OPENED.get(one, ()) for one in (*sources, _ANYBODY))) if sources else set[str]()


def also_read(files: set[str], not_kept: str, by_a_cell: bool) -> None:
    """Note for whose code is being called what a cell that it has swept has read; and, if a cell has swept it, why it
    is not kept, unless it is."""
    data = {file for file in files if _is_data(file) or _is_installed_data(file)}
    new = {file for file in data if not _counts_by_itself(os.path.realpath(file))}
    whose = _whose(sys._getframe(1))
    for one in whose:
        _OPENED.setdefault(one, set()).update(new)
    if by_a_cell:
        seen(files)
        for one in whose if not_kept else ():
            _DOUBTS.setdefault(one, not_kept)


def doubt(sources: set[str]) -> str:
    """Why cells of the code of some sources are not kept, if one is not that they have swept."""
    return next((_DOUBTS[one] for one in (*sorted(sources), _ANYBODY) if one in _DOUBTS), "") if sources else ""


def seen(files: Iterable[str]) -> None:
    """Note how some files are that code may open where nobody hears it."""
    for file in files:
        _AT_FIRST.setdefault(file, state_of(file))


def heard(files: set[str]) -> set[str]:
    """Those of some files that anybody in this program has opened, but for logs."""
    return {one for one in files if (its := {one, os.path.realpath(one)}) & _AT_FIRST.keys() and not its & _LOGS}


def remembered(file: str) -> bool:
    """Whether this program has opened a file itself, and it is as it was then."""
    return file in _AT_FIRST and _AT_FIRST[file] == state_of(file)


def changed(files: Iterable[Path | str]) -> list[str]:
    """Those of some files that have changed since they were first opened, as which the code may remember them."""
    paths = {path for file in files for path in (spelled(file), os.path.realpath(file))}
    return sorted(file for file in paths & _AT_FIRST.keys() if _AT_FIRST[file] != state_of(file))


def spelled(file: str | Path) -> str:
    """A path from the root on, without dots; but as it is where `..` may lead elsewhere through a link."""
    path = os.path.join(os.getcwd(), file)
    return path if os.pardir in path.split(os.sep) else os.path.normpath(path)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event in _MAKES and _COMPUTING:
        _TEMPORARY.add(os.path.realpath(arguments[0]))
    if event not in _OPENS:
        return
    with suppress(Exception):  # of whoever opens something, wherever in the process
        path: Any = arguments[0]
        if event == "exec":
            path = path.co_filename if path.co_name == "<module>" else None
        lists = event == "open" and arguments[1] is None and sys._getframe(1).f_globals.get("__name__") in _WALKERS
        if lists or not isinstance(path, str | bytes | os.PathLike):
            return  # a folder that is walked through or removed; an open file
        name = os.fsdecode(path)
        if event == "sqlite3.connect" and (uri := _URI.match(name)):
            name = ":memory:" if "mode=memory" in name else unquote(uri[1])
        if name.startswith("<") or name == ":memory:" or (event == "ctypes.dlopen" and os.sep not in name):
            return  # of no file; or the system's linker looks for it
        file = spelled(name)
        opens = event == "open"
        writes = opens and _writes(arguments[2])
        if writes and computes() and arguments[2] & os.O_APPEND:
            _LOGS.add(os.path.realpath(file))
        reads = not (writes or (opens and _reads_a_source(file, sys._getframe(1))))
        if reads and (_is_data(file) or (_is_installed_data(file) and _by_a_user(sys._getframe(1), event, file))):
            may_make = not opens or arguments[2] & os.O_CREAT
            _note(file, sys._getframe(1), read=not may_make or os.path.exists(file))


def _note(file: str, opener: FrameType, read: bool) -> None:
    if _is_of_a_sweep(opener):
        return
    really = os.path.realpath(file)
    if read:
        seen((file, really))
    if _counts_by_itself(really):
        return
    for one in _whose(opener, file):
        _OPENED.setdefault(one, set()).add(file)


def _whose(opener: FrameType, file: str = "") -> set[str]:
    """The sources that may know of what is opened: called functions' and those of the cell that this thread computes;
    `_ANYBODY`, too, where another thread than the main one has none of a user's, unless it looks at sources for no
    cell."""
    found, of_cell = _callers(opener, file), _COMPUTING.get(threading.get_ident(), _NOTHING)[1]
    aside = threading.current_thread() is not threading.main_thread() and (_COMPUTING or not file.endswith(".py"))
    unknown = aside and not of_cell and not any(map(_is_code_of_users, found))
    return found | of_cell | ({_ANYBODY} if unknown else set())


def _counts_by_itself(really: str) -> bool:
    """Whether the cell that this thread computes tells a file, or it was made to be thrown away."""
    told, _ = _COMPUTING.get(threading.get_ident(), _NOTHING)
    return really in told or not _TEMPORARY.isdisjoint((really, *map(str, Path(really).parents)))


def _is_of_a_sweep(opener: FrameType) -> bool:
    """Whether a sweep opens a file for itself, to see what it holds, with nothing between them but Python."""
    for frame, _ in walk_stack(opener):
        by = frame.f_code.co_filename
        if by.startswith(_SWEEPS):
            return True
        if not (by.startswith((_OURS, "<")) or _is_of_python(by)):
            return False
    return False


def _callers(frame: FrameType, file: str = "") -> set[str]:
    """The sources of which functions or modules are being called, but Python's and ours; no script for a `.py` that it
    has this package load, as a controller."""
    found, ours = set[str](), False
    for one, _ in walk_stack(frame):
        by = one.f_code.co_filename
        ours |= by.startswith(_OURS)
        loads = ours and file.endswith(".py") and one.f_globals.get("__name__") in SCRIPTS
        if not (loads or by.startswith((_OURS, "<")) or _is_of_python(by)):
            found.add(os.path.abspath(by))
    return found


_is_code_of_users = cache(is_users)


@cache
def _is_of_python(by: str) -> bool:
    return by.startswith(_PYTHONS) and not is_installed(by)


def _is_data(file: str) -> bool:
    """Whether a path may be one of data of a user's own, or of a module."""
    file = os.path.normpath(file)
    return is_users(file) and not (file.startswith(_SYSTEMS) or _NO_DATA.search(file) or os.path.isdir(file))


def _is_installed_data(file: str) -> bool:
    """Whether a path may be one of data of an installed package, wherever that lies."""
    file = os.path.normpath(file)
    within = within_installed(file)
    is_code = file.startswith(_OURS) or file.endswith(".py") or _NO_DATA.search(f"{os.sep}{within}")
    return bool(within) and not (is_code or os.path.isdir(file))


def _by_a_user(opener: FrameType, event: str, file: str) -> bool:
    """Whether a user's own code opens a file of an installed package, or has it opened, with none of that between them;
    but for libraries, which packages load for one another.
    """
    if event == "ctypes.dlopen":
        return False
    package = installed_package(file)
    for one, _ in walk_stack(opener):
        by = one.f_code.co_filename
        theirs = _is_code_of_users(by) and not by.startswith("<")
        if theirs or one.f_globals.get("__name__") in SCRIPTS:
            return True
        if installed_package(by) == package:
            return False
    return any(one == _ANYBODY or _is_code_of_users(one) for one in _whose(opener, file))


def _reads_a_source(file: str, by: FrameType) -> bool:
    return file.endswith(".py") and by.f_code.co_filename.endswith(_READS_SOURCES)


def _writes(flags: int) -> bool:
    """Whether a file is opened to be written, not to be read."""
    return bool(flags & (os.O_WRONLY | os.O_TRUNC | os.O_EXCL))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_COMPUTING.clear)
sys.addaudithook(_hear)
