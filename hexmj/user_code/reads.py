"""Files and folders that a user's code reads while this package calls it, or while its modules run.

No source has to name them: they are noted as they are opened, from the first import of this package on.  Of modules
that ran before, what their texts name is noted then; of any, the MJCFs, which are opened where nobody hears it.
"""

import ast
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from pathlib import Path
from traceback import walk_stack
from typing import Any

from hexmj.errors import InputError
from hexmj.storage.files import DIGEST, digest, digest_of
from hexmj.storage.mjcf import parts
from hexmj.user_code import as_run
from hexmj.user_code.callers import ANYBODY, LISTS, callers
from hexmj.user_code.parsing import parsed

DATA = (
    *(".toml", ".xml", ".json", ".jsonl", ".yaml", ".yml", ".csv", ".tsv", ".txt"),
    *(".npy", ".npz", ".pt", ".pkl"),
)
"""Ends of the names of data files, in small letters or capitals."""

MJCF = ".xml", ".mjcf", ".mjb", ".urdf"
"""Those of what MuJoCo opens."""

SHOWN = ".png", ".pdf", ".svg", ".mp4", ".gif", ".html", ".log", "~"
"""Those of what is made to be looked at: in a folder that is listed all other names count, but hidden ones."""

DEEPEST = 2
"""Number of folders that texts name, one within the other."""

_CACHES = re.compile(r"__pycache__|\.nb[ic]$")
"""In the names of what Python and numba keep of their own."""

_KEPT = re.compile(rf"-[0-9a-f]{{{DIGEST}}}(\.[0-9a-f]{{{DIGEST}}})?\.(nc|jsonl)$")
"""In the names of kept cells and values: whoever looks through a whole project finds them."""

_URI = re.compile(r"^file:(?://)?([^?]*)(\?.*)?$")
"""Of a database of SQLite."""

_FINDS = re.compile(
    rb"\b(importlib|import_module|__import__|iter_modules|walk_packages|resolve_name|locate|sys\.modules|load_controller|"
    rb"\w*pickle|dill|joblib|shelve|torch|stable_baselines3)\b"
)
"""Words of sources that may find modules by no name that can be read, or in what others have pickled."""

_SYSTEMS = tuple(f"/dev/{one}" for one in ("fd/", "null", "pts", "random", "std", "tty", "urandom", "zero"))
_SYSTEMS += "/proc/", "/sys/"

LARGE = 2**16
"""Size from which on a file is not read through as it is opened [bytes]."""

_UNREAD = "unread "
"""Begins what is noted of a large file instead of a digest: its size and times."""

CHANGED = "changed"
"""Stands for what a file held that has changed since it was first read: no file ever holds that."""

Asked = tuple[str, str]
"""A file or folder as it was asked for, relative to the current one or not, and its absolute path."""

HEARD: dict[Asked, dict[tuple[frozenset[str], str], bool]] = {}
"""File or folder -> files of the code that read it, and what it held then, the latest at the end -> whether they have
read that only as cells were computed."""

_WRITTEN: set[str] = set()
"""Files that the user's code writes itself while this package calls it."""

_BOTH: set[str] = set()
"""Files that were opened to be read and written."""

_COMPUTING: list[dict[Asked, set[str]]] = []
"""For each cell that is being computed: file -> what it held whenever it was read meanwhile."""

_LIBRARY = "ctypes.dlopen"
"""Event of a compiled library that is loaded; without a path, of the program itself."""

_EVENTS = {"open": 0, "os.listdir": 0, "os.scandir": 0, "os.rename": 1, "sqlite3.connect": 0, _LIBRARY: 0}
"""Event -> which of its arguments is the path."""

_QUIET = "exec", _LIBRARY, *LISTS
"""Events that write nothing."""


