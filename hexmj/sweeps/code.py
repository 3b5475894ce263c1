"""The code that makes a value: the sources of all modules that it needs, and the versions of the packages.

Modules are followed from import to import without running them: through this package, the package that a function or a
user's object comes from, and whatever else is not installed, with the packages that they lie in.  What a module imports
for its types alone is left out.  Of this package, whose `__init__` loads names as they are used, a name is followed to
the one module it comes from.  Its data files count that texts of its modules name.
"""

import ast
import os
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.machinery import all_suffixes
from importlib.util import find_spec, resolve_name
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from hexmj.errors import InputError
from hexmj.storage.files import digest, digest_of
from hexmj.storage.mjcf import parts
from hexmj.sweeps.plain_settings import PACKAGE, module_label
from hexmj.user_code import sources_as_run
from hexmj.user_code.opened_files import spelled
from hexmj.user_code.parsing import named_there, parsed, texts

CARRIERS = {
    *("h5netcdf", "h5py", "matplotlib", "rich", "tyro", "xarray"),
    *("hexmj.field_docs", "hexmj.process.progress", "hexmj.storage.files", "hexmj.storage.netcdf", "hexmj.sweeps"),
    *("hexmj.user_code.sources_as_run", "hexmj.user_code.opened_files"),
}
"""What carries, keeps and shows this package's numbers, but computes none: another version makes no cell anew, unless
a user's module imports it."""

_DATA_OF_OURS = ".toml", ".xml"
"""Ends of the names of data files."""

_MODELS = ".xml", ".mjcf", ".urdf"
"""The same of models that MuJoCo opens with all their parts, in small letters or capitals."""

_UNHEARD = *_MODELS, ".mjb", ".pt", ".pth", ".onnx", ".safetensors", ".h5", ".hdf5", ".parquet"
"""The same of all that libraries may open by themselves, where nobody hears it."""

_DATA = *_UNHEARD, ".toml", ".json", ".jsonl", ".yaml", ".yml", ".csv", ".tsv", ".txt", ".npy", ".npz", ".pkl"
"""The same of all data of a user's own."""

OPEN_BY_THEMSELVES = {"cv2", "duckdb", "polars", "pyarrow"}
"""Packages that open any data unheard."""

_DEEP = 3
"""So many folders above one another are looked through for what texts of a user's own name, and so many within."""

_Wanted = tuple[str, str]
"""A module, and the name that is taken from it; no name where it is the module itself."""

_ALL = "*"
"""Stands for all names of a module; of a package they may be its modules, whoever has imported them."""

_ASSETS = PACKAGE / "assets" if (PACKAGE / "assets").is_dir() else PACKAGE.parent / "assets"
"""Of an installed package, and of one that runs from its repository."""

_STANDARD = sysconfig.get_path("stdlib")
_FILES_OF_OURS = (os.path.join(folder, name) for folder, _, names in os.walk(PACKAGE) for name in names)
_AT_FIRST = {file: os.stat(file).st_mtime_ns for file in _FILES_OF_OURS if file.endswith(".py")}
"""Source of this package -> when it was changed last, as of this program's beginning."""


@dataclass(frozen=True)
class Code:
    """What a value was made by."""

    sources: dict[str, str]
    """Module, or data file of this package -> digest."""
    versions: dict[str, str]
    """Python (major.minor) and packages -> version."""


@dataclass(frozen=True)
class _Module:
    digest: str
    data: list[Path]
    """Of this package, that its texts name."""
    texts: list[str]
    """Of a user's own, some of which may name files of data or their folders."""
    package: bool
    """It is an `__init__`."""
    imports: tuple[_Wanted, ...]
    bound: dict[str, _Wanted]
    """Name -> the import it comes from, those for types included."""


class _Needed(NamedTuple):
    sources: dict[str, str]
    versions: dict[str, str]
    modules: list[tuple[str, Path, _Module]]
    """With their names and files."""
    theirs: list[tuple[Path, list[str]]]
    """Files of a user's own modules, with their texts."""
    missing: set[str]
    """Modules without a file."""
    to_edit: set[str]
    """Files of what installed packages require and is installed to be edited."""


_KNOWN: dict[frozenset[str], _Needed] = {}
_FILES: dict[str, Path] = {}


def code(modules: frozenset[str]) -> Code:
    """All that some modules need, and they themselves: sources as they ran.

    Raises:
        InputError: one has no source, or a source is not what this program ran.
    """
    needed = _needed(modules)
    sources = dict(needed.sources)
    for name, file, module in needed.modules:
        source = sources_as_run.as_run(file, name) or (file.read_bytes() if str(file) not in _AT_FIRST else None)
        if source and digest(source) != needed.sources[module_label(name)]:
            raise InputError(f"{file} was edited while this program used it; start it again")
        sources |= {f"{name}, {path.name}": digest_of(path) for path in module.data}
    return Code(dict(sorted(sources.items())), needed.versions)


