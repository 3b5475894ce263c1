"""Files and folders that a user's code reads while this package calls it, or while its modules run.

No source has to name them: they are noted as they are opened, from the first import of this package on.
"""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from hexmj import as_run
from hexmj.errors import InputError
from hexmj.files import digest, digest_of

_OURS = f"{Path(__file__).parent}{os.sep}"
_SYSTEMS = ("/dev/", "/proc/", "/sys/")

SCRIPTS = "__main__", "__mp_main__"
"""Names of the module of a script."""

_HEARD: dict[str, dict[frozenset[str], str]] = {}
"""File or folder -> files of the code that read it -> what it held when they last did, the latest at the end."""

_WRITTEN: set[str] = set()
"""Files that the user's code writes itself while this package calls it."""


_COMPUTING: list[None] = []
"""One for each cell that is being computed."""


@contextmanager
def computing() -> Iterator[None]:
    """Meanwhile threads of the user's own count as called by this package."""
    _COMPUTING.append(None)
    try:
        yield
    finally:
        _COMPUTING.pop()


def reads(sources: Set[str], homes: Sequence[Path]) -> dict[str, str]:
    """What some code has read so far in this process.

    Args:
        sources: its files.
        homes: folders that may lie elsewhere another time.

    Returns:
        File or folder, told from the first of `homes` that it lies in -> digests of what it held.  What has gone
        meanwhile is left out: it was made on the way.
    """
    own = {path: [held for by, held in list(heard.items()) if by & sources] for path, heard in list(_HEARD.items())}
    return {
        _place(path, homes): held[-1] for path, held in own.items() if held and (os.path.exists(path) or not held[-1])
    }


def changed(read: Mapping[str, str], homes: Sequence[Path]) -> str:
    """The first file or folder of `reads` that holds something else by now; empty if none does."""
    paths = {_path(place, homes): held for place, held in read.items()}
    return next((path for path, held in paths.items() if _held(path) != held), "")


def _place(path: str, homes: Sequence[Path]) -> str:
    for i, home in enumerate(homes):
        if Path(path).is_relative_to(home):
            return f"{i}:{os.path.relpath(path, home)}"
    return path


def _path(place: str, homes: Sequence[Path]) -> str:
    if os.path.isabs(place):
        return place
    number, _, within = place.partition(":")
    return os.path.normpath(os.path.join(*homes[int(number) :][:1], within))


def _held(path: str) -> str:
    """A digest of a file, or of the names of a folder's data files; empty if neither is there."""
    with suppress(OSError, InputError):
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if name.lower().endswith(as_run.DATA))
            return digest("\n".join(names).encode())
        return digest_of(Path(path))
    return ""


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in ("open", "os.listdir", "os.scandir") or isinstance(arguments[0], int):
        return
    with suppress(Exception):  # of whoever opens something, wherever in the process
        path = os.path.abspath(os.fsdecode(arguments[0] or "."))
        if path.startswith(_SYSTEMS) or "__pycache__" in path or not as_run.is_users(path) or not (by := _by()):
            return
        if event == "open" and _writes(*arguments[1:]):
            _WRITTEN.add(path)
        elif path not in _WRITTEN:
            heard = _HEARD.setdefault(path, {})
            heard.pop(by, None)
            heard[by] = _held(path)


def _writes(mode: str | None, flags: int) -> bool:
    """Whether a file is opened to be written anew or added to, rather than read."""
    return mode[:1] in "wxa" if mode else flags & (os.O_WRONLY | os.O_TRUNC | os.O_APPEND) != 0


def _by() -> frozenset[str]:
    """Files of the user's code that does what happens, with its libraries, within a call of this package's, as one of
    its modules is imported or at the top level of its script; none if others do it, or Python's import itself, which
    sources tell."""
    frame, users = sys._getframe(2), set[str]()
    while frame is not None:
        file = frame.f_code.co_filename
        whose = _whose(file)
        if whose == "ours" or (whose == "import's" and not users):
            return frozenset(users)
        if whose == "user's":
            first, name = not users, frame.f_globals.get("__name__")
            users.add(file)
            if frame.f_code.co_name == "<module>" and (first if name in SCRIPTS else name):
                return frozenset(users)
        frame = frame.f_back
    return frozenset(users if _COMPUTING else ())


@lru_cache(maxsize=10_000)
def _whose(file: str) -> str:
    """Whose the code of a file is."""
    if file.startswith(_OURS):
        return "ours"
    if file.startswith("<frozen importlib"):
        return "import's"
    return "user's" if os.path.isabs(file) and as_run.is_users(file) else "a library's"


sys.addaudithook(_hear)
