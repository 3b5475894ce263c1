"""What the source of a module tells, which is not run: what it imports, what its texts name, and its digest."""

import ast
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import resolve_name
from pathlib import Path

from hexmj.errors import InputError
from hexmj.storage.files import digest
from hexmj.sweeps.module_files import package_of
from hexmj.sweeps.plain_settings import PACKAGE
from hexmj.user_code import sources_as_run
from hexmj.user_code.parsing import named_there, parsed, texts

Wanted = tuple[str, str]
"""A module, and the name that is taken from it; no name where it is the module itself."""

ALL = "*"
"""Stands for all names of a module; of a package they may be its modules, whoever has imported them."""

_DATA_OF_OURS = ".toml", ".xml"
"""Ends of the names of this package's data files."""

_ASSETS = PACKAGE / "assets" if (PACKAGE / "assets").is_dir() else PACKAGE.parent / "assets"
"""Of an installed package, and of one that runs from its repository."""

_FILES_OF_OURS = (os.path.join(folder, name) for folder, _, names in os.walk(PACKAGE) for name in names)
AT_FIRST = {file: os.stat(file).st_mtime_ns for file in _FILES_OF_OURS if file.endswith(".py")}
"""Source of this package -> when it was changed last, as of this program's beginning."""


@dataclass(frozen=True)
class Module:
    """A module as it ran, or as it stands if it has not."""

    digest: str
    data: list[Path]
    """Of this package, that its texts name."""
    texts: list[str]
    """Of a user's own, some of which may name files of data or their folders."""
    package: bool
    """It is an `__init__`."""
    imports: tuple[Wanted, ...]
    bound: dict[str, Wanted]
    """Name -> the import it comes from, those for types included."""


@cache
def read_module(name: str, file: Path) -> Module:
    """What a module's file tells.

    Raises:
        InputError: it cannot be read; it is none of Python, or one of this package that was edited meanwhile.
    """
    try:
        changed, held = file.stat().st_mtime_ns, sources_as_run.as_run(file, name) or file.read_bytes()
    except OSError as error:  # as of one in an archive
        raise InputError(f"{file} cannot be read: {error.strerror}; expected sources as files") from None
    if AT_FIRST.get(str(file), changed) != changed:
        raise InputError(f"{file} was edited since this program began; start it again")
    python = b"" if file.name.endswith(sources_as_run.COMPILED) else held  # of a compiled module nothing is followed
    package = name if file.name == "__init__.py" else package_of(name)
    try:
        tree = parsed(python)
    except (SyntaxError, ValueError) as error:
        if name in sys.modules:
            raise InputError(f"{file} cannot be read as Python: {error}") from None
        tree = parsed(b"")
    of_package, ours = package == name, file.is_relative_to(PACKAGE)
    imports = tuple(wanted for one in _statements(tree, types=of_package) for _, wanted in _imports(one, package))
    if not ours:
        imports += tuple(wanted for one in ast.walk(tree) for wanted in _called(one, package))
    bound = {as_name: wanted for one in _statements(tree, types=True) for as_name, wanted in _imports(one, package)}
    names_data = not ours or any(end.encode() in held for end in _DATA_OF_OURS)
    named = texts(tree) if names_data else []
    there = named_there(named, (file.parent, _ASSETS)) if ours else []
    data = sorted(one for one in there if one.name.endswith(_DATA_OF_OURS) and one.is_file())
    return Module(digest(held), data, [] if ours else named, of_package, imports, bound)


def _statements(tree: ast.Module, *, types: bool) -> Iterator[ast.AST]:
    """All statements of a source, outer ones first; with those that are for types alone, or without."""
    waiting: list[ast.AST] = [tree]
    for one in waiting:
        yield one
        of_types = isinstance(one, ast.If) and ast.unparse(one.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
        for inner in ("body", "handlers", "orelse", "finalbody", "cases"):
            if types or not (of_types and inner == "body"):
                waiting += getattr(one, inner, ())


def _imports(one: ast.AST, package: str) -> Iterator[tuple[str, Wanted]]:
    """The names that an import binds, each with the module and the name in it."""
    if isinstance(one, ast.Import):
        for alias in one.names:
            yield alias.asname or alias.name, (alias.name, "" if "." in alias.name and not alias.asname else ALL)
    elif isinstance(one, ast.ImportFrom):
        try:
            origin = resolve_name("." * one.level + (one.module or ""), package)
        except ImportError:  # nor can it run
            return
        for alias in one.names:
            yield alias.asname or alias.name, (origin, alias.name)


def _called(one: ast.AST, package: str) -> Iterator[Wanted]:
    """The module that is imported by a call, such as `importlib.import_module("helper")`."""
    if isinstance(one, ast.Call) and ast.unparse(one.func).rpartition(".")[2] in ("import_module", "__import__"):
        match one.args:
            case [ast.Constant(value=str(name)), *_] if name.strip("."):
                with suppress(ImportError):
                    yield resolve_name(name, package), ""