@contextmanager
def computing() -> Iterator[dict[Asked, set[str]]]:
    """Meanwhile threads of the user's own count as called by this package; gives what each file held as it was read.

    What was read meanwhile, and is gone in the end, was made on the way: it is forgotten.  Of what was opened to be
    written as well, and has changed, nobody knows who did that: `CHANGED`.
    """
    held: dict[Asked, set[str]] = {}
    _COMPUTING.append(held)
    try:
        yield held
    finally:
        _COMPUTING[:] = [one for one in _COMPUTING if one is not held]
        for asked, seen in list(held.items()):
            whole, heard = asked[1], HEARD.get(asked, {})
            if not os.path.exists(whole) and not any(then == "" for _, then in heard):
                HEARD.pop(asked, None)
            if whole in _BOTH and seen != {_seen(whole)}:
                heard.update({(by, CHANGED): False for by, _ in heard})
                held[asked] = {CHANGED}


def reads(sources: Set[str], homes: Sequence[Path]) -> dict[str, list[str]]:
    """What some code has read so far in this process, but for its sources.

    Args:
        sources: its files.
        homes: folders that may lie elsewhere another time.

    Returns:
        File or folder -> a digest of what it holds, and its absolute path; `CHANGED` instead if it held something else
        when it was last read, or ever before cells were computed, which the code may remember.  It is told from the
        current folder, without that path, if it was asked for so and still lies there, else from the first of `homes`
        that lies beside it or above, but for the system's root.
    """
    found, told = _found_by(sources), dict[str, list[str]]()
    sources = sources | set(found)
    for (path, whole), heard in list(HEARD.items()):
        own = [(then, within) for (by, then), within in list(heard.items()) if by & (sources | {ANYBODY})]
        held = {then for then, within in own if not within} | {then for then, _ in own[-1:]}
        if held and whole not in sources and whole not in _WRITTEN:
            here = not os.path.isabs(path) and os.path.abspath(path) == whole
            told[path if here else placed(whole, homes)] = [
                _held(whole) if held == {_seen(whole)} else CHANGED,
                "" if here else whole,
            ]
    for file in found:
        told[placed(file, homes)] = [now if (now := _held(file)) == digest(as_run.RUN[file][-1]) else CHANGED, file]
    return told


def _found_by(sources: Set[str]) -> list[str]:
    """A user's other modules, though not the script, if some sources may have found them by a computed name."""
    if not any(_FINDS.search(one) for file in sources for one in as_run.RUN.get(file, ())):
        return []
    script = getattr(sys.modules.get("__main__"), "__file__", None)
    return [file for file in as_run.RUN if file not in sources and file != script]


def changed(told: Mapping[str, Sequence[str]], homes: Sequence[Path]) -> list[str]:
    """Files and folders of `reads` that hold something else by now, from here or where they lay then."""
    paths = [(path, one[0]) for place, one in told.items() for path in _paths(place, one[1], homes)]
    return [path for path, held in paths if _held(path) != held]


def comparable(path: str) -> bool:
    """Whether what two processes have read there has to be the same: it is there, and no user's code writes it."""
    return os.path.exists(path) and os.path.abspath(path) not in _WRITTEN


def placed(path: str, homes: Sequence[Path]) -> str:
    """A path as told from the first of some folders with which it shares more than the system's root; else as it is."""
    for i, home in enumerate(homes):
        with suppress(ValueError):  # of another drive
            if os.path.commonpath([path, home]) != home.anchor:
                return f"{i}:{os.path.relpath(path, home)}"
    return path


def _path(place: str, homes: Sequence[Path]) -> str:
    number, colon, within = place.partition(":")
    if not (colon and number.isdecimal()):
        return place
    return os.path.normpath(os.path.join(*homes[int(number) :][:1], within))


def _paths(place: str, whole: str, homes: Sequence[Path]) -> list[str]:
    return [_path(place, homes), *([whole] if os.path.exists(whole) else [])]


def _held(path: str) -> str:
    """A digest of a file, or of the names in a folder; empty if neither is there."""
    with suppress(OSError, InputError):
        if os.path.isdir(path):
            return digest("\n".join(sorted(filter(_counts, os.listdir(path)))).encode())
        return digest_of(Path(path))
    return ""


def _counts(name: str) -> bool:
    """Whether a name in a folder is one of data."""
    return not (name[0] == "." or name == "__pycache__" or name.lower().endswith(SHOWN) or _KEPT.search(name))


