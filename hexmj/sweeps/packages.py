"""Installed packages as a cell's name tells them: by versions, and by files where these may change alone."""

from contextlib import suppress
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, packages_distributions, requires

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from hexmj.files import digest


@cache
def version(module: str) -> str:
    """Of the distributions that a module comes from, each with a digest of its files unless this package requires it: a
    helper of a user's own may be installed anew with the same version."""
    try:
        found = [Distribution.from_name(module)]
    except PackageNotFoundError:
        found = [Distribution.from_name(one) for one in {*packages_distributions().get(module, ())}]
    return " ".join(sorted(f"{one.version}{_files(one)}" for one in found)) or "unknown"


def _files(distribution: Distribution) -> str:
    """A digest of all that was installed beside metadata and scripts, which tell where it lies."""
    if canonicalize_name(distribution.name) in _required():
        return ""
    files = [one for one in distribution.files or () if ".." not in one.parts and ".dist-info" not in one.parts[0]]
    told = sorted(f"{one} {one.hash.value}" for one in files if one.hash)
    return f"@{digest(repr(told).encode())}" if told else ""


@cache
def _required() -> set[str]:
    """Distributions that this package requires, llvmlite by way of numba."""
    told = list[str]()
    with suppress(PackageNotFoundError):  # where it runs without having been installed
        told += requires("hexmj") or []
    return {canonicalize_name(Requirement(one).name) for one in told} | {"llvmlite"}
