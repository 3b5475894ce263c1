"""The code that makes a value: the sources of all modules that it needs, and the versions of the packages.

Modules are followed from import to import without running them: through this package, the package that a function or a
user's object comes from, and whatever else is not installed, with the packages that they lie in.  What a module imports
for its types alone is left out.  Of installed packages all files count, but only the versions of those that this one
requires.  Of this package, whose `__init__` loads names as they are used, a name is followed to the one module it comes
from.  Its data files count that texts of its modules name.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from hexmj.errors import InputError
from hexmj.storage.files import digest, digest_of
from hexmj.sweeps.module_files import file_of, package_of
from hexmj.sweeps.module_sources import ALL, AT_FIRST, Module, Wanted, read_module
from hexmj.sweeps.plain_settings import PACKAGE, module_label
from hexmj.user_code import sources_as_run

CARRIERS = {
    *("h5netcdf", "h5py", "matplotlib", "rich", "tyro", "xarray"),
    *("hexmj.field_docs", "hexmj.process.progress", "hexmj.storage.files", "hexmj.storage.netcdf", "hexmj.sweeps"),
    *("hexmj.user_code.sources_as_run", "hexmj.user_code.opened_files"),
}
"""What carries, keeps and shows this package's numbers, but computes none: another version makes no cell anew, unless
a user's module imports it."""

_NO_PACKAGES = sys.stdlib_module_names | sources_as_run.SCRIPTS


@dataclass(frozen=True)
class Code:
    """What a value was made by."""

    sources: dict[str, str]
    """Module, or data file of this package -> digest."""
    versions: dict[str, str]
    """Python (major.minor) and packages -> version."""


class _Needed(NamedTuple):
    sources: dict[str, str]
    versions: dict[str, str]
    modules: list[tuple[str, Path, Module]]
    """With their names and files."""
    theirs: list[tuple[Path, list[str]]]
    """Files of a user's own modules, with their texts."""
    missing: set[str]
    """Modules without a file."""
    to_edit: set[str]
    """Files of what installed packages require and is installed to be edited."""


_KNOWN: dict[frozenset[str], _Needed] = {}


def code(modules: frozenset[str]) -> Code:
    """All that some modules need, and they themselves: sources as they ran.

    Raises:
        InputError: one has no source, or a source is not what this program ran.
    """
    needed = _needed(modules)
    sources = dict(needed.sources)
    for name, file, module in needed.modules:
        source = sources_as_run.as_run(file, name) or (file.read_bytes() if str(file) not in AT_FIRST else None)
        if source and digest(source) != needed.sources[module_label(name)]:
            raise InputError(f"{file} was edited while this program used it; start it again")
        sources |= {f"{name}, {path.name}": digest_of(path) for path in module.data}
    return Code(dict(sorted(sources.items())), needed.versions)


def texts_of_users(modules: frozenset[str]) -> list[tuple[Path, list[str]]]:
    """The user's own modules that some need, files with their texts.

    Raises:
        InputError: a module has no source.
    """
    return _needed(modules).theirs


def sources_of_users(modules: frozenset[str]) -> set[str]:
    """The same, as paths."""
    return {os.path.abspath(file) for file, _ in texts_of_users(modules)}


def sources_to_edit(modules: frozenset[str]) -> set[str]:
    """Files of what installed packages require, of those that some need, and is installed to be edited.

    Raises:
        InputError: a module has no source.
    """
    return _needed(modules).to_edit


def files_of_classes(modules: frozenset[str]) -> set[str]:
    """Files of some modules that are not this package's own, be they installed or not."""
    files = {os.path.abspath(file) for name in modules if (file := file_of(name))}
    return {file for file in files if not Path(file).is_relative_to(PACKAGE)}


def _needed(modules: frozenset[str]) -> _Needed:
    """As it was, unless a module has been found since that was not then."""
    if modules not in _KNOWN or any(map(file_of, _KNOWN[modules].missing)):
        _KNOWN[modules] = _follow(modules)
    return _KNOWN[modules]


def _follow(modules: frozenset[str]) -> _Needed:
    followed = {PACKAGE.name} | {name.partition(".")[0] for name in modules}
    waiting, seen = [(name, "") for name in modules], set[Wanted]()
    sources, installed, read, missing = {}, set[str](), [], set[str]()
    while waiting:
        wanted = name, attribute = waiting.pop()
        if wanted in seen:
            continue
        seen.add(wanted)
        top, file = name.partition(".")[0], file_of(name)
        if file is None and name in modules:
            raise InputError(f"{name} has no source; to keep what comes of a class or function, write it into a file")
        if CARRIERS & {name, top, name.rpartition(".")[0]}:
            continue
        inner = [(f"{name}.{attribute}", ALL)] if attribute.strip(ALL) and file_of(f"{name}.{attribute}") else []
        if file and sources_as_run.is_installed(file) and top != PACKAGE.name:
            installed |= {top} - _NO_PACKAGES
        if file and (top in followed or not sources_as_run.is_installed(file)):
            module = read_module(name, file)
            sources[module_label(name)] = module.digest
            read.append((name, file, module))
            ours = top == PACKAGE.name
            if not file.is_relative_to(PACKAGE):
                installed |= CARRIERS & {imported.partition(".")[0] for imported, _ in module.imports}
            whole = iter_modules([str(file.parent)]) if attribute == ALL and module.package and not ours else ()
            inner += [(f"{name}.{one.name}", ALL) for one in whole]
            waiting += _of_our_own(attribute, module, inner) if ours else [*module.imports, *inner, *_above(name)]
        elif inner:  # of a folder without an `__init__`
            waiting += inner
        else:
            installed |= {top} - _NO_PACKAGES
            if file is None and top in installed:
                missing |= {name, f"{name}.{attribute}" if attribute.strip(ALL) else name}
    names = installed | ({"llvmlite"} if "numba" in installed else set())
    from hexmj.sweeps.packages import sources_to_edit, versions

    told = {"python": f"{sys.version_info.major}.{sys.version_info.minor}"} | versions(sorted(names))
    files = (str(file) for _, file, _ in read)
    if anew := sources_as_run.made_anew([*(name.replace("-", "_") for name in told), *files]):
        raise InputError(f"{anew} was made or installed anew while this program used it; start it again")
    theirs = [(file, module.texts) for _, file, module in read if not file.is_relative_to(PACKAGE)]
    return _Needed(sources, told, read, theirs, missing, sources_to_edit(names))


def _of_our_own(attribute: str, module: Module, inner: list[Wanted]) -> Sequence[Wanted]:
    """What a name of a module of this package needs: of an `__init__`, the one module that it comes from."""
    passed_on = inner + ([module.bound[attribute]] if attribute in module.bound else [])
    return passed_on if module.package and passed_on else module.imports


def _above(name: str) -> list[Wanted]:
    """The package that a module lies in, which runs before it."""
    above = package_of(name)
    return [(above, "")] if above and file_of(above) else []
