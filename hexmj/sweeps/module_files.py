"""Where the sources of modules lie, found without running them."""

import os
import sys
import sysconfig
from importlib.machinery import all_suffixes
from importlib.util import find_spec
from pathlib import Path

from hexmj.user_code.sources_as_run import is_installed

_STANDARD = sysconfig.get_path("stdlib")
_FILES: dict[str, Path | None] = {}


def file_of(module: str) -> Path | None:
    """The file of a module, found without running anything; None of what has none yet or is Python's own."""
    if module not in _FILES and (file := _found(module)):
        _FILES[module] = None if file.is_relative_to(_STANDARD) and not is_installed(file) else file
    return _FILES.get(module)


def _found(module: str) -> Path | None:
    top, *inner = module.split(".")
    if (file := getattr(sys.modules.get(module), "__file__", None)) is not None:
        return Path(file)
    spec = find_spec(top) if top not in sys.modules else getattr(sys.modules[top], "__spec__", None)
    if spec is None or not inner:
        return Path(spec.origin) if spec and spec.has_location and spec.origin else None
    for folder in spec.submodule_search_locations or ():
        if os.path.isdir(os.path.join(folder, *inner[:-1])):  # most names that are asked for are in no package
            stem = os.path.join(folder, *inner)
            for file in (*(stem + ending for ending in all_suffixes()), os.path.join(stem, "__init__.py")):
                if os.path.isfile(file):
                    return Path(file)
    return None


def package_of(name: str) -> str:
    """The package that a module lies in; a script's, where it runs as a module of one."""
    return (getattr(sys.modules[name], "__package__", None) or "") if name == "__main__" else name.rpartition(".")[0]
