"""Files that a user's code opens, or finds and runs, as it is imported and as cells are computed.

What a cell is named by tells its settings, with the files that they name, and its sources.  What its code reads beyond
these is kept with it.  Opens are noted from the first import of this package on.
"""

import os
import re
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from traceback import walk_stack
from types import FrameType
from typing import Any
from urllib.parse import unquote

from hexmj.user_code.sources_as_run import is_users

_PATH = {"open": 0, "exec": 0, "sqlite3.connect": 0, "ctypes.dlopen": 0}
"""Event of Python's audit hooks -> which of its arguments tells the path."""

_URI = re.compile(r"^file:(?://[^/?]*)?([^?]*)(\?.*)?$")
"""Of a database of SQLite."""

_NO_DATA = re.compile(
    r"[/\\](__pycache__|\.(cache|config|git|ipython|jupyter|local|matplotlib|venv))[/\\]"
    r"|\.(egg|dist)-info[/\\]|[/\\]\.part-|\.(py[cod]|nb[ic])$|-[0-9a-f]{12}\.(nc|jsonl)$"
)
"""In paths of what Python, libraries and tools keep of their own, and of kept cells and values."""

_SYSTEMS = "/etc/", "/lib/", "/lib64/", "/proc/", "/sys/", "/usr/lib/", "/usr/share/"
_SYSTEMS += tuple(f"/dev/{one}" for one in ("fd/", "null", "pts", "random", "std", "tty", "urandom", "zero"))

_OURS = f"{Path(__file__).parents[1]}{os.sep}"
_SWEEPS = f"{_OURS}sweeps{os.sep}"

_READS_SOURCES = "tokenize.py", "<frozen importlib._bootstrap_external>"
"""Ends of the names of the code that reads sources to import them or to show their lines."""

_WALKERS = "os", "shutil"
"""Modules of Python that open folders by their names within another one."""

_SCRIPTS = "__main__", "__mp_main__"
"""Names of a script where it runs, and in the workers that it starts."""

_OPENED: dict[str, set[str]] = {}
"""Source -> what was opened or ran while it was imported or called, if no cell told it."""

_COMPUTING: dict[int, set[str]] = {}
"""Thread that computes a cell -> what was opened or ran meanwhile."""

_AT_FIRST: dict[str, tuple[int, ...]] = {}
"""File -> its size and times as anybody opened it first, but for a sweep that looks what it holds."""


@contextmanager
def heard() -> Iterator[set[str]]:
    """What this thread, or one of nobody's, opens or runs meanwhile."""
    mine = threading.get_ident()
    outer, opened = _COMPUTING.get(mine), set[str]()
    _COMPUTING[mine] = opened
    try:
        yield opened
    finally:
        del _COMPUTING[mine]
        if outer is not None:
            outer |= opened
            _COMPUTING[mine] = outer


def untold(opened: set[str], sources: set[str], told: Iterable[Path]) -> set[str]:
    """Files that some code has opened, or found and run, beyond its sources and what its cell tells.

    Args:
        opened: while the cell was computed; what of it nobody tells the code may remember for the next.
        sources: its files.
        told: other files that the cell's name tells.
    """
    known = {os.path.realpath(file) for file in (*sources, *told)}

    def beyond(files: set[str]) -> set[str]:
        return {file for file in files if os.path.realpath(file) not in known and not os.path.isdir(file)}

    found, earlier = beyond(opened), beyond(set[str]().union(*(_OPENED.get(file, ()) for file in sources)))
    for file in sources:
        _OPENED.setdefault(file, set()).update(found)
    return found | earlier


def heard_too(files: Iterable[str]) -> None:
    """Note for the cell that this thread computes what another one has read that it takes as it is kept."""
    _COMPUTING.get(threading.get_ident(), set()).update(files)


def seen(files: Iterable[str]) -> None:
    """Note how some files are that code may open where nobody hears it."""
    for file in files:
        _AT_FIRST.setdefault(file, _stamp(file))


def remembered(file: str) -> bool:
    """Whether this program has opened a file itself, and it is as it was then."""
    return file in _AT_FIRST and _AT_FIRST[file] == _stamp(file)


def changed(files: Iterable[Path | str]) -> list[str]:
    """Those of some files that have changed since they were first opened, as which the code may remember them."""
    paths = {path for file in files for path in (spelled(file), os.path.realpath(file))}
    return sorted(file for file in paths & _AT_FIRST.keys() if _AT_FIRST[file] != _stamp(file))


