"""Whose code brings about what audit hooks hear, by the stacks of the threads."""

import os
import re
import sys
import threading
from functools import lru_cache
from pathlib import Path
from types import FrameType

from hexmj.storage import files
from hexmj.user_code import as_run

LISTS = "os.listdir", "os.scandir"
"""Events of folders that are listed."""

ANYBODY = "anybody"
"""Stands for the code of a thread in which nothing is a user's, while cells are computed."""

_METADATA = re.compile(r"\bimportlib[._/\\]+metadata\b")
"""In the names of files by which Python and libraries look for what is installed."""

_OURS = f"{Path(__file__).parents[1]}{os.sep}"
_KEEPS = tuple(
    f"{_OURS}{one.replace('/', os.sep)}.py"
    for one in ("user_code/reads", "sweeps/cells", "sweeps/files", "sweeps/kept_values")
)
"""What names cells and keeps them: it opens nothing for the user's code."""


def callers(event: str, computing: bool) -> tuple[frozenset[str], bool]:
    """Files of the user's code that does what happens, with its libraries or by what this package reads for it, and
    whether this package has called it.  None if others do it, or Python's import itself, which sources tell.

    A thread that neither this package's call nor a module leads to opens files for the code that the main one is in;
    while cells are computed, for what any is in.

    Args:
        event: of Python's audit hooks.
        computing: whether cells are computed, for which such a thread may work if nobody is known.
    """
    by, called, led = _users(sys._getframe(2), event)
    mine, main = threading.get_ident(), threading.main_thread().ident
    if not led and mine == main:  # a test's, for one, which a library calls
        return frozenset(), False
    if not led and event not in LISTS:
        threads = sys._current_frames()
        frames = [threads[one] for one in threads if one != mine and (computing or one == main)]
        others = [(users, whether) for users, whether, led in map(_users, frames) if led]
        by = by.union(*(users for users, _ in others)) or frozenset({ANYBODY} if computing else ())
        called = any(whether for _, whether in others)
    return by, called


def _users(frame: FrameType | None, event: str = "") -> tuple[frozenset[str], bool, bool]:
    """As `callers`, of the thread that is in a frame alone, and whether this package's call or a module leads there."""
    users, calls, for_others = (
        set[str](),
        False,
        event == "exec" or (frame and frame.f_code.co_filename == files.__file__),
    )
    while frame is not None:
        name, file = frame.f_code.co_name, frame.f_code.co_filename
        whose, runs = _whose(file), name == "<module>" and frame.f_globals.get("__name__")
        if whose == "import's" and event != "exec" and not users and (event != "open" or name == "_find_and_load"):
            return frozenset(), False, True
        if whose == "ours" and (users or not for_others or file in _KEEPS):
            return frozenset(users), bool(users), True
        if runs == "__main__" and file.startswith("<") and calls:  # it is typed, or behind `python -c`
            return frozenset(users), False, True
        imported = frame.f_back and _whose(frame.f_back.f_code.co_filename) == "import's"
        if runs and imported and whose == "a library's" and not users:  # it may be of a controller's package
            return frozenset({file}), False, True
        if whose == "user's" or file in as_run.FOLLOWED:
            users.add(as_run.plain(file))
            if runs and whose == "user's":
                return frozenset(users), False, True
        calls, frame = whose == "user's", frame.f_back
    return frozenset(users), False, False


@lru_cache(maxsize=10_000)
def _whose(file: str) -> str:
    """Whose the code of a file is."""
    if file.startswith(_OURS):
        return "ours"
    if file.startswith("<frozen importlib") or _METADATA.search(file):
        return "import's"
    shown = file.startswith("<")  # as <string>
    return "user's" if not shown and as_run.is_users(os.path.abspath(file)) else "a library's"  # a profiled script's
