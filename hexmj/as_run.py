"""Sources of a user's modules as this program ran them, whatever became of the files since.

They are noted as modules run, from the first import of this package on; those that ran before are read then.
"""

import os
import re
import sys
import sysconfig
from contextlib import suppress
from importlib.machinery import BYTECODE_SUFFIXES, EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

from hexmj.errors import InputError
from hexmj.files import digest

_NOT_ITS_USERS = tuple(
    f"{folder}{os.sep}"
    for folder in (
        *(sysconfig.get_path(one) for one in ("stdlib", "platstdlib", "purelib", "platlib")),
        Path(__file__).parent,
    )
)

DATA = re.compile(r"""["']([\w. /\\-]+\.(?:toml|xml|json))["']""")
"""Names of data files in a source."""

COMPILED = (*BYTECODE_SUFFIXES, *EXTENSION_SUFFIXES)
"""Ends of the names of modules without a source."""

_RUN: dict[str, list[bytes]] = {}
"""File -> what ran of it, each version once."""

_READ: dict[Path, bytes] = {}
"""Data file -> what it held when the first module that names it ran, which may have read it then."""


def as_run(file: Path, stamp: str = "") -> bytes | None:
    """The source of a file as it ran; None of one that did not.

    Args:
        file: of Python.
        stamp: the first digits of the digest of the version that is meant.

    Raises:
        InputError: it ran in several versions, and none or more than one is meant.
    """
    if (versions := _RUN.get(str(file))) is None:
        return None
    meant = [one for one in versions if digest(one).startswith(stamp)]
    if len(meant) != 1:
        raise InputError(f"{file} was edited while this program used it; start it again")
    return meant[0]


def data_names(source: bytes) -> list[str]:
    """The data files that a source names."""
    return DATA.findall(source.decode(errors="replace"))


def data_folders(file: Path) -> list[Path]:
    """Where the data files of a module of the user's own lie."""
    return [file.parent, Path.cwd()]


def data(path: Path) -> bytes:
    """What a data file holds, and what it held when a module that names it ran, if that was something else."""
    now = path.read_bytes()
    return now if (then := _READ.get(path, now)) == now else now + then


def _note(file: Any) -> None:
    if isinstance(file, str) and not file.endswith(COMPILED) and not file.startswith(_NOT_ITS_USERS):
        with suppress(OSError):
            source = Path(file).read_bytes()
            if source not in (versions := _RUN.setdefault(file, [])):
                versions.append(source)
            for path in (folder / name for name in data_names(source) for folder in data_folders(Path(file))):
                if path not in _READ and path.is_file():
                    _READ[path] = path.read_bytes()


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "exec" and getattr(arguments[0], "co_name", "") == "<module>":
        _note(arguments[0].co_filename)


for _module in list(sys.modules.values()):
    _note(getattr(_module, "__file__", None))
sys.addaudithook(_hear)
