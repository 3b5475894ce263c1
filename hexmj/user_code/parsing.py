"""Sources as trees and as code, one after the other: Python 3.11 counts the depth of all that threads parse at once as
that of one.  Nothing is told of their warnings, which whoever imports them hears."""

import ast
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os.path import isdir, isfile, join
from pathlib import Path
from threading import Lock
from types import CodeType
from warnings import catch_warnings, simplefilter

LONGEST = 1000
"""More letters no path has that a source names."""

_ONE = Lock()


def parsed(source: bytes) -> ast.Module:
    """The tree of a source.

    Raises:
        SyntaxError: it is no Python; ValueError where it holds a null character.
    """
    with _alone():
        return ast.parse(source)


def compiled(source: bytes, file: str) -> CodeType:
    """What Python runs of a file with this source; errors as of `parsed`."""
    with _alone():
        return compile(source, file, "exec", dont_inherit=True)


@contextmanager
def _alone() -> Iterator[None]:
    with _ONE, catch_warnings():
        simplefilter("ignore")
        yield


def texts(tree: ast.AST) -> list[str]:
    """The texts of a source that may be names, each also without the slash it begins with, as ``f"{folder}/leg.xml"``
    has one."""
    constants = [one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    names = [one for one in constants if 0 < len(one) < LONGEST and one.isprintable()]
    return list(dict.fromkeys(text for one in names for text in (one, one.lstrip("/")) if text))


def files_named(texts: Sequence[str], folders: Sequence[Path], endings: tuple[str, ...]) -> list[Path]:
    """Files that are there, and that texts name.

    Args:
        texts: of a source, or of several.
        folders: where they are looked for; see `folders_named` for those that texts name.
        endings: of the names, in small letters.
    """
    names = [text for text in texts if text.lower().endswith(endings)]
    return sorted({Path(one) for folder in folders for name in names if isfile(one := join(folder, name))})


def folders_named(texts: Sequence[str], folders: Sequence[Path], deep: int = 1) -> list[Path]:
    """Some folders, and those that texts name in them; as often as asked also what they name in these."""
    found = {folder: None for folder in folders}
    new = list(found)
    for _ in range(deep):
        inner = [Path(one) for folder in new for text in texts if isdir(one := join(folder, text))]
        new = [one for one in inner if one not in found]
        found |= dict.fromkeys(new)
    return list(found)
