"""Sources as trees and as code, one after the other: Python 3.11 counts the depth of all that threads parse at once as
that of one.  Nothing is told of their warnings, which whoever imports them hears."""

import ast
from collections.abc import Iterator
from contextlib import contextmanager
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
