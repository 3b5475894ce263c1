"""Kept cells: data and the record of all that they depend on, believed only if nothing is amiss."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from hexmj.errors import InputError
from hexmj.storage import netcdf
from hexmj.storage.files import read_sealed, sealed, write_whole

if TYPE_CHECKING:
    import xarray as xr

RECORD = "cell"
"""Attribute of the file: what the cell depends on, as JSON."""

READ = "read"
"""Attribute of the file: what else its code has read, file -> digest, as JSON; without it, nothing."""


def check_free(name: str, data: "xr.Dataset") -> None:
    """Refuse data of a cell with an attribute of a name that is wanted here."""
    if taken := [one for one in (RECORD, READ) if one in data.attrs]:
        raise InputError(f"what {name} gives has the attribute {taken[0]!r}, which kept cells have; rename it")


def write(path: Path, record: str, read: dict[str, str], data: "xr.Dataset") -> "xr.Dataset":
    """Keep the data of a cell with its record and what else was read, and give them as they will be read.

    Raises:
        InputError: they cannot be written, or the sweep's folder is no longer there.
    """
    told = {RECORD: record} | ({READ: json.dumps(read, sort_keys=True)} if read else {})
    content = netcdf.encode(data.assign_attrs(told))
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} was removed or renamed while it was in use; nothing more is written there")
    write_whole(path, sealed(content))
    return _decode(path, content, record)[0]


def find(path: Path, record: str) -> tuple["xr.Dataset", dict[str, str]] | None:
    """The data of a kept cell, if there is one, and what else its code has read.

    Raises:
        InputError: it cannot be read, is damaged, a link to nothing, or has another record.
    """
    if path.is_symlink() and not path.exists():
        raise InputError(f"{path} is a link to nothing; delete it, and it is made anew")
    return _decode(path, read_sealed(path), record) if path.exists() else None


def _decode(path: Path, content: bytes | None, record: str) -> tuple["xr.Dataset", dict[str, str]]:
    data = netcdf.decode(content, f"{path} is damaged, or no cell of a sweep; delete it, and it is made anew")
    if data.attrs.pop(RECORD, None) != record:
        raise InputError(f"{path} is another cell than its name says; delete it, and it is made anew")
    return data, json.loads(data.attrs.pop(READ, "{}"))