def sources_of_users(modules: frozenset[str]) -> set[str]:
    """Files of the user's own modules that some need.

    Raises:
        InputError: a module has no source.
    """
    return {os.path.abspath(file) for file, _ in _needed(modules).theirs}


def sources_to_edit(modules: frozenset[str]) -> set[str]:
    """Files of what installed packages require, of those that some need, and is installed to be edited.

    Raises:
        InputError: a module has no source.
    """
    return _needed(modules).to_edit


def files_of_classes(modules: frozenset[str]) -> set[str]:
    """Files of some modules that are not this package's own, be they installed or not."""
    files = {os.path.abspath(file) for name in modules if (file := _file(name))}
    return {file for file in files if not Path(file).is_relative_to(PACKAGE)}


def data_of_users(modules: frozenset[str]) -> tuple[set[str], set[str]]:
    """Of the data that texts of these name, as far as they are there: what may be opened unheard, with its parts, and
    the rest.

    Files are looked for beside each module, in the current folder, in those above them, and in folders there that texts
    name.

    Raises:
        InputError: a module has no source; a file cannot be read.
    """
    theirs = _needed(modules).theirs
    named = {text for _, one in theirs for text in one}
    if not any(text.lower().endswith(_DATA) for text in named):
        return set(), set()
    before = tuple(f"/{text}" for file, one in theirs if str(file) in sources_as_run.BEFORE for text in one)
    beside = [Path.cwd() / "here", *(file for file, _ in theirs)]
    folders = [folder for one in beside for folder in one.parents[:_DEEP]]
    found = [one for one in named_there(named, folders, _DEEP) if one.name.lower().endswith(_DATA) and one.is_file()]
    unheard = {one for one in found if one.name.lower().endswith(_UNHEARD) or one.as_posix().endswith(before)}
    whole = {spelled(part) for path in unheard for part in _parts(path)}
    return whole, {spelled(path) for path in found} - whole


def _parts(path: Path) -> list[Path]:
    """A file with all that MuJoCo opens with it; none once it is gone."""
    try:
        return parts(path) if path.name.lower().endswith(_MODELS) else [path]
    except InputError as error:
        if isinstance(error.__context__, FileNotFoundError):
            return []
        raise


def _needed(modules: frozenset[str]) -> _Needed:
    """As it was, unless a module has been found since that was not then."""
    if modules not in _KNOWN or any(map(_file, _KNOWN[modules].missing)):
        _KNOWN[modules] = _follow(modules)
    return _KNOWN[modules]


def _follow(modules: frozenset[str]) -> _Needed:
    followed = {PACKAGE.name} | {name.partition(".")[0] for name in modules}
    waiting, seen = [(name, "") for name in modules], set[_Wanted]()
    sources, installed, read, missing = {}, set[str](), [], set[str]()
    while waiting:
        wanted = name, attribute = waiting.pop()
        if wanted in seen:
            continue
        seen.add(wanted)
        top, file = name.partition(".")[0], _file(name)
        if file is None and name in modules:
            raise InputError(f"{name} has no source; to keep what comes of a class or function, write it into a file")
        if CARRIERS & {name, top, name.rpartition(".")[0]}:
            continue
        inner = [(f"{name}.{attribute}", _ALL)] if attribute.strip(_ALL) and _file(f"{name}.{attribute}") else []
        if file and (top in followed or not _is_installed(file)):
            module = _read(name, file)
            sources[module_label(name)] = module.digest
            read.append((name, file, module))
            ours = top == PACKAGE.name
            if not file.is_relative_to(PACKAGE):
                installed |= CARRIERS & {imported.partition(".")[0] for imported, _ in module.imports}
            whole = iter_modules([str(file.parent)]) if attribute == _ALL and module.package and not ours else ()
            inner += [(f"{name}.{one.name}", _ALL) for one in whole]
            waiting += _of_our_own(attribute, module, inner) if ours else [*module.imports, *inner, *_above(name)]
        elif inner:  # of a folder without an `__init__`
            waiting += inner
        else:
            installed |= {top} - sys.stdlib_module_names
            if file is None and top in installed:
                missing |= {name, f"{name}.{attribute}" if attribute.strip(_ALL) else name}
    names = installed | ({"llvmlite"} if "numba" in installed else set())
    from hexmj.sweeps.packages import sources_to_edit, versions

    told = {"python": f"{sys.version_info.major}.{sys.version_info.minor}"} | versions(sorted(names))
    theirs = [(file, module.texts) for _, file, module in read if not file.is_relative_to(PACKAGE)]
    return _Needed(sources, told, read, theirs, missing, sources_to_edit(names))


