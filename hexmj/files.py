"""Files that are written completely or not at all, and the two formats that hexmj reads: NetCDF and TOML."""

import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

SEARCHED = "searched"
"""Key of the table in a TOML file of `hexmj search` that holds the seeds of the starts used in the search."""


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Provide a temporary path in the folder of `path`. If the block raises no error, its file replaces `path`."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".part-{uuid4().hex}{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> Path:
    """Write a text file in UTF-8, and return its path."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
    return Path(path)


def write_netcdf(data: "xr.Dataset", path: Path | str) -> Path:
    """Write a dataset as NetCDF 4 without changing a bit of its numbers, and return the path.

    Raises:
        InputError: NetCDF cannot store an attribute or variable.
    """
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    plain = data.drop_encoding()
    for variable in plain.variables.values():
        variable.encoding["_FillValue"] = None
    no_lock: Any = False
    with replacing(path) as part:
        try:
            with h5netcdf.File(part, "w") as file:  # `to_netcdf` would ask a Dask cluster for a lock
                plain.dump_to_store(H5NetCDFStore(file, lock=no_lock))
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: NetCDF cannot store this dataset: {error}") from None
    return Path(path)


def read_netcdf(path: Path | str) -> "xr.Dataset":
    """Read a dataset that `write_netcdf` wrote.

    Raises:
        InputError: the file cannot be read, or is not NetCDF.
    """
    import xarray as xr

    _check_file(path)
    try:
        return xr.load_dataset(path, engine="h5netcdf", decode_times=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as NetCDF: {error}") from None


def read_toml(path: Path | str) -> dict[str, Any]:
    """Read a TOML file as a dict.

    Raises:
        InputError: the file cannot be read, or is not TOML.
    """
    _check_file(path)
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from None


def _check_file(path: Path | str) -> None:
    if not Path(path).is_file():
        raise InputError(f"{path}: there is no such file")