def spelled(file: str | Path) -> str:
    """A path from the root on, without dots; but as it is where `..` may lead elsewhere through a link."""
    path = os.path.join(os.getcwd(), file)
    return path if os.pardir in path.split(os.sep) else os.path.normpath(path)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in _PATH:
        return
    with suppress(Exception):  # of whoever opens something, wherever in the process
        path: Any = arguments[_PATH[event]]
        if event == "exec":
            path = path.co_filename if path.co_name == "<module>" else None
        lists = event == "open" and arguments[1] is None and sys._getframe(1).f_globals.get("__name__") in _WALKERS
        if lists or not isinstance(path, str | bytes | os.PathLike):
            return  # a folder that is walked through or removed; an open file
        given = os.fsdecode(path)
        name = ":memory:" if "mode=memory" in given else given
        if event == "sqlite3.connect" and (uri := _URI.match(name)):
            name = unquote(uri[1])
        if name.startswith("<") or name == ":memory:" or (event == "ctypes.dlopen" and os.sep not in name):
            return  # of no file; or the system's linker looks for it
        file = spelled(name)
        reads = event != "open" or not (_reads_a_source(file, sys._getframe(1)) or _writes(file, arguments[2]))
        if reads and _is_data(file):
            makes = event == "sqlite3.connect" and not (threading.get_ident() in _COMPUTING and os.path.exists(file))
            _note(file, not makes)


def _note(file: str, read: bool) -> None:
    by, opener, main = _COMPUTING.get(threading.get_ident()), sys._getframe(2), threading.main_thread()
    of_a_sweep = _is_of_a_sweep(opener)
    if read and not of_a_sweep:
        for one in (file, os.path.realpath(file)):
            _AT_FIRST.setdefault(one, _stamp(file))
    if by is not None:
        by.add(file)
        return
    found = _openers(opener, file)
    if not (found or _COMPUTING or threading.current_thread() is main):
        found = _openers(sys._current_frames().get(main.ident or 0), file)
    for one in found:
        _OPENED.setdefault(one, set()).add(file)
    if not of_a_sweep:
        for opened in list(_COMPUTING.values()):  # whose thread it is nobody knows
            opened.add(file)


def _is_of_a_sweep(opener: FrameType) -> bool:
    """Whether a sweep opens a file for itself, to see what it holds."""
    for frame, _ in walk_stack(opener):
        by = frame.f_code.co_filename
        if by.startswith(_SWEEPS):
            return True
        if not by.startswith(("<", _OURS)) and is_users(os.path.abspath(by)):
            return False
    return False


def _stamp(file: str) -> tuple[int, ...]:
    """What tells whether a file has changed; nothing of one that is not there."""
    with suppress(OSError):
        told = os.stat(file)
        return told.st_size, told.st_mtime_ns, told.st_ino
    return ()


def _is_data(file: str) -> bool:
    """Whether a path may be one of data of a user's own, or of a module."""
    return is_users(file) and not (file.startswith(_SYSTEMS) or _NO_DATA.search(file) or os.path.isdir(file))


def _reads_a_source(file: str, by: FrameType) -> bool:
    return file.endswith(".py") and by.f_code.co_filename.endswith(_READS_SOURCES)


def _writes(file: str, flags: int) -> bool:
    """Whether a file is opened to be written or made, not to be read."""
    only = flags & (os.O_WRONLY | os.O_RDWR) == os.O_WRONLY
    return only or bool(flags & os.O_TRUNC) or (bool(flags & os.O_CREAT) and not os.path.exists(file))


def _openers(frame: FrameType | None, file: str) -> set[str]:
    """The user's function that opens a file, and his module that runs at the moment unless this package has called it.
    Where this package opens it for them, that module alone, and no script for the source of a controller that it loads.
    """
    found, ours = set[str](), False
    while frame:
        by = frame.f_code.co_filename
        if by.startswith(_OURS):
            if found:
                return found
            ours = True
        elif not by.startswith("<") and is_users(os.path.abspath(by)):
            if frame.f_code.co_name == "<module>":
                loads = ours and frame.f_globals.get("__name__") in _SCRIPTS and file.endswith(".py")
                return set() if loads else {os.path.abspath(by), *found}
            if not (ours or found):
                found.add(os.path.abspath(by))
        frame = frame.f_back
    return found


sys.addaudithook(_hear)
