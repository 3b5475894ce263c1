"""Installed packages as a cell's name tells them: by versions, and by files where these may change alone."""

import json
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import Distribution, PackageNotFoundError, packages_distributions, requires
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

from packaging.markers import UndefinedComparison, UndefinedEnvironmentName
from packaging.requirements import InvalidRequirement, Requirement
from packaging.utils import canonicalize_name

from hexmj.storage.files import digest, digest_of, state_of
from hexmj.sweeps.plain_settings import PACKAGE
from hexmj.user_code.parsing import alone
from hexmj.user_code.sources_as_run import is_installed

NAMES = {"PIL": "pillow"}
"""Module -> distribution, of those that this package imports, where the names differ: to look through all that is
installed takes a third of a second."""

SOURCES = ".py", *EXTENSION_SUFFIXES
"""Ends of the names of modules that are sources, or were compiled in place."""

LARGE = 1_000_000
"""Files of more bytes are told as they were installed, since compiled libraries of some packages hold gigabytes."""


def versions(modules: Iterable[str]) -> dict[str, str]:
    """Of some modules, see `version`, and of all that their distributions require, beyond what this package does; this
    one with a digest of its files, since nobody knows which of them they use."""
    told = {name: version(name) for name in modules}
    for name in _required_by(told):
        told.setdefault(name, version(name.replace("-", "_")))  # as modules are mostly called
    if PACKAGE.name in told:
        told[PACKAGE.name] += _digest(_held(PACKAGE))
    return told


def sources_to_edit(modules: Iterable[str]) -> set[str]:
    """Files of what these require, as `versions` tells it, and is installed to be edited."""
    required = [one for one in map(Distribution.from_name, _required_by(modules)) if not _is_required(one)]
    return {os.path.realpath(file) for one in required for file in _to_edit(one)}


def _required_by(modules: Iterable[str]) -> set[str]:
    """Names of the distributions that those of some modules require."""
    waiting, seen = [(one, "") for name in modules for one in _distributions(name)], set[tuple[str, str]]()
    for one, extra in waiting:
        for requirement in () if _is_required(one) else _requirements(one):
            name = canonicalize_name(requirement.name)
            with suppress(PackageNotFoundError, UndefinedComparison, UndefinedEnvironmentName):
                if requirement.marker and not requirement.marker.evaluate({"extra": extra}):
                    continue
                inner, new = Distribution.from_name(name), {(name, more) for more in ("", *requirement.extras)} - seen
                waiting += [(inner, more) for _, more in sorted(new)]
                seen |= new
    return {name for name, _ in seen}


@cache
def version(module: str) -> str:
    """Of the distributions that a module comes from, each with a digest of its files unless this package requires it: a
    helper of a user's own may be installed anew, or edited where it lies, with the same version.  Where nothing tells
    what was installed, that of the module's own files.
    """
    found = _distributions(module)
    told = sorted(f"{one.version}{_files(one)}" for one in found)
    if not any("@" in one for one in told) and not any(map(_is_required, found)):
        told.append(_of_no_distribution(module))
    return " ".join(told)


def _distributions(module: str) -> list[Distribution]:
    try:
        return [Distribution.from_name(NAMES.get(module, module))]
    except PackageNotFoundError:
        by_module = _by_module(tuple(state_of(one or ".") for one in sys.path))
        return [Distribution.from_name(one) for one in {*by_module.get(module, ())}]


@lru_cache(1)
def _by_module(_: tuple[object, ...]) -> Mapping[str, list[str]]:
    """Names of distributions, for folders that are as they are; to look through all that is installed takes seconds."""
    return packages_distributions()


def _requirements(distribution: Distribution) -> Iterator[Requirement]:
    for one in distribution.requires or ():
        with suppress(InvalidRequirement):
            yield _requirement(one)


def _requirement(text: str) -> Requirement:
    """What a distribution requires; Python parses the texts of its marker."""
    with alone():
        return Requirement(text)


def _is_required(distribution: Distribution) -> bool:
    return canonicalize_name(_name(distribution)) in _required()  # none where its metadata are not there


def _name(distribution: Distribution) -> str:
    """Its `name`, for which all of its description would be parsed, a dozen times as long."""
    found = re.search(r"^Name: *(\S+) *$", distribution.read_text("METADATA") or "", re.MULTILINE)
    return found[1] if found else str(distribution.name)


def _files(distribution: Distribution) -> str:
    """A digest of all that was installed beside metadata and scripts, which tell where it lies."""
    if _is_required(distribution):
        return ""
    files = [one for one in distribution.files or () if ".." not in one.parts and ".dist-info" not in one.parts[0]]
    told = list[tuple[str, str]]()
    for one in files:
        path = Path(str(one.locate()))
        if one.hash and not (path.is_file() and path.stat().st_size <= LARGE):
            told.append((str(one), one.hash.value))
        else:  # a folder is one that was linked
            told += [(f"{one}/{name}", held) for name, held in _held(path)]
    told += [(name, digest_of(Path(file))) for file, name in _to_edit(distribution).items()]
    return _digest(told)


def _to_edit(distribution: Distribution) -> dict[str, str]:
    """Sources of a distribution that is installed to be edited, and their names in the folder it tells of (PEP 610)."""
    with suppress(ValueError, AttributeError, KeyError, TypeError):  # of what tells nothing
        told = json.loads(distribution.read_text("direct_url.json") or "{}")
        if told.get("dir_info", {}).get("editable") and told["url"]:
            return _sources(Path(url2pathname(urlsplit(told["url"]).path)))
    return {}


@cache
def _sources(folder: Path) -> dict[str, str]:
    """Files of what can be imported from a folder, and their names in it."""
    found = [one for one in folder.rglob("*") if one.name.endswith(SOURCES) and one.is_file()]
    names = {str(one): one.relative_to(folder) for one in found if os.access(one, os.R_OK)}
    return {file: name.as_posix() for file, name in names.items() if not is_installed(name)}


def _of_no_distribution(module: str) -> str:
    """Without a version, a digest of all files of a module that was copied there."""
    spec = find_spec(module)
    alone = [Path(spec.origin)] if spec and spec.has_location and spec.origin else []
    places = [Path(one) for one in (spec and spec.submodule_search_locations) or alone]
    return f"unknown{_digest(one for place in places for one in _held(place))}"


def _held(place: Path) -> Iterator[tuple[str, str]]:
    """Digests of a file, or of all in a folder but what Python compiles, by their names from there."""
    for one in [place] if place.is_file() else place.rglob("*"):
        if one.is_file() and "__pycache__" not in one.parts:
            yield one.relative_to(place.parent).as_posix(), digest_of(one)


def _digest(told: Iterable[tuple[str, str]]) -> str:
    held = sorted(one for one in told if one[1])
    return f"@{digest(repr(held).encode())}" if held else ""


@cache
def _required() -> set[str]:
    """This package, whose modules a cell's name tells one by one, and what it requires, llvmlite by way of numba."""
    told = list[str]()
    with suppress(PackageNotFoundError):  # where it runs without having been installed
        told += requires("hexmj") or []
    return {canonicalize_name(_requirement(one).name) for one in told} | {"hexmj", "llvmlite"}
