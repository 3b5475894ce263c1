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


def texts(tree: ast.AST) -> list[str]:
    """The texts of a source, each also without the slash it begins with, as in ``f"{folder}/leg.xml"``."""
    constants = [one.value for one in ast.walk(tree) if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    return list(dict.fromkeys(text for one in constants for text in (one, one.lstrip("/"))))


def files_named(texts: Sequence[str], folders: Sequence[Path], endings: tuple[str, ...]) -> list[Path]:
    """Files that are there, and that texts name.

    Args:
        texts: of a source.
        folders: where they are looked for, and in folders there that texts name.
        endings: of the names, in small letters.
    """
    names = [text for text in texts if text.lower().endswith(endings)]
    within = [folder / text for folder in folders for text in texts if isdir(folder / text)] if names else []
    return sorted({one for folder in (*folders, *within) for name in names if isfile(one := folder / name)})
