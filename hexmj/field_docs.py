"""What the fields of a dataclass are, in its docstring: what stands below them in the source is lost at run time."""

import ast
import inspect
import textwrap
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any


class FieldDocs:
    """The docstring of a dataclass with a line for each field; the source is read when somebody asks, as `help`."""

    def __init__(self, doc: str) -> None:
        """Of the class itself."""
        self._doc = doc

    def __get__(self, instance: object, owner: type) -> str:
        return "\n".join([inspect.cleandoc(self._doc), "", "Fields:", *_lines(owner, "    ")])


def _lines(owner: type, indent: str) -> list[str]:
    """A line for each field of a dataclass, and for each of the parts that it is made of."""
    told = {name: text for one in reversed(owner.__mro__) if is_dataclass(one) for name, text in _told(one).items()}
    lines = []
    for one in fields(owner):  # pyright: ignore  # of a dataclass
        part: Any = one.default_factory
        is_part = isinstance(part, type) and is_dataclass(part) and one.name not in told
        lines.append(f"{indent}{one.name}: {told.get(one.name) or (part.__doc__ if is_part else one.type)}")
        lines += _lines(part, indent + "    ") if is_part else []
    return lines


def _told(one: type) -> dict[str, str]:
    """What stands below the fields that a class itself has, by their names; nothing where there is no source."""
    try:
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
    except (OSError, TypeError, SyntaxError):
        return {}
    found = {}
    for field, below in pairwise(body.body):  # pyright: ignore  # a class has statements
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            found[ast.unparse(field.target)] = " ".join(str(below.value.value).split())
    return found
