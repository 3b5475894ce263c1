"""Sources as trees and as code, one after the other: Python 3.11 counts the depth of all that threads parse at once as
that of one.  Nothing is told of their warnings, which whoever imports them hears."""

import ast
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os.path import isdir, isfile
from pathlib import Path
from threading import Lock
from types import CodeType
from warnings import catch_warnings, simplefilter

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


def files_named(tree: ast.AST, folders: Sequence[Path], endings: tuple[str, ...]) -> list[Path]:
    """Files that are there, and that texts of a source name, as ``f"{folder}/leg.xml"`` does.

    Args:
        tree: of the source.
        folders: where they are looked for, and in folders there that texts name.
        endings: of the names, in small letters.
    """
    constants = [one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    texts = dict.fromkeys(text for one in constants for text in (one, one.lstrip("/")))
    names = [text for text in texts if text.lower().endswith(endings)]
    within = [folder / text for folder in folders for text in texts if isdir(folder / text)] if names else []
    return sorted({one for folder in (*folders, *within) for name in names if isfile(one := folder / name)})
