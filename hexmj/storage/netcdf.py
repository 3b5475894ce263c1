"""The one format of all data: NetCDF 4, uncompressed, made and read in memory; on disk it is sealed."""

import io
import math
from collections.abc import Mapping
from numbers import Number
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.errors import InputError
from hexmj.storage.literal import literal

if TYPE_CHECKING:
    import xarray as xr

_NO_LOCK: Any = False
"""HDF5 has its own; one of xarray's stays locked in a process that is forked while another thread has it."""

TAKEN = {"coordinates"}
"""Attributes of the whole that readers of NetCDF take for orders, and away."""

TAKEN_OF_VARIABLES = TAKEN | {
    *("scale_factor", "add_offset", "missing_value", "_FillValue"),
    *("_Unsigned", "_Encoding", "dtype"),
}
"""The same of a variable; by most of them other numbers are read."""


def encode(data: "xr.Dataset") -> bytes:
    """A dataset as it stands in its file, before the seal; the bits of all numbers stay.

    Raises:
        InputError: something that NetCDF cannot hold.
    """
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    plain = data.drop_encoding()
    if odd := [name for name in (*plain.variables, *plain.dims) if not _is_text(name)]:
        raise InputError(f"NetCDF cannot hold this: the name {literal(repr(odd[0])):.80}; expected a text without NUL")
    _check_attributes("the dataset", plain.attrs, TAKEN)
    for name, variable in plain.variables.items():
        texts = variable.dtype != object or all(isinstance(one, str) for one in variable.values.flat)
        if variable.dtype.kind in "mM" or not texts:
            raise InputError(f"NetCDF cannot hold this: {name} is {variable.dtype}; expected arrays, numbers and texts")
        if name in plain.coords and name not in plain.dims and str(name).split() != [name]:
            raise InputError(
                f"NetCDF cannot hold this: the coordinate {name!r:.80} has a space in its name; expected none"
            )
        _check_attributes(str(name), variable.attrs, TAKEN_OF_VARIABLES)
        variable.encoding["_FillValue"] = None
    content = io.BytesIO()
    try:
        with h5netcdf.File(content, "w") as file:  # in to_netcdf xarray would ask Dask's cluster for a lock
            plain.compute().dump_to_store(H5NetCDFStore(file, lock=_NO_LOCK))
    except (TypeError, ValueError, OverflowError, NotImplementedError, AttributeError) as error:
        raise InputError(
            f"NetCDF cannot hold this: {literal(str(error))}; expected arrays, numbers and texts"
        ) from None
    return content.getvalue()


def _check_attributes(of: str, attributes: Mapping[Any, Any], taken: set[str]) -> None:
    """Refuse attributes that would not be read as they are, by their names in `taken` or by their values."""
    for name, value in attributes.items():
        if name in taken:
            raise InputError(f"NetCDF would be read otherwise: {of} has the attribute {name}; expected none")
        if not (name and _is_text(name) and (_is_text(value) or _are_texts(value) or _are_numbers(value))):
            told = f"{of} has the attribute {literal(f'{name} = {value!r}'):.80}"
            raise InputError(f"NetCDF cannot hold this: {told}; expected a text, a number, or a row of several")


def _is_text(value: Any) -> bool:
    return type(value) is str and "\0" not in value and value == value.encode(errors="replace").decode()


def _are_texts(value: Any) -> bool:
    """Whether it is a row of texts; of one alone the text would be read."""
    return isinstance(value, list | tuple) and len(value) != 1 and all(map(_is_text, value))


def _are_numbers(value: Any) -> bool:
    """Whether it is a number or a row of numbers; of one alone the number would be read."""
    if not isinstance(value, Number | np.ndarray | list | tuple):
        return False
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return False
    return array.dtype.kind in "iufc" and (array.ndim == 0 or (array.ndim == 1 and array.size != 1))


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
    from xarray.backends import H5NetCDFStore

    if content is None:
        raise InputError(otherwise)
    try:
        with h5netcdf.File(io.BytesIO(content), "r", decode_vlen_strings=True) as file:
            claimed = sum(math.prod(one.shape) * one.dtype.itemsize for one in file.variables.values())
            if claimed <= len(content):
                return xr.load_dataset(H5NetCDFStore(file, lock=_NO_LOCK), decode_times=False)
    except Exception as error:  # whatever the libraries make of what is sealed, but not by `encode`
        raise InputError(f"{otherwise} ({type(error).__name__})") from None
    raise InputError(otherwise)