def _seen(path: str) -> str:
    """What a file or folder holds; of a large file only what tells whether it has changed."""
    with suppress(OSError):
        told = os.stat(path)
        if told.st_size >= LARGE:
            return f"{_UNREAD}{told.st_size} {told.st_mtime_ns} {told.st_ino}"
    return _held(path)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    runs = event == "exec" and getattr(arguments[0], "co_name", "") == "<module>"
    path = arguments[0].co_filename if runs else arguments[_EVENTS[event]] if event in _EVENTS else 0
    if isinstance(path, int) or (event == _LIBRARY and not path):  # an open file, or nothing that is heard
        return
    with suppress(Exception):  # of whoever opens something, wherever in the process
        path = os.path.normpath(_URI.sub(r"\1", os.fsdecode(path or ".")))
        whole = os.path.abspath(path)
        if path.startswith("<") or whole.startswith(_SYSTEMS) or _CACHES.search(whole) or not as_run.is_users(whole):
            return
        if runs:
            _note_named(file := as_run.plain(arguments[0].co_filename), as_run.RUN[file][-1], 0)
        by, called = callers(event, bool(_COMPUTING))
        read, written = _access(*arguments[1:]) if event == "open" else (event != "os.rename", event not in _QUIET)
        if not read and called:
            _forget(whole)
        elif read and by and whole not in _WRITTEN:
            heard, now = HEARD.setdefault((path, whole), {}), _seen(whole)
            heard[by, now] = heard.pop((by, now), True) and bool(_COMPUTING)
            _BOTH.update([whole] if written else [])
            for cell in _COMPUTING:
                cell.setdefault((path, whole), set()).update([] if event in _QUIET else [now])


def _access(mode: str | None, flags: int) -> tuple[bool, bool]:
    """Whether a file is opened to be read as it is, and whether to be written."""
    if mode:
        return "r" in mode, bool({*mode} & {*"wxa+"})
    kind = flags & (os.O_RDONLY | os.O_WRONLY | os.O_RDWR)
    return kind != os.O_WRONLY and not flags & (os.O_TRUNC | os.O_APPEND | os.O_EXCL), kind != os.O_RDONLY


def _forget(whole: str) -> None:
    """A file is written by the user's code itself: whatever it reads there is no data."""
    _WRITTEN.add(whole)
    for known in (HEARD, *_COMPUTING):
        for asked in [one for one in known if one[1] == whole]:
            del known[asked]


def _note_named(file: str, source: bytes, reached: int) -> None:
    """Note what nobody hears of the code of a file: data files that its texts name up to the line that it has reached,
    which may have been read before, and MJCFs, which MuJoCo opens by itself.  They are looked for beside it, in the
    current folder, and in folders within these that other texts name."""
    texts = dict[str, int]()
    for one in ast.walk(parsed(source)):
        if isinstance(one, ast.Constant) and isinstance(one.value, str):
            for text in (one.value, one.value.lstrip("/")):  # of a formatted one, what stands after its folder
                texts.setdefault(text, one.lineno)
    names = [text for text, line in texts.items() if text.lower().endswith(DATA if line <= reached else MJCF)]
    new = {os.path.dirname(file), os.path.dirname(os.path.realpath(file)), "."} if names else set[str]()
    for _ in range(1 + DEEPEST):
        for path in {os.path.normpath(os.path.join(folder, name)) for folder in new for name in names}:
            for one in {path, *_parts(path)}:
                HEARD.setdefault((one, os.path.abspath(one)), {})[frozenset({file}), _seen(one)] = False
        new = {within for folder in new for text in texts if os.path.isdir(within := os.path.join(folder, text))}


def _parts(path: str) -> list[str]:
    """The files that an MJCF is made of, if it is one that can be read."""
    with suppress(InputError):
        if path.lower().endswith(MJCF) and os.path.isfile(path):
            return [str(one) for one in parts(Path(path))]
    return []


def _note_before() -> None:
    """Note what modules that ran before may have read."""
    stack = walk_stack(sys._getframe())
    reached = {frame.f_code.co_filename: line for frame, line in stack if frame.f_code.co_name == "<module>"}
    for file, (source, *_) in as_run.RUN.items():
        with suppress(SyntaxError, ValueError):  # of what is no Python
            _note_named(file, source, reached.get(file, sys.maxsize))


_note_before()
sys.addaudithook(_hear)
