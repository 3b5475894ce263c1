"""Sources as trees and as code, one after the other: Python 3.11 counts the depth of all that threads parse at once as
that of one.  Nothing is told of their warnings, which whoever imports them hears."""

import ast
import gc
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import listdir
from os.path import exists, isabs, isdir
from pathlib import Path
from threading import Lock
from types import CodeType
from warnings import catch_warnings, simplefilter

LONGEST = 1000
"""More letters no path has that a source names."""

_ONE = Lock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_ONE.acquire, after_in_parent=_ONE.release, after_in_child=_ONE.release)


def parsed(source: bytes) -> ast.Module:
    """The tree of a source.

    Raises:
        SyntaxError: it is no Python; ValueError where it holds a null character.
    """
    with alone():
        return ast.parse(source)


def compiled(source: bytes, file: str) -> CodeType:
    """What Python runs of a file with this source; errors as of `parsed`."""
    with alone():
        return compile(source, file, "exec", dont_inherit=True)


@contextmanager
def alone() -> Iterator[None]:
    """While the block runs, which parses, nothing of this package in other threads does, nor does the collector run:
    amid what it calls, as in Dask's workers, others take their turn, who may parse."""
    with _ONE, catch_warnings():
        simplefilter("ignore")
        collects = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collects:
                gc.enable()


def texts(tree: ast.AST) -> list[str]:
    """The texts of a source that may be paths, without parts that are dots and slashes that one begins with, as
    ``f"{folder}/leg.xml"`` has one; and paths from the root as they are."""
    constants = [one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    names = [one for one in constants if len(one) < LONGEST and one.isprintable()]
    parts = [[part for part in one.split("/") if part not in ("", ".", "..")] for one in names]
    return list(dict.fromkeys(["/".join(one) for one in parts if one] + [one for one in names if isabs(one)]))


def named_there(texts: Iterable[str], folders: Iterable[Path], deep: int = 1) -> list[Path]:
    """What texts name from the root on, in some folders, and in the folders found so; whatever is there.

    Args:
        texts: of a source, or of several, as `texts` gives them.
        folders: where they are looked for.
        deep: how many folders in one another are followed.
    """
    texts = list(texts)
    begin = defaultdict[str, list[str]](list)
    for text in texts:
        begin[text.partition("/")[0]].append(text)
    found = [Path(one) for one in begin.pop("", ()) if exists(one)]
    new = [*dict.fromkeys(folders), *filter(isdir, found)]
    known = {*new, *found}
    for _ in range(deep + 1):
        inner = [
            Path(folder, text) for folder in new for name in _listed(folder) & begin.keys() for text in begin[name]
        ]
        inner = [one for one in dict.fromkeys(inner) if one not in known and exists(one)]
        known.update(inner)
        found += inner
        new = [one for one in inner if isdir(one)]
    return found


def _listed(folder: Path) -> set[str]:
    """Names in a folder; none where there is none to be read."""
    try:
        return set(listdir(folder))
    except OSError:
        return set()
