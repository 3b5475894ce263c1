"""Kept cells: data and the record of all that they depend on, believed only if nothing is amiss."""

from pathlib import Path
from typing import TYPE_CHECKING

from hexmj.errors import InputError
from hexmj.storage import netcdf
from hexmj.storage.files import read_sealed, sealed, write_whole

if TYPE_CHECKING:
    import xarray as xr

RECORD = "cell"
"""Attribute of the file: what the cell depends on, as JSON."""


def check_free(name: str, data: "xr.Dataset") -> None:
    """Refuse data of a cell with an attribute of the name that is wanted here."""
    if RECORD in data.attrs:
        raise InputError(f"what {name} gives has the attribute {RECORD!r}, which kept cells have; rename it")


def write(path: Path, record: str, data: "xr.Dataset") -> "xr.Dataset":
    """Keep the data of a cell with its record, and give them as they will be read.

    Raises:
        InputError: they cannot be written, or the sweep's folder is no longer there.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} was removed or renamed while it was in use; nothing more is written there")
    content = netcdf.encode(data.assign_attrs({RECORD: record}))
    write_whole(path, sealed(content))
    return _decode(path, content, record)


def find(path: Path, record: str) -> "xr.Dataset | None":
    """The data of a kept cell, if there is one.

    Raises:
        InputError: it cannot be read, is damaged, or has another record.
    """
    return _decode(path, read_sealed(path), record) if path.exists() else None


def _decode(path: Path, content: bytes | None, record: str) -> "xr.Dataset":
    data = netcdf.decode(content, f"{path} is damaged, or no cell of a sweep; delete it, and it is made anew")
    if data.attrs.pop(RECORD, None) != record:
        raise InputError(f"{path} is another cell than its name says; delete it, and it is made anew")
    return data
