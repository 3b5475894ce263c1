"""Files and folders that a user's code reads while this package calls it, or while its modules run.

No source has to name them: they are noted as they are opened, from the first import of this package on.  Of modules
that ran before, what their texts name is noted then.
"""

import ast
import os
import sys
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from traceback import walk_stack
from typing import Any

from hexmj import as_run, files
from hexmj.errors import InputError
from hexmj.files import digest, digest_of
from hexmj.parsing import parsed

DATA = (
    *(".toml", ".xml", ".json", ".jsonl", ".yaml", ".yml", ".csv", ".tsv", ".txt"),
    *(".npy", ".npz", ".pt", ".pkl"),
)
"""Ends of the names of data files, in small letters or capitals."""

_OURS = f"{Path(__file__).parent}{os.sep}"
_KEEPS = __file__, *(f"{_OURS}sweeps{os.sep}{one}.py" for one in ("cells", "files", "kept_values"))
"""What names cells and keeps them: it opens nothing for the user's code."""

_SYSTEMS = tuple(f"/dev/{one}" for one in ("fd/", "null", "pts", "random", "std", "tty", "urandom", "zero"))
_SYSTEMS += "/proc/", "/sys/"

_HEARD: dict[str, dict[frozenset[str], str]] = {}
"""File or folder, relative to the current one if it was asked for so -> files of the code that read it -> what it held
when they last did, the latest at the end."""

_WRITTEN: set[str] = set()
"""Files that the user's code writes itself while this package calls it."""

_COMPUTING: list[dict[str, set[str]]] = []
"""For each cell that is being computed: file -> what it held whenever it was read meanwhile."""


@contextmanager
def computing() -> Iterator[dict[str, set[str]]]:
    """Meanwhile threads of the user's own count as called by this package; gives what each file held as it was read.

    What was read meanwhile, and is gone in the end, was made on the way: it is forgotten.
    """
    held: dict[str, set[str]] = {}
    _COMPUTING.append(held)
    try:
        yield held
    finally:
        _COMPUTING[:] = [one for one in _COMPUTING if one is not held]
        for path in list(held):
            if not os.path.exists(path) and all(_HEARD.get(path, {}).values()):
                _HEARD.pop(path, None)


def reads(sources: Set[str], homes: Sequence[Path]) -> dict[str, str]:
    """What some code has read so far in this process.

    Args:
        sources: its files.
        homes: folders that may lie elsewhere another time.

    Returns:
        File or folder -> digests of what it held.  It is told from the current folder where it was asked for so, else
        from the first of `homes` that lies beside it or above, but for the system's root.
    """
    own = {path: [held for by, held in list(heard.items()) if by & sources] for path, heard in list(_HEARD.items())}
    return {_place(path, homes): held[-1] for path, held in own.items() if held}


def changed(read: Mapping[str, str], homes: Sequence[Path]) -> list[str]:
    """Files and folders of `reads` that hold something else by now."""
    paths = {_path(place, homes): held for place, held in read.items()}
    return [path for path, held in paths.items() if _held(path) != held]


def _place(path: str, homes: Sequence[Path]) -> str:
    for i, home in enumerate(homes if os.path.isabs(path) else ()):
        with suppress(ValueError):  # of another drive
            if os.path.commonpath([path, home]) != home.anchor:
                return f"{i}:{os.path.relpath(path, home)}"
    return path


def _path(place: str, homes: Sequence[Path]) -> str:
    number, colon, within = place.partition(":")
    if not (colon and number.isdecimal()):
        return place
    return os.path.normpath(os.path.join(*homes[int(number) :][:1], within))