def _of_our_own(attribute: str, module: _Module, inner: list[_Wanted]) -> Sequence[_Wanted]:
    """What a name of a module of this package needs: of an `__init__`, the one module that it comes from."""
    passed_on = inner + ([module.bound[attribute]] if attribute in module.bound else [])
    return passed_on if module.package and passed_on else module.imports


def _package(name: str) -> str:
    """The package that a module lies in; a script's, where it runs as a module of one."""
    return (getattr(sys.modules[name], "__package__", None) or "") if name == "__main__" else name.rpartition(".")[0]


def _above(name: str) -> list[_Wanted]:
    """The package that a module lies in, which runs before it."""
    above = _package(name)
    return [(above, "")] if above and _file(above) else []


def _file(module: str) -> Path | None:
    """The file of a module, found without running anything; None of what has none yet or is Python's own."""
    if module not in _FILES and (file := _found(module)):
        _FILES[module] = file
    file = _FILES.get(module)
    of_python = file and file.is_relative_to(_STANDARD) and not _is_installed(file)
    return None if of_python else file


def _found(module: str) -> Path | None:
    top, *inner = module.split(".")
    if (file := getattr(sys.modules.get(module), "__file__", None)) is not None:
        return Path(file)
    spec = find_spec(top) if top not in sys.modules else getattr(sys.modules[top], "__spec__", None)
    if spec is None or not inner:
        return Path(spec.origin) if spec and spec.has_location and spec.origin else None
    for folder in spec.submodule_search_locations or ():
        stem = Path(folder, *inner)
        for file in (*(stem.with_name(stem.name + ending) for ending in all_suffixes()), stem / "__init__.py"):
            if file.is_file():
                return file
    return None


def _is_installed(file: Path) -> bool:
    return not sources_as_run.INSTALLED.isdisjoint(file.parts)


@cache
def _read(name: str, file: Path) -> _Module:
    try:
        changed, held = file.stat().st_mtime_ns, sources_as_run.as_run(file, name) or file.read_bytes()
    except OSError as error:  # as of one in an archive
        raise InputError(f"{file} cannot be read: {error.strerror}; expected sources as files") from None
    if _AT_FIRST.get(str(file), changed) != changed:
        raise InputError(f"{file} was edited since this program began; start it again")
    python = b"" if file.name.endswith(sources_as_run.COMPILED) else held  # of a compiled module nothing is followed
    package = name if file.name == "__init__.py" else _package(name)
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
    named = texts(tree)
    there = named_there(named, (file.parent, _ASSETS)) if ours else []
    data = sorted(one for one in there if one.name.endswith(_DATA_OF_OURS) and one.is_file())
    return _Module(digest(held), data, [] if ours else named, of_package, imports, bound)


def _statements(tree: ast.Module, *, types: bool) -> Iterator[ast.AST]:
    """All statements of a source, outer ones first; with those that are for types alone, or without."""
    waiting: list[ast.AST] = [tree]
    for one in waiting:
        yield one
        of_types = isinstance(one, ast.If) and ast.unparse(one.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
        for inner in ("body", "handlers", "orelse", "finalbody", "cases"):
            if types or not (of_types and inner == "body"):
                waiting += getattr(one, inner, ())


def _imports(one: ast.AST, package: str) -> Iterator[tuple[str, _Wanted]]:
    """The names that an import binds, each with the module and the name in it."""
    if isinstance(one, ast.Import):
        for alias in one.names:
            yield alias.asname or alias.name, (alias.name, "" if "." in alias.name and not alias.asname else _ALL)
    elif isinstance(one, ast.ImportFrom):
        try:
            origin = resolve_name("." * one.level + (one.module or ""), package)
        except ImportError:  # nor can it run
            return
        for alias in one.names:
            yield alias.asname or alias.name, (origin, alias.name)


def _called(one: ast.AST, package: str) -> Iterator[_Wanted]:
    """The module that is imported by a call, such as `importlib.import_module("helper")`."""
    if isinstance(one, ast.Call) and ast.unparse(one.func).rpartition(".")[2] in ("import_module", "__import__"):
        match one.args:
            case [ast.Constant(value=str(name)), *_] if name.strip("."):
                with suppress(ImportError):
                    yield resolve_name(name, package), ""
