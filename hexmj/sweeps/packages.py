"""Installed packages as a cell's name tells them: by versions, and by files where these may change alone."""

from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, packages_distributions, requires
from importlib.util import find_spec
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from hexmj.storage.files import digest, digest_of

NAMES = {"PIL": "pillow"}
"""Module -> distribution, of those that this package imports, where the names differ: to look through all that is
installed takes a third of a second."""


@cache
def version(module: str) -> str:
    """Of the distributions that a module comes from, each with a digest of its files unless this package requires it: a
    helper of a user's own may be installed anew, or edited where it lies, with the same version.  Of a module of none,
    that of its own files.
    """
    try:
        found = [Distribution.from_name(NAMES.get(module, module))]
    except PackageNotFoundError:
        found = [Distribution.from_name(one) for one in {*packages_distributions().get(module, ())}]
    return " ".join(sorted(f"{one.version}{_files(one)}" for one in found)) or _of_no_distribution(module)


def _files(distribution: Distribution) -> str:
    """A digest of all that was installed beside metadata and scripts, which tell where it lies: of Python's files as
    they are, of others as they were installed."""
    if canonicalize_name(distribution.name) in _required():
        return ""
    files = [one for one in distribution.files or () if ".." not in one.parts and ".dist-info" not in one.parts[0]]
    return _digest((str(one), _now(Path(str(one.locate()))) or one.hash.value) for one in files if one.hash)


def _of_no_distribution(module: str) -> str:
    """Without a version, a digest of all files of a module that was copied there."""
    spec = find_spec(module)
    folders = [Path(one) for one in (spec and spec.submodule_search_locations) or ()]
    alone = [Path(spec.origin)] if spec and spec.has_location and spec.origin and not folders else []
    places = [(one, one.parent) for one in alone] + [(one, folder) for folder in folders for one in folder.rglob("*")]
    files = [(one, folder) for one, folder in places if one.is_file() and "__pycache__" not in one.parts]
    return f"unknown{_digest((one.relative_to(folder).as_posix(), digest_of(one)) for one, folder in files)}"


def _now(file: Path) -> str:
    """A digest of a file of Python; none of others."""
    return digest_of(file) if file.suffix == ".py" and file.is_file() else ""


def _digest(told: Iterable[tuple[str, str]]) -> str:
    held = sorted(one for one in told if one[1])
    return f"@{digest(repr(held).encode())}" if held else ""


@cache
def _required() -> set[str]:
    """Distributions that this package requires, llvmlite by way of numba."""
    told = list[str]()
    with suppress(PackageNotFoundError):  # where it runs without having been installed
        told += requires("hexmj") or []
    return {canonicalize_name(Requirement(one).name) for one in told} | {"llvmlite"}
