"""Kept cells: data and the record of all that they depend on, believed only if nothing is amiss."""

from pathlib import Path
from typing import TYPE_CHECKING

from hexmj import netcdf
from hexmj.errors import InputError
from hexmj.files import read_sealed, sealed, write_whole

if TYPE_CHECKING:
    import xarray as xr

RECORD = "cell"
"""Attribute of the file: what the cell depends on, as JSON."""


def write(path: Path, record: str, data: "xr.Dataset") -> "xr.Dataset":
    """Keep a cell with the record of what it depends on, and give its data as they will be read.

    Raises:
        InputError: it cannot be written, or the sweep's folder is no longer there.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} was removed or renamed while it was in use; nothing more is written there")
    content = netcdf.encode(data.assign_attrs({RECORD: record}))
    write_whole(path, sealed(content))
    return _decode(content, record, path)


def read(path: Path, record: str) -> "xr.Dataset":
    """The data of a kept cell.

    Raises:
        InputError: it cannot be read, is damaged, or has another record.
    """
    return _decode(read_sealed(path), record, path)


def _decode(content: bytes | None, record: str, path: Path) -> "xr.Dataset":
    data = netcdf.decode(content, f"{path} is damaged, or no cell of a sweep; delete it, and it is made anew")
    if data.attrs.pop(RECORD, None) != record:
        raise InputError(f"{path} is another cell than its name says; delete it, and it is made anew")
    return data
