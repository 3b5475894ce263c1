"""The one format of all data: NetCDF 4, uncompressed, made and read in memory; on disk it is sealed."""

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING

from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

READ_OTHERWISE = {"scale_factor", "add_offset", "missing_value", "_FillValue"}
"""Attributes by which readers of NetCDF change numbers."""

_ENCODING = Lock()
"""Held while Dask's settings are other ones."""


def encode(data: "xr.Dataset") -> bytes:
    """A dataset as it stands in its file, before the seal; the bits of all numbers stay.

    Raises:
        InputError: something that NetCDF cannot hold.
    """
    plain = data.drop_encoding()
    for name, variable in plain.variables.items():
        texts = variable.dtype != object or all(isinstance(one, str) for one in variable.values.flat)
        if variable.dtype.kind in "mM" or not texts:
            raise InputError(f"NetCDF cannot hold this: {name} is {variable.dtype}; expected arrays, numbers and texts")
        if odd := READ_OTHERWISE & {*variable.attrs}:
            raise InputError(f"NetCDF would give other numbers: {name} has the attribute {min(odd)}; expected none")
        variable.encoding["_FillValue"] = None
    try:
        with _no_lock_of_dask():
            return bytes(plain.to_netcdf(engine="h5netcdf"))
    except (TypeError, ValueError, OverflowError, NotImplementedError) as error:
        raise InputError(f"NetCDF cannot hold this: {error}; expected arrays, numbers and texts") from None


@contextmanager
def _no_lock_of_dask() -> Iterator[None]:
    """While the block runs, xarray asks no Dask cluster for a lock that this process works for: nobody else writes to
    its memory, and the cluster does not know such a file."""
    try:
        import dask.config
    except ImportError:
        yield
        return
    with _ENCODING, dask.config.set(scheduler="synchronous"):
        yield


def decode(content: bytes | None, otherwise: str) -> "xr.Dataset":
    """The dataset that `encode` was given.

    Args:
        content: what was sealed; None where it was not, or is damaged.
        otherwise: what to say of anything else.

    Raises:
        InputError: `otherwise`; nothing of the size that a false file may claim is allocated.
    """
    import h5netcdf
    import xarray as xr

    if content is None:
        raise InputError(otherwise)
    try:
        with h5netcdf.File(io.BytesIO(content), "r") as file:
            claimed = sum(math.prod(one.shape) * one.dtype.itemsize for one in file.variables.values())
        if claimed <= len(content):
            return xr.load_dataset(io.BytesIO(content), engine="h5netcdf", decode_times=False)
    except Exception as error:  # whatever the libraries make of what is sealed, but not by `encode`
        raise InputError(f"{otherwise} ({type(error).__name__})") from None
    raise InputError(otherwise)
