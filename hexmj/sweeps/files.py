"""Kept cells: data and the record of all that they depend on, believed only if nothing is amiss.

What a cell's code reads is known only once it is computed, so its file tells that, too: where something has changed
since, the cell is made anew and kept beside.
"""

from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from hexmj.errors import InputError
from hexmj.storage import netcdf
from hexmj.storage.files import digest, read_sealed, sealed, write_whole

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.sweeps.cells import Cell

RECORD = "cell"
"""Attribute of the file: what the cell depends on, as JSON."""

READ = "read"
"""Attribute of the file, or first word of a ledger's line: what was read as it was made, as JSON; see `Cell.reads`."""


def check_free(cell: "Cell", data: "xr.Dataset") -> None:
    """Refuse data with an attribute of a name that is wanted here."""
    if taken := {RECORD, READ} & data.attrs.keys():
        raise InputError(f"what {cell.name} gives has the attribute {min(taken)!r}, which kept cells have; rename it")


def write(path: Path, cell: "Cell", record: str, data: "xr.Dataset") -> tuple["xr.Dataset", str]:
    """Keep a cell with the record of what it depends on and with what it read.

    Returns:
        Its data as they will be read, and what it read.

    Args:
        path: of the file, unless it is taken by the same cell of other reads.
        cell: that was computed.
        record: of it.
        data: that it gave.

    Raises:
        InputError: it cannot be written, or the sweep's folder is no longer there.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} was removed or renamed while it was in use; nothing more is written there")
    told = cell.reads()
    if path.exists() and _decode(path, read_sealed(path), record)[1] != told:
        path = path.with_name(f"{path.stem}.{digest(told.encode())}.nc")
    content = netcdf.encode(data.assign_attrs({RECORD: record, READ: told}))
    write_whole(path, sealed(content))
    return _decode(path, content, record)


def find(path: Path, cell: "Cell", record: str) -> tuple["xr.Dataset", str] | None:
    """As `write` has given them, if there is a kept cell, and all that it read is as it was; arguments as there.

    Raises:
        InputError: it cannot be read, is damaged, or has another record.
    """
    if path.exists():
        for one in (path, *sorted(path.parent.glob(f"{escape(path.stem)}.*.nc"))):
            kept = _decode(one, read_sealed(one), record)
            if not cell.edited(kept[1]):
                return kept
    return None


def _decode(path: Path, content: bytes | None, record: str) -> tuple["xr.Dataset", str]:
    """The data, and what was read for them."""
    data = netcdf.decode(content, f"{path} is damaged, or no cell of a sweep; delete it, and it is made anew")
    if data.attrs.pop(RECORD, None) != record:
        raise InputError(f"{path} is another cell than its name says; delete it, and it is made anew")
    return data, data.attrs.pop(READ, "{}")
