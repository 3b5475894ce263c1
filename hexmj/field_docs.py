"""What the fields of a dataclass are, in its docstring: what stands below them in the source is lost at run time."""

import ast
import inspect
import sys
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from hexmj.user_code.parsing import parsed


class FieldDocs:
    """The docstring of a dataclass with a line for each field; the source is read when somebody asks, as `help`."""

    def __init__(self, doc: str) -> None:
        """Of the class itself."""
        self._doc = doc

    def __get__(self, instance: object, owner: type) -> str:
        return "\n".join([inspect.cleandoc(self._doc), "", "Attributes:", *_lines(owner, "    ")])


def tell_fields(kind: Any) -> None:
    """Let `help` tell the fields of a dataclass and of all that its module knows, which it is made of."""
    for one in vars(sys.modules[kind.__module__]).values():
        ours = isinstance(one, type) and is_dataclass(one) and one.__module__.startswith("hexmj.")
        if ours and not isinstance(vars(one)["__doc__"], FieldDocs):
            one.__doc__ = FieldDocs(one.__doc__ or "")  # pyright: ignore[reportAttributeAccessIssue]
            tell_fields(one)


def _lines(owner: Any, indent: str) -> list[str]:
    """A line for each field of a dataclass, and for each of the parts that it is made of."""
    texts = {name: text for one in reversed(owner.__mro__) for name, text in told(one.__module__, one.__qualname__)}
    lines = []
    for one in fields(owner):
        part: Any = one.default_factory
        is_part = isinstance(part, type) and is_dataclass(part) and one.name not in texts
        of_part = (part.__doc__ or "").partition("\n\n")[0] if is_part else one.type
        lines.append(f"{indent}{one.name}: {texts.get(one.name, of_part)}")
        lines += _lines(part, indent + "    ") if is_part else []
    return lines


@cache
def told(module: str, kind: str) -> tuple[tuple[str, str], ...]:
    """What stands below the fields of a class, with their names; nothing where there is no source."""
    try:
        tree = parsed(inspect.getsource(sys.modules[module]).encode())
    except (OSError, TypeError):
        return ()
    return tuple(
        (ast.unparse(field.target), " ".join(str(below.value.value).split()))
        for one in tree.body
        if isinstance(one, ast.ClassDef) and one.name == kind
        for field, below in pairwise(one.body)
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    )