def _held(path: str) -> str:
    """A digest of a file, or of the names of a folder's data files; empty if neither is there."""
    with suppress(OSError, InputError):
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if name.lower().endswith(DATA))
            return digest("\n".join(names).encode())
        return digest_of(Path(path))
    return ""


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in ("open", "os.listdir", "os.rename", "os.scandir") or isinstance(arguments[0], int):
        return
    with suppress(Exception):  # of whoever opens something, wherever in the process
        path = os.path.normpath(os.fsdecode(arguments[event == "os.rename"] or "."))
        whole = os.path.abspath(path)
        if whole.startswith(_SYSTEMS) or "__pycache__" in whole or not as_run.is_users(whole):
            return
        by, called = _by(event)
        if event == "os.rename" or (event == "open" and _writes(*arguments[1:])):
            if called:
                _WRITTEN.add(whole)
                for known in (_HEARD, *_COMPUTING):
                    for name in (path, whole):
                        known.pop(name, None)
        elif by and whole not in _WRITTEN:
            heard = _HEARD.setdefault(path, {})
            heard.pop(by, None)
            heard[by] = now = _held(path)
            for cell in _COMPUTING:
                cell.setdefault(path, set()).update([now] if event == "open" else [])


def _writes(mode: str | None, flags: int) -> bool:
    """Whether a file is opened to be written, whether or not to be read as well."""
    return bool({*mode} & {*"wxa+"}) if mode else flags & (os.O_WRONLY | os.O_RDWR) != 0


def _by(event: str) -> tuple[frozenset[str], bool]:
    """Files of the user's code that does what happens, with its libraries or by what this package reads for it: within
    a call of this package's, which is told, too, as one of its modules is imported, or in its script.  None if others
    do it, or Python's import itself, which sources tell."""
    frame, users = sys._getframe(2), set[str]()
    for_others = frame.f_code.co_filename == files.__file__
    while frame is not None:
        name, file = frame.f_code.co_name, frame.f_code.co_filename
        whose = _whose(file)
        if whose == "import's" and not users and (event != "open" or name == "_find_and_load"):
            return frozenset(), False
        if whose == "ours" and (users or not for_others or file in _KEEPS):
            return frozenset(users), bool(users)
        if whose == "user's":
            users.add(file)
            if name == "<module>" and frame.f_globals.get("__name__"):
                return frozenset(users), False
        frame = frame.f_back
    return frozenset(users if _COMPUTING else ()), False


@lru_cache(maxsize=10_000)
def _whose(file: str) -> str:
    """Whose the code of a file is."""
    if file.startswith(_OURS):
        return "ours"
    if file.startswith("<frozen importlib"):
        return "import's"
    return "user's" if os.path.isabs(file) and as_run.is_users(file) else "a library's"


def _note_before() -> None:
    """Note what modules that ran before may have read: data files that texts name in what has run of them, beside them,
    in the current folder, or in a folder that another text names there."""
    stack = walk_stack(sys._getframe())
    reached = {frame.f_code.co_filename: line for frame, line in stack if frame.f_code.co_name == "<module>"}
    for file, (source, *_) in as_run.RUN.items():
        with suppress(SyntaxError, ValueError):  # of what is no Python
            texts = _texts(source, reached.get(file, sys.maxsize))
            homes = os.path.dirname(file), os.path.dirname(os.path.realpath(file)), "."
            folders = {os.path.normpath(os.path.join(home, text)) for home in homes for text in ("", *texts)}
            for folder in filter(os.path.isdir, folders):
                for name in (text for text in texts if text.lower().endswith(DATA)):
                    path = os.path.normpath(os.path.join(folder, name))
                    _HEARD.setdefault(path, {})[frozenset({file})] = _held(path)


def _texts(source: bytes, last: int) -> set[str]:
    """Texts in a source up to its last line that has run, alone or after a folder in a formatted one."""
    nodes = [one for one in ast.walk(parsed(source)) if isinstance(one, ast.Constant) and one.lineno <= last]
    return {part for one in nodes if isinstance(one.value, str) for part in (one.value, one.value.lstrip("/"))}


_note_before()
sys.addaudithook(_hear)
