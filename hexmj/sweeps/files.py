"""Kept cells: NetCDF and a checksum, written whole or not at all and believed only if nothing is amiss."""

import hashlib
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

MARK = b"\nhexmj cell, sha256 "
"""Between the NetCDF and its checksum; readers of NetCDF do not mind what follows."""

TAIL = len(MARK) + 64
RECORD = "cell"
"""Attribute of the file: what the cell depends on, as JSON."""


def encode(data: "xr.Dataset", record: str) -> bytes:
    """A cell as it stands in its file; the bits of all numbers stay."""
    told = data.drop_encoding().assign_attrs({RECORD: record})
    for variable in told.variables.values():
        variable.encoding["_FillValue"] = None
    content = bytes(told.to_netcdf(engine="h5netcdf"))
    return content + MARK + hashlib.sha256(content).hexdigest().encode()


def decode(whole: bytes, record: str, path: Path) -> "xr.Dataset":
    """The data of a cell.

    Args:
        whole: as `encode` gave it.
        record: that the cell must have.
        path: where it comes from, for the sentence.

    Raises:
        InputError: it is damaged, or of another cell.
    """
    import xarray as xr

    content, tail = whole[:-TAIL], whole[-TAIL:]
    if tail != MARK + hashlib.sha256(content).hexdigest().encode():
        raise InputError(f"{path} is damaged, or no cell of a sweep; delete it, and it is made anew")
    data = xr.load_dataset(io.BytesIO(content), engine="h5netcdf", decode_times=False)
    if data.attrs.pop(RECORD, None) != record:
        raise InputError(f"{path} is another cell than its name says; delete it, and it is made anew")
    return data


def read(path: Path) -> bytes:
    """A kept cell, not yet believed; of a file that is none only the end is read.

    Raises:
        InputError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            file.seek(-min(TAIL, file.seek(0, os.SEEK_END)), os.SEEK_END)
            tail = file.read()
            file.seek(0)
            return file.read() if tail.startswith(MARK) else tail
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None


def write(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, whoever else writes the same; a killed writer leaves a `.part-` file.

    Raises:
        InputError: it cannot be written.
    """
    part = path.with_name(f".part-{uuid4().hex}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        part.unlink(missing_ok=True)
